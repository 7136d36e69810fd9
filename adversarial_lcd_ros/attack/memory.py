# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What an attacker remembers of the graphs that went by.

Graphs are remembered as forwarded, since that is the detector's map; its temporal gap is learnt
from soft answers of 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from adversarial_lcd_ros.attack.deadline import check_time
from adversarial_lcd_ros.compiled.hamming import lanes, mutual
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.keyframes.database import Database

MIN_GAP_NS = 8_000_000_000
MAX_HAMMING = 76
CACHED = 256
MAX_OBJECTS = 256
LENGTH_FACTOR, LENGTH_SLACK = 2.0, 0.01
MAX_BYTES = 2 ** 32


@dataclass(frozen=True)
class Echo:
    """
    A graph from the past, seen from the present one.

    Attributes
    ----------
    pairs : int64, (k, 2)
        Pairs of the present graph, source < target, whose like-looking nodes are joined by an
        edge in the past one.
    weight : float64, (k,)
        How much alike the features at their ends look, 0 to 1; objects of a class are alike.
    at_object : bool, (k,)
        One of the ends is an object.
    same_length : bool, (k,)
        The edge is about as long in the past graph as it is, or would be, in the present one:
        within a factor of two and a hundredth of the diagonal.

    """

    pairs: NDArray[np.int64]
    weight: NDArray[np.float64]
    at_object: NDArray[np.bool_]
    same_length: NDArray[np.bool_]

    def among(self, rows: NDArray[np.bool_]) -> Echo:
        """Return some of the pairs."""
        return Echo(self.pairs[rows], self.weight[rows], self.at_object[rows],
                    self.same_length[rows])


@dataclass(frozen=True)
class Matched:
    """
    Features of the present graph that look like some of a past one.

    Attributes
    ----------
    past : MultiTierGraph
    node, place : int64, (k,)
        Nodes of the present and of the past graph that look alike.
    alike : float64, (k,)
        How much, 0 to 1.

    """

    past: MultiTierGraph
    node: NDArray[np.int64]
    place: NDArray[np.int64]
    alike: NDArray[np.float64]


class Memory:
    """
    All graphs that passed the man in the middle, as he forwarded them: the detector's map.

    He does not know how old a graph must be for the detector to compare with it. He assumes
    eight seconds until an answer tells him better (``too_young``).
    """

    def __init__(self) -> None:
        self._database = Database()
        self._gap_ns = MIN_GAP_NS
        self._lanes = lru_cache(CACHED)(lambda index: _feature_lanes(self._database[index]))

    def add(self, graph: MultiTierGraph) -> None:
        """Remember a graph as it was forwarded, while there is room."""
        if self._database.memory < MAX_BYTES:
            self._database.add(graph)

    def too_young(self, stamp_ns: int) -> None:
        """Learn that at this time the detector compared with nothing, not even the oldest."""
        if len(self._database):
            self._gap_ns = stamp_ns - self._database[0].stamp_ns

    def similar(self, graph: MultiTierGraph, count: int) -> list[tuple[int, float]]:
        """Return the graphs of the past that share most visual words, as (index, score)."""
        old = self._database.admissible(graph.stamp_ns, self._gap_ns)
        return list(zip(*self._database.retrieve(graph, old, count), strict=True))

    def young(self, graph: MultiTierGraph, count: int) -> list[MultiTierGraph]:
        """Return graphs that are too young to be compared with, the oldest first, spread."""
        young = np.flatnonzero(~self._database.admissible(graph.stamp_ns, self._gap_ns))
        some = np.linspace(0, len(young) - 1, min(count, len(young))).round().astype(int)
        return [self._database[int(index)] for index in young[some]]

    def __getitem__(self, index: int) -> MultiTierGraph:
        """Return a graph of the past."""
        return self._database[index]

    def neighbours(self, index: int) -> range:
        """Return a graph of the past with the ones just before and after it."""
        return range(max(0, index - 1), min(len(self._database), index + 2))

    def matched(self, graph: MultiTierGraph, index: int) -> Matched:
        """Return the features of a graph and of a past one that are nearest to each other."""
        past = self._database[index]
        present, place, distance = mutual(_feature_lanes(graph), self._lanes(index), MAX_HAMMING)
        return Matched(past, present + graph.object_count, place + past.object_count,
                       1 - distance / (MAX_HAMMING + 1.0))

    def echo(self, graph: MultiTierGraph, index: int) -> Echo:
        """
        Return which edges of a past graph the present one might repeat.

        Each step of it takes a quarter of a second of the largest graphs that are let through.
        """
        check_time()
        found = self.matched(graph, index)
        past = found.past
        # For each node of the past graph: the present one that looks like it, and how much.
        node = np.full(past.node_count, -1, np.int64)
        alike = np.zeros(past.node_count)
        node[found.place], alike[found.place] = found.node, found.alike
        check_time()
        rows, columns = _match_objects(graph, past, node, alike)
        node[columns], alike[columns] = rows, 1
        check_time()
        ends = past.edge.astype(np.int64)
        ends = ends[(node[ends] >= 0).all(axis=1)]
        here, there = graph.length_between(node[ends]), past.length_between(ends)
        same = np.maximum(here, there) <= LENGTH_FACTOR * np.minimum(here, there) + LENGTH_SLACK
        return Echo(np.sort(node[ends], axis=1), np.sqrt(alike[ends].prod(axis=1)),
                    ends[:, 0] < past.object_count, same)


def _feature_lanes(graph: MultiTierGraph) -> NDArray[np.uint64]:
    return lanes(graph.descriptor[graph.object_count:])


def _match_objects(graph: MultiTierGraph, past: MultiTierGraph, node: NDArray[np.int64],
                   alike: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return objects of one class in both graphs, those together that hold like features."""
    # No builder makes more; the time grows with the cube of their number.
    objects, olds = (min(each.object_count, MAX_OBJECTS) for each in (graph, past))
    source, target = past.edge.astype(np.int64).T
    held = (source < olds) & (node[target] >= 0)
    holds = np.zeros((graph.node_count, olds))
    holds[node[target[held]], source[held]] = alike[target[held]]
    joined = np.zeros((objects, graph.node_count))
    joined[tuple(graph.edge[graph.edge[:, 0] < objects].T)] = 1
    common = np.einsum('of,fp->op', joined, holds)
    same = graph.label[:objects, None] == past.label[None, :olds]
    rows, columns = linear_sum_assignment(np.where(same, 1 + common, 0), maximize=True)
    kept = same[rows, columns]
    return rows[kept], columns[kept]
