# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from paper_factory import SEQUENCES, make_row, make_rows
import pytest

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation import intervals
from adversarial_lcd_ros.evaluation.paper.summaries import (
    ATTACK,
    declines_by_sequence,
    summarise_cells,
    summarise_methods,
)

ROWS = [make_row(sequence, perturbation=perturbation, surrogate='none', seed=seed)
        for sequence in SEQUENCES[:2] for perturbation in ('recall', 'optimum')
        for seed in (0, 1, 2)]
AGREED = {'sequence', 'target', 'perturbation', 'surrogate', 'oracle', 'mode', 'ratio',
          'nodes_mean', 'seeds', 'accuracy_clean', 'accuracy_attacked', 'decline_pp', 'ci95',
          'share_of_optimum', 'edits_mean', 'queries_mean', 'suppressed', 'invented',
          'unattackable'}


def test_repeats_are_averaged_within_a_sequence():
    cells = summarise_cells(ROWS)
    assert len(cells) == 4
    assert set(cells[0]) >= AGREED
    cell = next(cell for cell in cells if cell['method'] == 'recall')
    rows = [row for row in ROWS
            if (row['sequence'], row['search']) == (cell['sequence'], 'recall')]
    declines = [row['decline_pp'] for row in rows]
    assert cell['seeds'] == 3
    assert cell['decline_pp'] == pytest.approx(np.mean(declines))
    assert cell['decline_sd_pp'] == pytest.approx(np.std(declines, ddof=1))
    assert cell['suppressed'] == pytest.approx(np.mean([row['suppressed'] for row in rows]))
    assert cell['duration_s'] == pytest.approx(3 * 1.25)
    assert cell['found_clean'] + cell['silent_clean'] == pytest.approx(
        60 * cell['accuracy_clean'])
    assert cell['ci95'][0] < cell['decline_pp'] < cell['ci95'][1]


def test_repeats_are_no_further_evidence():
    """Ten equal repeats have the interval of one."""
    one = make_row(search='recall')
    ten = [{**one, 'seed': seed} for seed in range(10)]
    assert summarise_cells(ten)[0]['ci95'] == summarise_cells([one])[0]['ci95']


def test_neighbouring_frames_are_drawn_together():
    row = make_row(power=0.0)
    for index, frame in enumerate(row['frame_results']):
        frame.update(stamp=index * 10**8, clean='TP' if frame['kind'] > 0 else 'TN',
                     attacked='FN' if index < 15 else 'TP' if frame['kind'] > 0 else 'TN')
    width = {}
    for period in (10**8, 10**10):  # neighbours in time, and frames far apart
        frames = [{**frame, 'stamp': index * period}
                  for index, frame in enumerate(row['frame_results'])]
        width[period] = np.ptp(summarise_cells([{**row, 'frame_results': frames}])[0]['ci95'])
    assert width[10**8] > 1.5 * width[10**10]


def test_interval_over_sequences_is_students():
    rows = [make_row(sequence, power=0.3) for sequence in SEQUENCES]
    method, = summarise_methods(summarise_cells(rows))
    declines = [row['decline_pp'] for row in rows]
    half = 3.182 * np.std(declines, ddof=1) / 2  # three degrees of freedom, four sequences
    assert method['ci95'] == pytest.approx((np.mean(declines) - half, np.mean(declines) + half),
                                           abs=0.01)


def test_interval_of_one_seed_is_that_of_the_evaluation():
    row = make_row(power=0.4)
    frames = row['frame_results']
    kind = np.array([frame['kind'] for frame in frames], np.int8)
    before, after = (np.isin([frame[which] for frame in frames], ('TP', 'TN'))
                     for which in ('clean', 'attacked'))
    block = intervals.block_frames(np.array([frame['stamp'] for frame in frames]))
    assert summarise_cells([row])[0]['ci95'] == intervals.decline_interval(
        kind, before, after, block, seed=0)


def test_share_of_the_optimum():
    rows = [make_row(search='recall', power=0.2, frames=400),
            make_row(perturbation='optimum', surrogate='none', power=0.5, frames=400),
            make_row(perturbation='optimum', surrogate='none', power=0.1, ratio=2e-4),
            make_row(target='edges', search='recall'),
            make_row(target='vbow', search='recall'),
            make_row(target='vbow', perturbation='optimum', surrogate='none', power=0.0)]
    cells = summarise_cells(rows)
    share = {(cell['target'], cell['method'], cell['ratio']): cell['share_of_optimum']
             for cell in cells}
    assert share['wl', 'recall', 3e-4] == pytest.approx(rows[0]['decline_pp']
                                                        / rows[1]['decline_pp'])
    assert share['wl', 'optimum', 3e-4] == 1.0
    assert share['edges', 'recall', 3e-4] is None  # there is no optimum
    assert share['vbow', 'recall', 3e-4] is None  # the optimum takes nothing


def test_methods_weigh_sequences_alike():
    rows = [make_row('synthetic_tour', power=1.0, seed=seed) for seed in range(9)]
    rows.append(make_row('synthetic_desk', power=0.0))
    method, = summarise_methods(summarise_cells(rows))
    assert method['sequences'] == ['synthetic_desk', 'synthetic_tour']
    assert method['decline_pp'] == pytest.approx(rows[0]['decline_pp'] / 2)
    assert (method['least_pp'], method['most_pp']) == (0.0, rows[0]['decline_pp'])
    assert method['ci95'] == (-100.0, 100.0)  # Student's t of one degree of freedom: anything
    assert method['seeds'] == 1
    assert summarise_methods(summarise_cells(rows[:1]))[0]['ci95'] is None


