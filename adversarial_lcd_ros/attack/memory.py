"""What an attacker remembers of the graphs that went by."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.keyframes import Database

MIN_GAP_NS = 8_000_000_000
MAX_HAMMING = 76
RECALLED = 5


@dataclass(frozen=True)
class Echo:
    """
    A graph from the past, seen from the present one.

    Attributes
    ----------
    pairs : int64, (k, 2)
        Pairs of the present graph, source < target, whose like-looking features are joined by
        an edge in the past one.
    weight : float64, (k,)
        How much alike the features at both ends look, 0 to 1.

    """

    pairs: NDArray[np.int64]
    weight: NDArray[np.float64]


class Memory:
    """
    All graphs that passed the man in the middle, before he touched them.

    Nothing here comes from the detector. Whether a detector remembers for longer or for shorter
    than the eight seconds below is not known to him either.
    """

    def __init__(self) -> None:
        self._database = Database()
        self._signs = lru_cache(64)(lambda index: _signs(self._database[index]))

    def add(self, graph: MultiTierGraph) -> None:
        """Remember a clean graph."""
        self._database.add(graph)

    def similar(self, graph: MultiTierGraph, count: int = RECALLED) -> list[tuple[int, float]]:
        """Return the graphs of the past that share most visual words, as (index, score)."""
        score = self._database.scores(graph)
        score[~self._database.admissible(graph.stamp_ns, MIN_GAP_NS)] = -1
        best = np.argsort(-score, kind='stable')[:count]
        return [(int(index), float(score[index])) for index in best if score[index] >= 0]

    def neighbours(self, index: int) -> range:
        """Return a graph of the past with the ones just before and after it."""
        return range(max(0, index - 1), min(len(self._database), index + 2))

    def echo(self, graph: MultiTierGraph, index: int) -> Echo:
        """Return which edges of a past graph the present one might repeat."""
        past = self._database[index]
        node = np.full(past.node_count, -1, np.int64)
        alike = np.zeros(past.node_count)
        query, reference, weight = _match(_signs(graph), self._signs(index))
        node[reference + past.object_count] = query + graph.object_count
        alike[reference + past.object_count] = weight
        ends = past.edge.astype(np.int64)
        ends = ends[(node[ends] >= 0).all(axis=1)]
        return Echo(np.sort(node[ends], axis=1), np.sqrt(alike[ends].prod(axis=1)))


def _signs(graph: MultiTierGraph) -> NDArray[np.float32]:
    bits = np.unpackbits(graph.descriptor[graph.object_count:], axis=1)
    return 2 * bits.astype(np.float32) - 1


def _match(query: NDArray[np.float32], reference: NDArray[np.float32]
           ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Return features that are each other's nearest in Hamming distance, and how near, 0 to 1."""
    if not len(query) or not len(reference):
        none = np.zeros(0, np.int64)
        return none, none, np.zeros(0)
    distance = (256 - query @ reference.T) / 2
    forward = distance.argmin(axis=1)
    rows = np.arange(len(query))
    best = distance[rows, forward]
    kept = np.flatnonzero((distance.argmin(axis=0)[forward] == rows) & (best <= MAX_HAMMING))
    return kept, forward[kept], 1 - best[kept] / (MAX_HAMMING + 1.0)
