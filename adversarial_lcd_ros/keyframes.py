"""Keyframes of the map, and retrieval of candidates among them by visual words."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.graph import MultiTierGraph


def bow_score(a: MultiTierGraph, b: MultiTierGraph) -> float:
    """
    Return the DBoW L1 score of two frames, 0 to 1.

    1 - |a - b|_1 / 2 of L1-normalised vectors, which is the sum of the smaller weights.
    """
    _, in_a, in_b = np.intersect1d(a.word, b.word, assume_unique=True, return_indices=True)
    return float(np.minimum(a.word_weight[in_a], b.word_weight[in_b]).sum())


ScalarT = TypeVar('ScalarT', bound=np.generic)


class Database:
    """
    All keyframes, with their words in flat arrays that grow by doubling.

    Scoring a query against every keyframe is one pass over those arrays.
    """

    def __init__(self) -> None:
        self._graphs: list[MultiTierGraph] = []
        self._stamp_ns: NDArray[np.int64] = np.zeros(64, np.int64)
        self._word: NDArray[np.uint32] = np.zeros(1 << 14, np.uint32)
        self._weight: NDArray[np.float32] = np.zeros(1 << 14, np.float32)
        self._start: NDArray[np.int64] = np.zeros(64, np.int64)
        self._used = 0
        self._max_word = 0

    def __len__(self) -> int:
        """Return the number of keyframes."""
        return len(self._graphs)

    def __getitem__(self, index: int) -> MultiTierGraph:
        """Return a keyframe's graph by its index in order of insertion."""
        return self._graphs[index]

    def add(self, graph: MultiTierGraph) -> None:
        """Store a graph as the newest keyframe."""
        index, end = len(self._graphs), self._used + len(graph.word)
        self._stamp_ns = _grown(self._stamp_ns, index + 1)
        self._start = _grown(self._start, index + 1)
        self._word = _grown(self._word, end)
        self._weight = _grown(self._weight, end)
        self._word[self._used:end] = graph.word
        self._weight[self._used:end] = graph.word_weight
        self._stamp_ns[index] = graph.stamp_ns
        self._start[index] = self._used
        self._used = end
        if len(graph.word):
            self._max_word = max(self._max_word, int(graph.word[-1]))
        self._graphs.append(graph)

    def admissible(self, stamp_ns: int, min_gap_ns: int) -> NDArray[np.bool_]:
        """Tell for every keyframe whether it is at least the gap older than the stamp."""
        admissible: NDArray[np.bool_] = (
            self._stamp_ns[:len(self._graphs)] <= stamp_ns - min_gap_ns)
        return admissible

    def scores(self, graph: MultiTierGraph) -> NDArray[np.float64]:
        """Return the DBoW L1 score of a graph with every keyframe, shape (keyframes,)."""
        count = len(self._graphs)
        weight = np.zeros(self._max_word + 1, np.float32)
        known = graph.word <= self._max_word
        weight[graph.word[known]] = graph.word_weight[known]
        common = np.minimum(self._weight[:self._used], weight[self._word[:self._used]])
        total = np.concatenate([[0.0], np.cumsum(common, dtype=np.float64)])
        ends = np.append(self._start[1:count], self._used) if count else self._start[:0]
        scores: NDArray[np.float64] = np.maximum(total[ends] - total[self._start[:count]], 0)
        return scores


def _grown(array: NDArray[ScalarT], size: int) -> NDArray[ScalarT]:
    if size <= len(array):
        return array
    larger = np.zeros(max(size, 2 * len(array)), array.dtype)
    larger[:len(array)] = array
    return larger
