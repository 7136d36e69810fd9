# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.stats import wilcoxon

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.paper.ranks import nemenyi_difference, rank_methods

METHODS = ('a', 'b', 'c', 'd')


def table_of(values):
    """Rows are sequences, columns methods."""
    return {name: {f's{row}': float(cells[column]) for row, cells in enumerate(values)}
            for column, name in enumerate(METHODS[:len(values[0])])}


def test_critical_difference_is_demsars():
    # Demsar (2006), Table 5a and Sec. 3.2.2: q = 2.569 for 4 methods, 14 data sets.
    assert nemenyi_difference(4, 14) == pytest.approx(1.25, abs=0.005)
    assert nemenyi_difference(4, 6) == pytest.approx(1.915, abs=0.0005)
    assert nemenyi_difference(4, 5) == pytest.approx(2.098, abs=0.0005)


def test_equal_to_autorank():
    autorank = pytest.importorskip('autorank')
    pandas = pytest.importorskip('pandas')
    values = np.random.default_rng(3).normal(size=(9, 4)) + [0, 1, 2, 3]
    # Declines as the paper gives them, negative, the strongest first.
    theirs = autorank.autorank(pandas.DataFrame(-values, columns=METHODS), alpha=0.05,
                               order='ascending', force_mode='nonparametric', verbose=False,
                               effect_size='akinshin_gamma')
    ours = rank_methods(table_of(values))
    assert ours.p_value == pytest.approx(theirs.pvalue)
    # Its studentized range is an approximation, scipy's an integral.
    assert ours.critical_difference == pytest.approx(theirs.cd, rel=1e-3)
    for method in ours.methods:
        row = theirs.rankdf.loc[method.name]
        assert method.mean_rank == pytest.approx(row.meanrank)
        assert method.median == pytest.approx(-row['median'])
        assert method.mad == pytest.approx(row.mad)
        assert method.gamma == pytest.approx(row.effect_size)
    assert [method.name for method in ours.methods] == list(theirs.rankdf.index)


def test_clear_order_over_many_sequences_is_separated():
    ranking = rank_methods(table_of([[4 + row, 3 + row, 2 + row, row] for row in range(30)]))
    assert [method.name for method in ranking.methods] == list(METHODS)
    assert ranking.p_value < 1e-6
    assert ranking.groups == ()
    assert ranking.separated('a', 'b')
    assert ranking.warnings == ()


def test_few_sequences_are_warned_of():
    two = rank_methods(table_of([[4, 3, 2, 1], [5, 4, 3, 1]]))
    assert two.groups == (METHODS,)
    assert not two.separated('a', 'd')
    assert 'no outcome whatever' in two.warnings[0]
    assert 'No two methods' in two.warnings[1]
    four = rank_methods(table_of([[4, 3, 2, 1]] * 4))
    assert four.p_value == four.least_p < 0.05
    assert four.groups == (('a', 'b', 'c'), ('b', 'c', 'd'))
    assert four.separated('a', 'd')
    assert 'Only the outermost' in four.warnings[0]


def test_two_methods_go_to_wilcoxon():
    ranking = rank_methods(table_of([[2.0 + row, 1.0] for row in range(4)]))
    assert (ranking.test, ranking.critical_difference) == ('Wilcoxon', None)
    assert ranking.p_value == pytest.approx(2 / 2 ** 4)
    assert 'no outcome whatever' in ranking.warnings[0]
    assert ranking.groups == (('a', 'b'),)
    assert rank_methods(table_of([[2.0 + row, 1.0] for row in range(8)])).groups == ()


def test_two_methods_are_tested_exactly():
    gains = np.array([1.5, -0.5, 3.0, 2.0, 0.7, 4.0])
    ranking = rank_methods(table_of([[gain, 0.0] for gain in gains]))
    assert ranking.p_value == pytest.approx(wilcoxon(gains, method='exact').pvalue)
    # Equal gains in all sequences: a normal approximation would claim too much.
    assert rank_methods(table_of([[1.0, 0.0]] * 3)).p_value == pytest.approx(2 / 2 ** 3)


def test_no_difference_at_all():
    ranking = rank_methods(table_of([[0, 0, 0]] * 5))
    assert ranking.p_value == 1.0
    assert ranking.groups == (('a', 'b', 'c'),)
    assert [method.gamma for method in ranking.methods] == [None] * 3
    assert rank_methods(table_of([[0, 0]] * 5)).p_value == 1.0


def test_unanimous_sequences_without_significance_stay_one_group():
    # A gap beyond the critical difference means nothing if Friedman's test found nothing.
    ranking = rank_methods(table_of([[3, 2, 1], [3, 1, 2], [1, 2, 3], [3, 2, 1]]))
    assert ranking.p_value > 0.05
    assert ranking.groups == (('a', 'b', 'c'),)


def test_incomplete_tables_are_refused():
    table = table_of([[1, 2], [3, 4]])
    del table['a']['s1']
    with pytest.raises(EvaluationError, match='a has no figure for s1'):
        rank_methods(table)
    with pytest.raises(EvaluationError, match='at least two of each'):
        rank_methods({'a': {'s': 1.0}, 'b': {'s': 2.0}})


@settings(deadline=None, max_examples=30)
@given(st.integers(2, 4), st.integers(2, 6), st.randoms(use_true_random=False), st.data())
def test_order_and_scale_do_not_matter(columns, rows, random, data):
    values = data.draw(st.lists(
        st.lists(st.integers(0, 9), min_size=columns, max_size=columns),
        min_size=rows, max_size=rows))
    table = table_of(values)
    names = list(table)
    random.shuffle(names)
    shuffled = {name: dict(random.sample(sorted(table[name].items()), rows)) for name in names}
    ranking = rank_methods(table)
    assert rank_methods(shuffled) == ranking
    assert sum(method.mean_rank for method in ranking.methods) == pytest.approx(
        columns * (columns + 1) / 2)
    stretched = rank_methods(table_of(2.0 * np.array(values) + 1))
    assert stretched.p_value == pytest.approx(ranking.p_value)
    assert stretched.groups == ranking.groups
