# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Keyframes by the block: what finds the most alike of a hundred thousand in milliseconds, compiled.

A frame has a thousand of four thousand visual words: any two share a third of theirs, and an
inverted index would visit thirty million entries of a hundred thousand keyframes. So all are
bounded first, by six bits of each weight, 32 keyframes in one instruction, and only those are
scored whose bound leaves them a chance (docs/performance.md).
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.hamming import compiled

KEYFRAMES = 4096
COLUMNS = 4096
UNIT = 2.0 ** -13
TOP_LEVEL = 63
# As many rows of at most 63 as sixteen bits hold the sum of.
_ROWS_A_SUM = 1024
# Float sums are rounded; a bound must not end up below what it bounds.
_ROUNDING = 1 - 1e-12

ScalarT = TypeVar('ScalarT', bound=np.generic)


@compiled
def _level_sums(cells: NDArray[np.uint8], column: NDArray[np.int64], level: NDArray[np.uint8],
                count: int) -> NDArray[np.uint32]:
    """Return sum over columns of min(cell, level), for the first ``count`` keyframes."""
    total = np.zeros(count, np.uint32)
    part = np.empty(count, np.uint16)
    for first in range(0, len(column), _ROWS_A_SUM):
        part[:] = 0
        # Four levels of six bits still fit into a byte: a quarter of the wider additions.
        for k in range(first, min(first + _ROWS_A_SUM, len(column)), 4):
            a, b = cells[column[k], :count], cells[column[k + 1], :count]
            c, d = cells[column[k + 2], :count], cells[column[k + 3], :count]
            for i in range(count):
                ab = np.uint8(min(a[i], level[k]) + min(b[i], level[k + 1]))
                cd = np.uint8(min(c[i], level[k + 2]) + min(d[i], level[k + 3]))
                part[i] += np.uint16(np.uint8(ab + cd))
        total += part
    return total


@compiled
def _smaller(weight: NDArray[np.float32], query: NDArray[np.float32],
             number: NDArray[np.uint32], k: int) -> Any:
    other = query[number[k]]
    return weight[k] if weight[k] < other else other


