# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The figures printed in "Attacking the Loop", as data, and what their own arithmetic gives.

Transcribed from the LaTeX source of the paper (Kim, Urschler, Riddle, Wicker: "Attacking the
Loop: Adversarial Attacks on Graph-based Loop Closure Detection"); ``label`` is the label of the
table there. Declines are percentage points of accuracy as printed: negative.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

OURS = 'Adv-LCD'  # SVM-RBF with eigencentrality: the paper's proposal
ALPHA = 0.05
SEQUENCES = ('fr2-desk', 'fr3-longoffice', 'lounge', 'kitchen', 'garden')


@dataclass(frozen=True)
class PrintedTable:
    """
    A table of declines as printed.

    Attributes
    ----------
    number : int
        Of the table in the paper.
    label, title : str
        In the LaTeX source; the printed caption.
    rows : tuple of str
        Sequences or perturbation ratios.
    columns : mapping of str to tuple of float
        Method to its declines, one a row, percentage points.
    averages : mapping of str to float
        The printed last row.
    digits : mapping of str to int
        Decimals with which an average is printed, where they are not two.
    settings : mapping of str to str
        Method to the value of our setting that stands for it.

    """

    number: int
    label: str
    title: str
    rows: tuple[str, ...]
    columns: Mapping[str, tuple[float, ...]]
    averages: Mapping[str, float]
    settings: Mapping[str, str]
    digits: Mapping[str, int] = field(default_factory=dict)

    def mean(self, method: str) -> float:
        """Return the average that the printed cells of a method give."""
        return float(np.mean(self.columns[method]))


@dataclass(frozen=True)
class Misprint:
    """A printed figure, and what the printed cells give in its place."""

    table: int
    what: str
    printed: float
    computed: float


SURROGATE_TABLE = PrintedTable(
    3, 'tab:surrogate', 'The decline in LCD accuracy using different surrogate models', SEQUENCES,
    {'SVM-linear': (-13.29, -14.10, -12.89, -15.67, -13.22),
     'SVM-poly': (-17.37, -19.72, -19.89, -18.64, -17.89),
     'Bayesian': (-22.22, -26.94, -26.21, -24.99, -18.46),
     OURS: (-27.92, -29.33, -28.72, -24.66, -21.69)},
    {'SVM-linear': -13.83, 'SVM-poly': -18.50, 'Bayesian': -23.76, OURS: -26.46},
    {'SVM-linear': 'svm_linear', 'SVM-poly': 'svm_poly', 'Bayesian': 'naive_bayes',
     OURS: 'svm_rbf'})
PERTURBATION_TABLE = PrintedTable(
    5, 'tab:ablation', 'The decline in LCD accuracy using different perturbation methods',
    SEQUENCES,
    {'Random Walk': (-15.66, -16.72, -17.95, -19.04, -14.55),
     'Shortest Path': (-24.30, -22.69, -22.46, -24.63, -20.76),
     'Eigencentrality': (-27.92, -29.33, -28.72, -24.66, -21.69)},
    {'Random Walk': -16.548, 'Shortest Path': -22.36, 'Eigencentrality': -26.46},
    {'Random Walk': 'random_walk', 'Shortest Path': 'shortest_path',
     'Eigencentrality': 'eigencentrality'},
    {'Random Walk': 3})
BUDGET_TABLE = PrintedTable(
    6, 'tab:pert_budget', 'The decline in LCD accuracy at different perturbation budgets '
    '(fr2-desk)', ('0.0001', '0.0002', '0.0003'),
    {'Random Walk': (-1.5, -7.33, -15.66), 'Shortest Path': (-3.45, -11.22, -24.30),
     'Eigencentrality': (-5.02, -16.33, -27.92)},
    {'Random Walk': -8.16, 'Shortest Path': -12.95, 'Eigencentrality': -16.09},
    PERTURBATION_TABLE.settings)
PRINTED_TABLES = (SURROGATE_TABLE, PERTURBATION_TABLE, BUDGET_TABLE)

# "surpassing SVM-linear by 12.6%, SVM-polynomial by 7.3%, and Bayesian classifier by 2.7%", and
# so on (Sec. 4.2 and 4.3): by how much the text says that the paper's method is ahead on average.
CLAIMED_LEADS = {3: {'SVM-linear': 12.6, 'SVM-poly': 7.3, 'Bayesian': 2.7},
                 5: {'Random Walk': 9.6, 'Shortest Path': 4.0},
                 6: {'Random Walk': 7.9, 'Shortest Path': 3.1}}


def misprints() -> list[Misprint]:
    """Return the printed averages and leads that do not follow from the printed cells."""
    found = []
    for table in PRINTED_TABLES:
        for method, printed in table.averages.items():
            computed = table.mean(method)
            # A half in the last decimal may be rounded either way.
            if abs(printed - computed) > 0.5 * 10.0 ** -table.digits.get(method, 2) + 1e-9:
                found.append(Misprint(table.number, f'average of {method}', printed, computed))
        best = list(table.columns)[-1]
        for method, claimed in CLAIMED_LEADS[table.number].items():
            lead = table.mean(method) - table.mean(best)
            if not claimed <= lead + 1e-9 < claimed + 0.1:  # the text cuts decimals off
                found.append(Misprint(table.number, f'lead over {method} in the text', claimed,
                                      lead))
    return found
