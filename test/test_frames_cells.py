# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cells: keys that know what figures depend on, rows that the statistics take, and the store."""

from dataclasses import replace
import json
import logging

from graph_factory import make_graph
import numpy as np
import pytest

from adversarial_lcd_ros.attack.attacker import AttackResult
from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.errors import ConfigError, EvaluationError
from adversarial_lcd_ros.evaluation.frames import cells as cells_module
from adversarial_lcd_ros.evaluation.frames.attacked import FrameResult
from adversarial_lcd_ros.evaluation.frames.cells import Cell, cell_key
from adversarial_lcd_ros.evaluation.frames.rows import make_row
from adversarial_lcd_ros.evaluation.paper.summaries import summarise_cells
from adversarial_lcd_ros.evaluation.store import CELLS, open_store, read_cells
from adversarial_lcd_ros.messages.types import LoopClosure

CELL = Cell('stepwise', AttackConfig(), 'wl', 'wl', 'soft', 300, 6, 10)


@pytest.mark.parametrize('changed', [
    {'search': 'optimum'}, {'attack': AttackConfig(ratio=1e-4)},
    {'attack': AttackConfig(gamma='scale')}, {'target': 'edges'}, {'asked_target': 'edges'},
    {'oracle': 'hard'}, {'nodes': 100}, {'frames': 5}, {'threshold': 0.9}, {'sealed': True},
    {'attack': AttackConfig(search='move_nodes', moved='spread'), 'search': 'move_nodes'}])
def test_a_key_depends_on_every_setting(changed):
    assert cell_key(replace(CELL, **changed), 42, 'a', LcdConfig()) != (
        cell_key(CELL, 42, 'a', LcdConfig()))


def test_a_key_depends_on_seed_sequence_detector_code_and_models(tmp_path, monkeypatch):
    key = cell_key(CELL, 42, 'a', LcdConfig())
    others = [cell_key(CELL, 43, 'a', LcdConfig()), cell_key(CELL, 42, 'b', LcdConfig()),
              cell_key(CELL, 42, 'a', LcdConfig(candidates=4))]
    for content in ('one', 'two'):
        model = tmp_path / f'{content}.json'
        model.write_text(content)
        others.append(cell_key(CELL, 42, 'a', LcdConfig(model=str(model))))
    monkeypatch.setattr(cells_module, 'code_digest', lambda *places: 'other code')
    others.append(cell_key(CELL, 42, 'a', LcdConfig()))
    monkeypatch.setattr(cells_module, 'SCHEMA', -1)
    others.append(cell_key(CELL, 42, 'a', LcdConfig()))
    assert len({key, *others}) == 8


def test_a_key_depends_on_the_code_of_a_class_of_the_users_own(tmp_path, monkeypatch):
    module = tmp_path / 'someones_targets.py'
    monkeypatch.syspath_prepend(tmp_path)
    keys = []
    for code in ('class Degree: 1', 'class Degree: 2'):
        module.write_text(code)
        monkeypatch.setattr(cells_module, '_files', lambda cell, lcd: [])
        keys.append(cell_key(replace(CELL, target='someones_targets:Degree'), 42, 'a',
                             LcdConfig()))
    assert len(set(keys)) == 2
    with pytest.raises(ConfigError, match='no module nobodys'):
        cell_key(replace(CELL, target='nobodys:Degree'), 42, 'a', LcdConfig())


def test_a_key_depends_on_nothing_else():
    same = replace(CELL, name='a name', seeds=3, attack=AttackConfig(seed=1))
    lcd = LcdConfig(target='edges', hard_answers=True, threshold=0.9)
    assert cell_key(same, 42, 'a', lcd) == cell_key(CELL, 42, 'a', LcdConfig())


def decision(stamp_ns, is_loop, match=None):
    return LoopClosure(stamp_ns, '', 0, is_loop=is_loop, probability=float(is_loop),
                       match_stamp_ns=match)


def results():
    """Return a suppressed loop, a diverted one, a held new place and an unattackable one."""
    clean = make_graph(30, [(2, 3), (3, 4)])
    flipped = clean.flip([(2, 3), (5, 6)])
    spent = AttackResult(clean, flipped, 'success', 'decision changed', 3, 9, 5, -1.0, 2.0,
                         tuple(float(k) for k in range(20)))
    skipped = AttackResult(clean, clean, 'skipped', 'edit budget below one')
    right, far = 'right', 'elsewhere'
    cases = [(1, True, False, right, far, spent), (1, True, True, right, far, spent),
             (-1, False, False, far, far, spent), (-1, True, True, far, far, skipped)]
    return [FrameResult(kind, decision(k, before, 0), decision(k, after, 0), was, now,
                        replace(attack, clean=replace(attack.clean, stamp_ns=k)),
                        0.5, 0.25, 0.125)
            for k, (kind, before, after, was, now, attack) in enumerate(cases)]