def test_a_sequence_without_new_places_has_no_decline():
    cells = summarise_cells([make_row(positives=60)])
    assert (cells[0]['decline_pp'], cells[0]['ci95']) == (None, None)
    assert summarise_methods(cells) == []


def test_a_sequence_that_allows_no_edit_is_in_no_mean():
    rows = [make_row(sequence, nodes_mean=nodes, power=0.5 if nodes > 100 else 0.0,
                     unattackable=0 if nodes > 100 else 60)
            for sequence, nodes in zip(SEQUENCES[:3], (300, 300, 7), strict=True)]
    cells = summarise_cells(rows)
    assert [cell['decline_pp'] for cell in cells].count(0) == 1
    method, = summarise_methods(cells)
    assert method['sequences'] == sorted(SEQUENCES[:2])
    assert method['decline_pp'] > 30
    name = tuple(method[factor] for factor in ATTACK)
    assert set(declines_by_sequence(cells, {name: 'a'})['a']) == set(SEQUENCES[:2])
    alone, = summarise_methods(summarise_cells(rows[2:]))
    assert (alone['decline_pp'], alone['unattackable']) == (0, 60)


def test_ranks_need_complete_rows():
    rows = [make_row(sequence, perturbation=perturbation) for sequence in SEQUENCES
            for perturbation in ('eigencentrality', 'random_walk')][:-1]
    cells = summarise_cells(rows)
    names = {tuple(cell[factor] for factor in ATTACK): cell['method'] for cell in cells}
    table = declines_by_sequence(cells, names)
    assert set(table) == {'eigencentrality', 'random_walk'}
    assert all(list(row) == sorted(SEQUENCES[:3]) for row in table.values())


def test_duplicates_are_refused():
    with pytest.raises(EvaluationError, match='counted twice'):
        summarise_cells([*ROWS, ROWS[3]])
    other = {**ROWS[3], 'nodes': 100}  # another cell
    assert len(summarise_cells([*ROWS, other])) == 5


@pytest.mark.parametrize(('change', 'message'), [
    ({'frame_results': [{'stamp': 0, 'kind': 'odd', 'clean': 'TP', 'attacked': 'TP'}]}, 'kind'),
    ({'frame_results': [{'stamp': 0, 'kind': 1, 'clean': 'yes', 'attacked': 'TP'}]}, 'decision'),
    ({'frame_results': 2 * [make_row()['frame_results'][0]] + [make_row()['frame_results'][1]]},
     'one stamp')])
def test_strange_frames_are_refused(change, message):
    with pytest.raises(EvaluationError, match=message):
        summarise_cells([{**make_row(), **change}])


def test_rows_of_another_form_are_refused():
    row = make_row()
    del row['oracle']
    with pytest.raises(EvaluationError, match='lacks oracle'):
        summarise_cells([row])
    assert summarise_cells([]) == []


def test_missing_asked_target_is_the_target_itself():
    row = make_row()
    del row['asked_target']
    assert summarise_cells([row])[0]['asked_target'] == 'wl'


def test_frames_may_be_written_in_other_words():
    row = make_row(power=0.5)
    words = [{**frame, 'kind': 'positive' if frame['kind'] > 0 else 'negative',
              'clean': frame['clean'] in ('TP', 'TN'),
              'attacked': frame['attacked'] in ('TP', 'TN')} for frame in row['frame_results']]
    assert summarise_cells([{**row, 'frame_results': words}]) == summarise_cells([row])


@settings(deadline=None, max_examples=8)
@given(st.permutations(ROWS))
def test_order_of_rows_does_not_matter(rows):
    assert summarise_cells(rows) == summarise_cells(ROWS)


@settings(deadline=None, max_examples=20)
@given(st.permutations(range(60)))
def test_order_of_frames_does_not_matter(order):
    row = ROWS[0]
    frames = [row['frame_results'][index] for index in order]
    assert summarise_cells([{**row, 'frame_results': frames}]) == summarise_cells([row])


def test_a_whole_table_is_summarised():
    cells = summarise_cells(make_rows(seeds=(0,), sequences=SEQUENCES[:2]))
    unattackable = {cell['nodes']: cell['unattackable'] for cell in cells}
    assert unattackable == {300: 0, 50: 60}  # floor(3e-4 * 50^2) is below one edit


def test_settings_without_a_column_tell_cells_apart():
    rows = [make_row(variant=variant) for variant in ('', 'gamma scale')]
    assert [cell['variant'] for cell in summarise_cells(rows)] == ['', 'gamma scale']
    del rows[0]['variant']
    assert [cell['variant'] for cell in summarise_cells(rows)] == ['', 'gamma scale']


def test_nodes_moved_are_summarised_where_rows_have_them():
    rows = [make_row(sequence, seed=seed, nodes_moved_mean=moved)
            for sequence, moved in (('synthetic_tour', 2.0), ('synthetic_desk', 6.0))
            for seed in (0, 1)]
    cells = summarise_cells(rows)
    assert sorted(cell['nodes_moved_mean'] for cell in cells) == [2.0, 6.0]
    method, = summarise_methods(cells)
    assert method['nodes_moved_mean'] == 4.0
    assert 'nodes_moved_mean' not in summarise_cells([make_row()])[0]
