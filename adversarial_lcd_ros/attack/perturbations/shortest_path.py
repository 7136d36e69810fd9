# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Flips that make shortest paths longer or shorter (paper, Sec. 2 and 4.3)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import breadth_first_order

from adversarial_lcd_ros.attack.deadline import check_time
from adversarial_lcd_ros.attack.perturbations.base import Allowed, Perturbation
from adversarial_lcd_ros.graph import MultiTierGraph

SOURCES = 16


class ShortestPath(Perturbation):
    """
    For two random nodes: cut an edge of the shortest path, or join its ends.

    Paths count hops. A cut makes the path longer, the join makes it one hop; which of the two is
    proposed is a coin toss, as is the edge of the path that is cut.
    """

    name: ClassVar[str] = 'shortest_path'
    rank: ClassVar[int] = 6
    colour: ClassVar[str] = '#2e8064'
    marker: ClassVar[str] = 'D'

    def propose(self, graph: MultiTierGraph, count: int, allowed: Allowed,
                rng: np.random.Generator) -> NDArray[np.int64]:
        """Return flips on shortest paths between random nodes."""
        pairs = np.zeros((0, 2), np.int64)
        starts = np.flatnonzero(np.diff(graph.adjacency.indptr))
        for source in rng.permutation(starts)[:SOURCES]:
            check_time()
            reached, before = breadth_first_order(graph.adjacency, source, directed=False)
            ends = rng.permutation(reached[1:])[:-(-2 * count // SOURCES)]
            drawn = [self._flip(int(source), int(end), before, rng) for end in ends]
            pairs = allowed.filter(
                graph, np.concatenate([pairs, np.array(drawn, np.int64).reshape(-1, 2)]))
            if len(pairs) >= count:
                break
        return pairs[:count]

    @staticmethod
    def _flip(source: int, end: int, before: NDArray[np.int32],
              rng: np.random.Generator) -> tuple[int, int]:
        path = [end]
        while path[-1] != source:
            path.append(int(before[path[-1]]))
        if len(path) > 2 and rng.random() < 0.5:
            return source, end
        step = int(rng.integers(len(path) - 1))
        return path[step], path[step + 1]
