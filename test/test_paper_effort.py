# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Loops lost over queries an edit, by perturbation and rule, over synthetic rows."""

from paper_factory import SEQUENCES, make_row
import pytest

from adversarial_lcd_ros.evaluation.paper.effort import efforts, lost_by_one, orders, rule_of
from adversarial_lcd_ros.evaluation.paper.effort_plot import draw_effort
from adversarial_lcd_ros.evaluation.paper.summaries import summarise_cells

RATIO = 3e-4


def effort_rows(sequences=SEQUENCES[:2], rules=('', 'retry never'), queries=(1, 5, 40)):
    return [make_row(sequence, 'symbio', perturbation, judged='pairs', variant=rule,
                     queries_per_edit=count, power=power * count / 40, seed=seed, frames=80)
            for sequence in sequences for rule in rules for count in queries for seed in (0, 1)
            for perturbation, power in (('eigencentrality', 0.3), ('shortest_path', 0.6))]


def share_lost(rows):
    kept = {}
    for row in rows:
        counts = kept.setdefault(row['sequence'], [0, 0])
        for frame in row['frame_results']:
            if frame['clean'] == 'TP':
                counts[0] += frame['attacked'] != 'TP'
                counts[1] += 1
    return sum(lost / found for lost, found in kept.values()) / len(kept)


def test_a_line_for_each_perturbation_and_rule():
    rows = effort_rows()
    rows += [make_row(sequence, 'symbio', 'optimum', judged='pairs', power=0.8, frames=80)
             for sequence in SEQUENCES[:2]]
    found, = efforts(summarise_cells(rows), RATIO)
    assert found.sequences == tuple(sorted(SEQUENCES[:2]))
    assert {(line.method, line.rule) for line in found.lines} == {
        (method, rule) for method in ('eigencentrality', 'shortest_path')
        for rule in ('gained', 'never')}
    for line in found.lines:
        assert line.queries == (1, 5, 40)
        for count, lost in zip(line.queries, line.lost, strict=True):
            assert lost == pytest.approx(share_lost(
                [row for row in rows if row['perturbation'] == line.method
                 and row['queries_per_edit'] == count
                 and rule_of(row['variant'])[0] == line.rule]))
    assert found.optimum == pytest.approx(share_lost(rows[-2:]))
    told = orders(found)
    assert [text.split(' an edit')[0] for text in told] == ['1 query', '5 queries', '40 queries']
    lost = {line.method: 100 * line.lost[-1] for line in found.lines if line.rule == 'gained'}
    assert told[-1].endswith(f'(retry gained): shortest path {lost["shortest_path"]:.1f} %, '
                             f'eigencentrality {lost["eigencentrality"]:.1f} %')
    for width in (9.4, 4.4):
        assert draw_effort(found, width).startswith(b'<?xml')


def test_only_sequences_that_all_lines_have():
    rows = effort_rows(SEQUENCES[:2]) + effort_rows(SEQUENCES[2:3], rules=('',))
    found, = efforts(summarise_cells(rows), RATIO)
    assert found.sequences == tuple(sorted(SEQUENCES[:2]))
    assert found.optimum is None


def test_one_number_of_queries_is_no_curve_and_settings_are_kept_apart():
    assert efforts(summarise_cells(effort_rows(queries=(40,))), RATIO) == []
    rows = effort_rows() + [{**row, 'judged': 'frames'} for row in effort_rows()]
    assert [effort.setting['judged'] for effort in efforts(summarise_cells(rows), RATIO)] == [
        'frames', 'pairs']
    assert efforts(summarise_cells(rows), 1e-4) == []


def test_loops_lost_by_one_only_are_of_the_same_frames_and_seeds():
    rows = effort_rows(SEQUENCES[:1], rules=('',), queries=(1, 40))
    rows += [make_row(SEQUENCES[0], 'wl', 'shortest_path', judged='pairs', power=1.0)]
    effort, = efforts(summarise_cells(rows), RATIO)
    first, second = lost_by_one(rows, effort, RATIO)
    assert first['rule, queries an edit'] == 'gained, 1'
    lost = {name: {(row['seed'], frame['stamp']) for row in rows for frame in row['frame_results']
                   if (row['target'], row['perturbation'], row['queries_per_edit'])
                   == ('symbio', name, 40) and (frame['clean'], frame['attacked']) == ('TP', 'FN')}
            for name in ('eigencentrality', 'shortest_path')}
    ours, theirs = lost['eigencentrality'], lost['shortest_path']
    assert (second['lost by both'], second['by eigencentrality only'],
            second['by shortest path only']) == (
        str(len(ours & theirs)), str(len(ours - theirs)), str(len(theirs - ours)))
    assert ours - theirs
    assert theirs - ours


def test_the_rule_is_told_from_what_else_is_unusual():
    assert rule_of('') == ('gained', '')
    assert rule_of('retry set, defences length_check') == ('set', 'defences length_check')
    assert rule_of('gamma scale, retry never, kept_loops 0.9') == (
        'never', 'gamma scale, kept_loops 0.9')