def test_a_row_tells_what_happened():
    row = make_row(CELL, 42, 'tour', results())
    assert (row['frames'], row['positives'], row['negatives']) == (4, 2, 2)
    assert [(frame['clean'], frame['attacked']) for frame in row['frame_results']] == [
        ('TP', 'FN'), ('TP', 'WM'), ('TN', 'TN'), ('FP', 'FP')]
    assert (row['suppressed'], row['invented'], row['unattackable']) == (2, 0, 1)
    assert (row['accuracy_clean'], row['accuracy_attacked']) == (0.75, 0.25)
    assert (row['balanced_clean'], row['balanced_attacked']) == (0.75, 0.25)
    assert row['decline_pp'] == 50.0
    assert (row['edits_mean'], row['queries_mean'], row['success_rate']) == (1.5, 3.75, 0.25)
    assert (row['query_s'], row['search_s'], row['judge_s'], row['duration_s']) == (2, 1, 0.5, 3.5)
    trace = row['frame_results'][0]['trace']
    assert len(trace) == 8
    assert (trace[0], trace[-1]) == (0.0, 19.0)
    assert row['frame_results'][3]['trace'] == []
    assert row['variant'] == ''
    assert json.loads(json.dumps(row, allow_nan=False)) == row


def test_a_row_counts_what_was_refused_and_what_nodes_do_not_explain():
    counted = [replace(result, unexplained_clean=0, unexplained=2) for result in results()[:3]]
    refused = replace(results()[3], unexplained_clean=1, refused='seal')
    row = make_row(replace(CELL, sealed=True), 42, 'tour', [*counted, refused])
    assert (row['sealed'], row['variant'], row['refused']) == (True, 'sealed graphs', 1)
    assert (row['unexplained_clean_mean'], row['unexplained_mean']) == (0.25, 2.0)
    assert [frame['refused'] for frame in row['frame_results']] == ['', '', '', 'seal']
    plain = make_row(CELL, 42, 'tour', results())
    assert (plain['refused'], plain['unexplained_mean']) == (0, None)


def test_a_setting_without_a_column_is_named():
    cell = replace(CELL, attack=AttackConfig(gamma='scale', max_queries=7))
    assert make_row(cell, 42, 'tour', results())['variant'] == 'gamma scale, max_queries 7'


def test_a_row_of_one_kind_has_no_balanced_accuracy():
    row = make_row(CELL, 42, 'tour', results()[:2])
    assert (row['balanced_clean'], row['decline_pp'], row['accuracy_clean']) == (None, None, 1.0)


def test_the_statistics_take_the_rows():
    rows = [make_row(CELL, seed, 'tour', results()) for seed in (42, 43)]
    summary, = summarise_cells(rows)
    assert (summary['seeds'], summary['decline_pp'], summary['unattackable']) == (2, 50.0, 1.0)


def test_rows_are_kept_in_order_and_only_once(tmp_path):
    with open_store(tmp_path / 'new' / 'folder') as store:
        store.add('a', {'value': 1})
        store.add('b', {'value': np.pi})
        with pytest.raises(EvaluationError, match='finished already'):
            store.add('a', {'value': 2})
    lines = store.path.read_text().splitlines()
    assert [json.loads(line)['key'] for line in lines] == ['a', 'b']
    with open_store(store.path.parent) as again:
        assert again.rows == store.rows
    assert read_cells(store.path.parent) == list(store.rows.values())


@pytest.mark.parametrize('cut', [1, 5, 20])
def test_a_line_that_was_cut_off_is_dropped_and_said(tmp_path, caplog, cut):
    with open_store(tmp_path) as store:
        store.add('a', {'value': 1})
        store.add('b', {'value': 2})
    whole = store.path.read_bytes()
    store.path.write_bytes(whole[:-cut])
    assert [row['key'] for row in read_cells(tmp_path)] == ['a']
    with caplog.at_level(logging.WARNING), open_store(tmp_path) as again:
        assert list(again.rows) == ['a']
        again.add('b', {'value': 2})
    assert 'cut off' in caplog.text
    assert store.path.read_bytes() == whole


@pytest.mark.parametrize('line', ['{"value": 1}', 'nonsense', '[]', '{"key": "a"}'])
def test_a_damaged_line_is_an_error(tmp_path, line):
    (tmp_path / CELLS).write_text('{"key": "a"}\n' + line + '\n{"key": "b"}\n')
    with pytest.raises(EvaluationError, match='line 2'), open_store(tmp_path):
        pass


def test_two_writers_are_refused(tmp_path):
    with open_store(tmp_path), pytest.raises(EvaluationError, match='another process'), \
            open_store(tmp_path):
        pass
    with open_store(tmp_path):
        pass


def test_a_folder_that_cannot_be(tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(EvaluationError, match='no folder for results'), \
            open_store(tmp_path / 'file'):
        pass
    with pytest.raises(EvaluationError, match='no folder of an evaluation'):
        read_cells(tmp_path)
