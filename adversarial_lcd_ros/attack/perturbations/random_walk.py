# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Flips between the ends of random walks (paper, Sec. 4.3)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.perturbations.base import Allowed, Perturbation
from adversarial_lcd_ros.graph import MultiTierGraph

MAX_STEPS = 4
ROUNDS = 8


class RandomWalk(Perturbation):
    """
    The first and the last node of a walk of 1 to 4 steps over the edges.

    The paper does not say which pair of a walk is flipped; one step proposes to delete an edge,
    more steps mostly to add one across a short distance.
    """

    name: ClassVar[str] = 'random_walk'
    rank: ClassVar[int] = 5
    colour: ClassVar[str] = '#d08700'
    marker: ClassVar[str] = '^'

    def propose(self, graph: MultiTierGraph, count: int, allowed: Allowed,
                rng: np.random.Generator) -> NDArray[np.int64]:
        """Return the ends of walks from random nodes that have an edge."""
        adjacency = graph.adjacency
        degree = np.diff(adjacency.indptr)
        starts = np.flatnonzero(degree)
        pairs = np.zeros((0, 2), np.int64)
        for _ in range(ROUNDS if len(starts) else 0):
            first = rng.choice(starts, 2 * count)
            steps = rng.integers(1, MAX_STEPS + 1, len(first))
            last = first.copy()
            for step in range(MAX_STEPS):
                walking = np.flatnonzero(steps > step)
                edge = rng.integers(0, degree[last[walking]])
                last[walking] = adjacency.indices[adjacency.indptr[last[walking]] + edge]
            drawn = np.stack([first, last], axis=1).astype(np.int64)
            pairs = allowed.filter(graph, np.concatenate([pairs, drawn]))
            if len(pairs) >= count:
                break
        return pairs[:count]
