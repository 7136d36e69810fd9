# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The paper's printed statistics, from its printed cells."""

from dataclasses import dataclass, replace
import math

import numpy as np
import pytest
from scipy.stats import binom

from adversarial_lcd_ros.evaluation.paper.printed import (
    BUDGET_TABLE,
    OURS,
    PERTURBATION_TABLE,
    SURROGATE_TABLE,
    misprints,
)
from adversarial_lcd_ros.evaluation.paper.ranks import rank_methods


def corrected(table, method, row, value):
    """Return a table with another value in one cell, and the average that follows."""
    cells = tuple(value if name == row else cell
                  for name, cell in zip(table.rows, table.columns[method], strict=True))
    return replace(table, columns={**table.columns, method: cells},
                   averages={**table.averages, method: round(float(np.mean(cells)), 2)})


# Table 3 with the one cell that, if printed wrongly, explains the lead in the text and the whole
# of Table 4. Our inference: the paper does not say so.
REPAIRED_TABLE = corrected(SURROGATE_TABLE, 'SVM-poly', 'garden', -19.89)


@dataclass(frozen=True)
class AutorankRow:
    """A row of the printed Autorank table (Table 4), two decimals cut off, not rounded."""

    mean_rank: float  # larger is better, unlike Demsar's
    median: float
    mad: float
    interval: tuple[float, float]
    gamma: float


AUTORANK_TABLE = {  # Table 4, tab:autorank
    OURS: AutorankRow(3.83, -27.19, 1.83, (-27.9, -26.4), 0.0),
    'Bayesian': AutorankRow(3.00, -24.37, 1.99, (-24.9, -23.7), -0.9),
    'SVM-poly': AutorankRow(2.16, -19.41, 0.48, (-19.7, -19.1), -3.9),
    'SVM-linear': AutorankRow(1.00, -13.56, 0.44, (-13.8, -13.2), -6.8)}


def with_average(table):
    """Columns with the printed average as one more row, as the paper ranked."""
    return {name: (*cells, table.averages[name]) for name, cells in table.columns.items()}


def ranking_of(columns):
    return rank_methods({name: {str(row): -cell for row, cell in enumerate(cells)}
                         for name, cells in columns.items()})


def cut(value, digits):
    """Decimals cut off, as in Table 4: 13 / 6 is printed as 2.16."""
    return math.trunc(value * 10 ** digits + math.copysign(1e-9, value)) / 10 ** digits


def autorank_of(columns):
    """Table 4 as the paper made it: rank k is the best, medians keep their sign."""
    ranking = ranking_of(columns)
    return {method.name: (cut(len(columns) + 1 - method.mean_rank, 2), cut(-method.median, 2),
                          cut(method.mad, 2), cut(method.gamma, 1))
            for method in ranking.methods}


def printed(name):
    row = AUTORANK_TABLE[name]
    return row.mean_rank, row.median, row.mad, row.gamma


def test_six_rows_reproduce_the_printed_autorank_table():
    """Five data sets and their own average, with the one cell repaired: every figure agrees."""
    computed = autorank_of(with_average(REPAIRED_TABLE))
    assert list(computed) == list(AUTORANK_TABLE)
    assert computed == {name: printed(name) for name in AUTORANK_TABLE}


def test_five_rows_do_not_reproduce_it():
    for table in (SURROGATE_TABLE, REPAIRED_TABLE):
        computed = autorank_of(table.columns)
        assert [name for name in computed if computed[name] == printed(name)] == []


def test_printed_cells_alone_miss_where_the_misprint_is():
    computed = autorank_of(with_average(SURROGATE_TABLE))
    assert computed['SVM-linear'] == printed('SVM-linear')
    assert computed[OURS] == printed(OURS)
    # Medians do not depend on the misprint in another column, ranks do.
    assert computed['Bayesian'][1:] == printed('Bayesian')[1:]
    assert computed['Bayesian'][0] == 3.16
    assert computed['SVM-poly'] == (2.0, -18.57, 0.91, -4.0)


def test_printed_intervals_are_the_two_middle_values_of_six():
    for name, cells in with_average(REPAIRED_TABLE).items():
        middle = sorted(cells)[2:4]
        assert AUTORANK_TABLE[name].interval == tuple(cut(cell, 1) for cell in middle)
    # Such an interval covers the median in 31 of 100 cases.
    assert binom.pmf(3, 6, 0.5) == pytest.approx(0.3125)


@pytest.mark.parametrize(('columns', 'count', 'difference'), [
    (with_average(REPAIRED_TABLE), 6, 1.915),
    (REPAIRED_TABLE.columns, 5, 2.098),
    (SURROGATE_TABLE.columns, 5, 2.098)])
def test_only_svm_linear_is_separated(columns, count, difference):
    """The paper: "a critical difference between Adversarial-LCD and the other algorithms"."""
    ranking = ranking_of(columns)
    assert len(ranking.sequences) == count
    assert ranking.critical_difference == pytest.approx(difference, abs=0.0005)
    assert ranking.p_value < 0.05
    assert [name for name in SURROGATE_TABLE.columns if name != OURS
            and ranking.separated(OURS, name)] == ['SVM-linear']


def test_rank_gaps_of_the_printed_table():
    best = AUTORANK_TABLE[OURS].mean_rank
    gaps = {name: best - row.mean_rank for name, row in AUTORANK_TABLE.items()}
    assert gaps == pytest.approx({OURS: 0, 'Bayesian': 0.83, 'SVM-poly': 1.67,
                                  'SVM-linear': 2.83}, abs=0.005)


def test_misprinted_averages():
    averages = {(found.table, found.what.removeprefix('average of ')):
                (found.printed, round(found.computed, 2))
                for found in misprints() if found.what.startswith('average')}
    assert averages == {
        (3, 'SVM-poly'): (-18.50, -18.70), (5, 'Random Walk'): (-16.548, -16.78),
        (5, 'Shortest Path'): (-22.36, -22.97), (6, 'Shortest Path'): (-12.95, -12.99),
        (6, 'Eigencentrality'): (-16.09, -16.42)}


def test_leads_claimed_in_the_text():
    leads = {(found.table, found.what.split()[2]): (found.printed, round(found.computed, 2))
             for found in misprints() if found.what.startswith('lead')}
    assert leads == {(3, 'SVM-poly'): (7.3, 7.76), (5, 'Shortest'): (4.0, 3.50),
                     (6, 'Random'): (7.9, 8.26), (6, 'Shortest'): (3.1, 3.43)}


def test_the_repair_explains_average_and_lead_but_not_the_printed_average():
    table = REPAIRED_TABLE
    assert table.averages['SVM-poly'] == -19.10
    assert cut(table.mean('SVM-poly') - table.mean(OURS), 1) == 7.3
    assert SURROGATE_TABLE.averages['SVM-poly'] == -18.50  # neither -18.70 nor -19.10


def test_tables_share_the_cells_they_should_share():
    assert SURROGATE_TABLE.columns[OURS] == PERTURBATION_TABLE.columns['Eigencentrality']
    for name, cells in BUDGET_TABLE.columns.items():
        assert cells[-1] == PERTURBATION_TABLE.columns[name][0]
    assert np.all(np.diff(list(BUDGET_TABLE.columns.values()), axis=1) < 0)