@compiled
def _exact(start: NDArray[np.int64], number: NDArray[np.uint32], weight: NDArray[np.float32],
           query: NDArray[np.float32], chosen: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return sum of min(weight, query weight) over the words of each chosen keyframe."""
    score = np.empty(len(chosen), np.float64)
    for row in range(len(chosen)):
        first, end = start[chosen[row]], start[chosen[row] + 1]
        words, mine = number[first:end], weight[first:end]
        fours = len(words) // 4 * 4
        # An addition takes four cycles, and the next can begin after one.
        a, b, c, d = 0.0, 0.0, 0.0, 0.0
        for k in range(0, fours, 4):
            a += _smaller(mine, query, words, k)
            b += _smaller(mine, query, words, k + 1)
            c += _smaller(mine, query, words, k + 2)
            d += _smaller(mine, query, words, k + 3)
        for k in range(fours, len(words)):
            a += _smaller(mine, query, words, k)
        score[row] = (a + b) + (c + d)
    return score


@compiled
def common_weight(a: NDArray[np.uint32], weight_a: NDArray[np.float32], b: NDArray[np.uint32],
                  weight_b: NDArray[np.float32]) -> float:
    """Return sum of the smaller weights over the words, ascending, that both have."""
    total = 0.0
    i, j = 0, 0
    while i < len(a) and j < len(b):
        if a[i] == b[j]:
            total += min(weight_a[i], weight_b[j])
        # Without branches: which list is ahead cannot be foretold.
        behind = int(a[i] <= b[j])
        j += int(b[j] <= a[i])
        i += behind
    return total


class Query:
    """
    The vBoW vector of a query, laid out for blocks.

    Parameters
    ----------
    number : int64, (w,)
        Numbers of its words, without repeats.
    weight : float32, (w,)
    words : int
        Numbers there are.

    """

    def __init__(self, number: NDArray[np.int64], weight: NDArray[np.float32],
                 words: int) -> None:
        self.weight = np.zeros(words, np.float32)
        self.weight[number] = weight
        folded = _folded(number, weight)
        column = np.flatnonzero(folded)
        level = np.ceil(folded[column] / UNIT)
        self.excess = _excess(folded)
        padding = -len(column) % 4
        self.column = np.append(column, np.zeros(padding, np.int64))
        self.level = np.append(np.minimum(level, TOP_LEVEL), np.zeros(padding)).astype(np.uint8)


def least_level(score: float) -> int:
    """Return which sum of levels, at least, a keyframe of a score has."""
    return max(1, math.ceil(score * _ROUNDING / UNIT) - 1)


def _folded(number: NDArray[np.int64], weight: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the weight of every column; words that share one are added up."""
    folded: Any = np.bincount(number % COLUMNS, weight, COLUMNS)
    return np.asarray(folded, np.float64)


def _excess(folded: NDArray[np.float64]) -> int:
    """Return what columns weigh beyond the top level, in units, rounded up."""
    return math.ceil(float(np.maximum(folded - TOP_LEVEL * UNIT, 0).sum()) / UNIT)


class Block:
    """
    Up to 4096 keyframes: levels of their words' weights in columns, and the weights themselves.

    A level is a weight in units of 2^-13, rounded up, at most 63; what a frame of few words
    weighs beyond is kept as a sum. More words than columns share columns: their weights add up,
    and bounds stay bounds. 4 kB of levels and 8 bytes a word for each keyframe.
    """

    def __init__(self) -> None:
        self._cells: NDArray[np.uint8] = np.zeros((COLUMNS, KEYFRAMES), np.uint8)
        self._excess: NDArray[np.uint32] = np.zeros(KEYFRAMES, np.uint32)
        self._start: NDArray[np.int64] = np.zeros(KEYFRAMES + 1, np.int64)
        self._number: NDArray[np.uint32] = np.zeros(1 << 14, np.uint32)
        self._weight: NDArray[np.float32] = np.zeros(1 << 14, np.float32)
        self.count = 0

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(array.nbytes for array in (self._cells, self._excess, self._start,
                                              self._number, self._weight))

    def add(self, number: NDArray[np.int64], weight: NDArray[np.float32]) -> None:
        """Store the next keyframe's word numbers, without repeats, and their weights."""
        used = int(self._start[self.count])
        end = used + len(number)
        self._number = _grown(self._number, end)
        self._weight = _grown(self._weight, end)
        self._number[used:end] = number
        self._weight[used:end] = weight
        folded = _folded(number, weight)
        column = np.flatnonzero(folded)
        self._cells[column, self.count] = np.minimum(np.ceil(folded[column] / UNIT), TOP_LEVEL)
        self._excess[self.count] = _excess(folded)
        self.count += 1
        self._start[self.count] = end

    def levels(self, query: Query) -> NDArray[np.uint32]:
        """Return sums of levels in common, shape (count,); 0 only where the score is 0."""
        levels: NDArray[np.uint32] = _level_sums(self._cells, query.column, query.level,
                                                 self.count)
        return levels

    def beyond(self, query: Query) -> NDArray[np.uint32]:
        """
        Return how many levels more a score may have than its sum, shape (count,).

        Weights beyond the top level have no more in common than the smaller sum of the two
        frames.
        """
        more: NDArray[np.uint32] = np.minimum(self._excess[:self.count], np.uint32(query.excess))
        return more

    def scores(self, query: Query, chosen: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the DBoW L1 scores of chosen keyframes of the block, shape (k,)."""
        scores: NDArray[np.float64] = _exact(self._start, self._number, self._weight,
                                             query.weight, chosen)
        return scores


def _grown(array: NDArray[ScalarT], size: int) -> NDArray[ScalarT]:
    if size <= len(array):
        return array
    larger = np.zeros(max(size, 2 * len(array)), array.dtype)
    larger[:len(array)] = array
    return larger
