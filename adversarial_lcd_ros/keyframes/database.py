# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Keyframes of the map, and retrieval of candidates among them by visual words."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
import os

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.keyframes.blocks import (
    KEYFRAMES,
    Block,
    Query,
    common_weight,
    least_level,
)

# Scored at once, the best bounds first.
LEAST_SCORED = 64
# A block takes 0.3 ms; fewer are not worth another thread.
THREADED_BLOCKS = 4


def bow_score(a: MultiTierGraph, b: MultiTierGraph) -> float:
    """
    Return the DBoW L1 score of two frames, 0 to 1.

    1 - |a - b|_1 / 2 of L1-normalised vectors, which is the sum of the smaller weights.
    """
    return float(common_weight(a.word, a.word_weight, b.word, b.word_weight))


class Database:
    """
    All keyframes, with their words in blocks that do not move when further ones come.

    Retrieval is exact: it gives what scoring every keyframe and sorting would give.
    """

    def __init__(self) -> None:
        self._graphs: list[MultiTierGraph] = []
        self._graph_bytes = 0
        self._stamp_ns: NDArray[np.int64] = np.zeros(0, np.int64)
        self._blocks: list[Block] = []
        self._threads = ThreadPoolExecutor(min(4, os.cpu_count() or 1), 'retrieval')
        # Words ascending, and the number each got when it was first stored.
        self._word: NDArray[np.uint32] = np.zeros(0, np.uint32)
        self._number: NDArray[np.int64] = np.zeros(0, np.int64)

    def __len__(self) -> int:
        """Return the number of keyframes."""
        return len(self._graphs)

    def __getitem__(self, index: int) -> MultiTierGraph:
        """Return a keyframe's graph by its index in order of insertion."""
        return self._graphs[index]

    @property
    def nbytes(self) -> int:
        """Bytes taken beside the graphs themselves."""
        return (self._stamp_ns.nbytes + self._word.nbytes + self._number.nbytes
                + sum(block.nbytes for block in self._blocks))

    @property
    def memory(self) -> int:
        """Bytes taken, those of the graphs' arrays included."""
        return self.nbytes + self._graph_bytes

    def add(self, graph: MultiTierGraph) -> None:
        """Store a graph as the newest keyframe."""
        index = len(self._graphs)
        if index == len(self._blocks) * KEYFRAMES:
            self._blocks.append(Block())
            self._stamp_ns = np.append(self._stamp_ns[:index], np.zeros(KEYFRAMES, np.int64))
        self._number_new(graph.word)
        self._blocks[-1].add(self._number[np.searchsorted(self._word, graph.word)],
                             graph.word_weight)
        self._stamp_ns[index] = graph.stamp_ns
        self._graphs.append(graph)
        self._graph_bytes += graph.nbytes

    def _number_new(self, word: NDArray[np.uint32]) -> None:
        new = word[~self._is_known(word)]
        if len(new):
            place = np.searchsorted(self._word, new)
            self._number = np.insert(self._number, place, len(self._word) + np.arange(len(new)))
            self._word = np.insert(self._word, place, new)

    def _is_known(self, word: NDArray[np.uint32]) -> NDArray[np.bool_]:
        known: NDArray[np.bool_] = np.zeros(len(word), np.bool_)
        if len(self._word):
            place = np.minimum(np.searchsorted(self._word, word), len(self._word) - 1)
            known = self._word[place] == word
        return known

    def _query(self, graph: MultiTierGraph) -> Query:
        known = self._is_known(graph.word)
        number = self._number[np.searchsorted(self._word, graph.word[known])]
        return Query(number, graph.word_weight[known], len(self._word))

    def admissible(self, stamp_ns: int, min_gap_ns: int) -> NDArray[np.bool_]:
        """Tell for every keyframe whether it is at least the gap older than the stamp."""
        admissible: NDArray[np.bool_] = (
            self._stamp_ns[:len(self._graphs)] <= stamp_ns - min_gap_ns)
        return admissible

    def scores(self, graph: MultiTierGraph) -> NDArray[np.float64]:
        """Return the DBoW L1 score of a graph with every keyframe, shape (keyframes,)."""
        return self._scores(self._query(graph), np.arange(len(self._graphs)))

    def _scores(self, query: Query, keyframes: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the scores with some keyframes, ascending."""
        ends = np.searchsorted(keyframes, KEYFRAMES * np.arange(len(self._blocks) + 1))
        return np.concatenate([np.zeros(0), *(
            block.scores(query, keyframes[ends[place]:ends[place + 1]] - KEYFRAMES * place)
            for place, block in enumerate(self._blocks) if ends[place] < ends[place + 1])])

    def _levels(self, query: Query) -> NDArray[np.uint32]:
        """Return the sum of levels in common with every keyframe, shape (keyframes,)."""
        run = self._threads.map if len(self._blocks) >= THREADED_BLOCKS else map
        return np.concatenate([np.zeros(0, np.uint32),
                               *run(lambda block: block.levels(query), self._blocks)])

    def _bounds(self, query: Query, level: NDArray[np.uint32]) -> NDArray[np.uint32]:
        """Return what sums of levels bound scores, 0 where they are 0."""
        if not query.excess:
            return level.copy()
        beyond = np.concatenate([np.zeros(0, np.uint32),
                                 *(block.beyond(query) for block in self._blocks)])
        return np.where(level > 0, level + beyond, level)

    def retrieve(self, graph: MultiTierGraph, admissible: NDArray[np.bool_], count: int,
                 window: int = 0) -> tuple[list[int], list[float]]:
        """
        Return the most alike keyframes by falling score, and their scores; older ones of equals.

        Parameters
        ----------
        graph : MultiTierGraph
        admissible : bool, (keyframes,)
            Those to choose from.
        count : int
            Most keyframes to return.
        window : int
            None is returned that is so near in the map to one before it.

        """
        query = self._query(graph)
        level = self._levels(query)
        level[~admissible] = 0
        unlike = np.flatnonzero(admissible & (level == 0))
        bound = self._bounds(query, level)
        ranked, score, chosen = np.zeros(0, np.int64), np.zeros(0), list[int]()
        # Each one chosen rules out 2 window others: among so many are enough.
        new = np.flatnonzero(level >= _largest(level, max(LEAST_SCORED, count * (2 * window + 1))))
        while len(new):
            bound[new] = 0
            ranked, score = np.append(ranked, new), np.append(score, self._scores(query, new))
            ranked, score = _by_score(ranked, score)
            chosen = _spread(ranked, count, window)
            new = np.flatnonzero(bound >= (least_level(score[chosen[-1]])
                                           if len(chosen) == count else 1))
        # Levels in common may be those of two words in one column: a score can be 0 there, too.
        if len(chosen) < count or score[chosen[-1]] == 0:
            ranked, score = _by_score(np.append(ranked, unlike),
                                      np.append(score, np.zeros(len(unlike))))
            chosen = _spread(ranked, count, window)
        return ranked[chosen].tolist(), score[chosen].tolist()


def _by_score(keyframes: NDArray[np.int64], score: NDArray[np.float64]
              ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return keyframes and scores by falling score, the older of equals first."""
    order = np.lexsort((keyframes, -score))
    return keyframes[order], score[order]


def _largest(level: NDArray[np.uint32], count: int) -> int:
    """Return the count-th largest level; 1 if there are fewer above 0."""
    return max(1, int(np.partition(level, -count)[-count])) if len(level) > count else 1


def _spread(ranked: NDArray[np.int64], count: int, window: int) -> list[int]:
    """Return the first places whose keyframes are not within the window of one before them."""
    taken: set[int] = set()
    chosen: list[int] = []
    for place, keyframe in enumerate(map(int, ranked)):
        if keyframe not in taken:
            chosen.append(place)
            taken.update(range(keyframe - window, keyframe + window + 1))
            if len(chosen) == count:
                break
    return chosen
