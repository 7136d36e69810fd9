# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Which methods differ over sequences: Friedman's test, Nemenyi's critical difference.

The analysis of Autorank with several populations that need not be normal, after Demsar
(JMLR 2006), with N the number of sequences: an average of the sequences is no further sequence.
The library itself (autorank) refuses fewer than five rows, and an evaluation often has fewer;
both tests are scipy's, and a test holds the results equal to the library's where it answers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from adversarial_lcd_ros.errors import EvaluationError

ALPHA = 0.05
_NORMAL = 1.4826  # median absolute deviation to standard deviation, normal distribution


@dataclass(frozen=True)
class RankedMethod:
    """
    A method among others.

    Attributes
    ----------
    name : str
    mean_rank : float
        1 is the largest decline; ties share the mean of their ranks.
    mean, median, mad : float
        Mean, median, and median absolute deviation over the sequences, percentage points.
    gamma : float or None
        Distance of the medians from the first method's in pooled deviations (Akinshin), as in
        Autorank; negative: worse. None where both deviations are zero.

    """

    name: str
    mean_rank: float
    mean: float
    median: float
    mad: float
    gamma: float | None


@dataclass(frozen=True)
class Ranking:
    """
    Methods compared over sequences.

    Attributes
    ----------
    methods : tuple of RankedMethod
        The best mean rank first; ties by name.
    sequences : tuple of str
        The N independent rows.
    test : str
        'Friedman', or 'Wilcoxon' for two methods.
    p_value, least_p : float
        Of the test, and the smallest that it can give at all with N sequences.
    alpha : float
    critical_difference : float or None
        Nemenyi's, in mean ranks; None for two methods.
    groups : tuple of tuple of str
        Largest runs of methods that are not told apart, two or more in each.

    """

    methods: tuple[RankedMethod, ...]
    sequences: tuple[str, ...]
    test: str
    p_value: float
    least_p: float
    alpha: float
    critical_difference: float | None
    groups: tuple[tuple[str, ...], ...]

    def separated(self, first: str, second: str) -> bool:
        """Tell whether two methods differ: the test does, and no group holds both."""
        return not any(first in group and second in group for group in self.groups)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the number of sequences does not let anybody see, in plain sentences."""
        count, largest = len(self.sequences), len(self.methods) - 1
        texts = []
        if self.least_p > self.alpha:
            texts.append(f'With {count} sequences no outcome whatever is significant: the '
                         f'smallest p that the {self.test} test can give is {self.least_p:.3f}, '
                         f'above {self.alpha:g}.')
        if self.critical_difference is not None:
            cd = f'{self.critical_difference:.2f}'
            if self.critical_difference > largest:
                texts.append(f'No two methods can be told apart: the critical difference is {cd} '
                             f'mean ranks, and the largest gap possible is {largest}.')
            elif self.critical_difference > largest - 1:
                texts.append(f'Only the outermost methods can be told apart: the critical '
                             f'difference is {cd} mean ranks of {largest} possible.')
        return tuple(texts)


def rank_methods(declines: Mapping[str, Mapping[str, float]], alpha: float = ALPHA) -> Ranking:
    """
    Compare methods over sequences.

    Parameters
    ----------
    declines : mapping of str to mapping of str to float
        Method to sequence to decline, percentage points; larger is better. Repeats are averaged
        beforehand. The order of either mapping does not matter.
    alpha : float
        Level of the tests.

    Raises
    ------
    EvaluationError
        Fewer than two methods or sequences, or a method lacks a sequence.

    """
    names = sorted(declines)
    sequences = sorted(set().union(*declines.values()))
    if len(names) < 2 or len(sequences) < 2:
        raise EvaluationError(f'{len(names)} methods over {len(sequences)} sequences: a ranking '
                              'needs at least two of each')
    table = _table(declines, names, sequences)
    mean_rank = stats.rankdata(-table, axis=1).mean(axis=0)
    order = sorted(range(len(names)), key=lambda index: (mean_rank[index], names[index]))
    best = table[:, order[0]]
    methods = tuple(
        RankedMethod(names[index], float(mean_rank[index]), float(column.mean()),
                     float(np.median(column)), float(stats.median_abs_deviation(column)),
                     _gamma(column, best))
        for index in order for column in [table[:, index]])
    p_value = _p_value(table)
    difference = nemenyi_difference(len(names), len(sequences), alpha) if len(names) > 2 else None
    return Ranking(methods, tuple(sequences), 'Wilcoxon' if len(names) == 2 else 'Friedman',
                   p_value, _p_value(_unanimous(*table.shape)), alpha, difference,
                   _groups(methods, difference if p_value < alpha else math.inf,
                           told_apart=difference is None and p_value < alpha))


def _table(declines: Mapping[str, Mapping[str, float]], names: Sequence[str],
           sequences: Sequence[str]) -> NDArray[np.float64]:
    for name in names:
        missing = [sequence for sequence in sequences if sequence not in declines[name]]
        if missing:
            raise EvaluationError(f'{name} has no figure for {", ".join(missing)}: a ranking '
                                  'needs every method on every sequence')
    return np.array([[declines[name][sequence] for name in names] for sequence in sequences])


def nemenyi_difference(methods: int, sequences: int, alpha: float = ALPHA) -> float:
    """Return Nemenyi's critical difference of mean ranks (Demsar 2006, Sec. 3.2.2)."""
    quantile = float(stats.studentized_range.ppf(1.0 - alpha, methods, np.inf))
    return quantile * math.sqrt(methods * (methods + 1) / (12.0 * sequences))


def _p_value(table: NDArray[np.float64]) -> float:
    if table.shape[1] == 2:
        # All signs in turn up to 13 sequences: ties and few rows do no harm.
        return float(stats.permutation_test(
            (table[:, 0], table[:, 1]), _signed_ranks, permutation_type='samples',
            vectorized=True, random_state=0).pvalue)
    if np.all(table == table[:, :1]):
        return 1.0  # all tied in every sequence: scipy divides by zero
    return float(stats.friedmanchisquare(*table.T).pvalue)


def _signed_ranks(first: NDArray[np.float64], second: NDArray[np.float64],
                  axis: int = -1) -> NDArray[np.float64]:
    # Wilcoxon's statistic.
    gain = first - second
    ranks = stats.rankdata(np.abs(gain), axis=axis)
    return np.asarray(np.sum(np.sign(gain) * ranks, axis=axis), np.float64)


def _unanimous(sequences: int, methods: int) -> NDArray[np.float64]:
    # All sequences agree on a strict order: nothing speaks more clearly.
    return np.tile(np.arange(float(methods)), (sequences, 1))


def _gamma(column: NDArray[np.float64], best: NDArray[np.float64]) -> float | None:
    spread = _NORMAL * stats.median_abs_deviation(np.stack([column, best]), axis=1)
    pooled = math.sqrt(float(np.mean(spread ** 2)))
    gap = float(np.median(column) - np.median(best))
    return gap / pooled if pooled > 0.0 else None


def _groups(methods: tuple[RankedMethod, ...], difference: float | None,
            told_apart: bool) -> tuple[tuple[str, ...], ...]:
    # Runs of neighbours within the difference, without those inside a longer run.
    if told_apart:
        return ()
    reach = math.inf if difference is None else difference
    groups: list[tuple[str, ...]] = []
    end = 0
    for start, first in enumerate(methods):
        last = max(index for index, method in enumerate(methods)
                   if method.mean_rank - first.mean_rank <= reach)
        if last > max(start, end):
            groups.append(tuple(method.name for method in methods[start:last + 1]))
            end = last
    return tuple(groups)
