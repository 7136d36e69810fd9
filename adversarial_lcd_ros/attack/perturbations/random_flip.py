# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Flips of random pairs (paper, Sec. 2, random edge perturbation)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.perturbations.base import Allowed, Perturbation
from adversarial_lcd_ros.graph import MultiTierGraph

ROUNDS = 8


class RandomFlip(Perturbation):
    """
    Every pair is as likely as any other; with ``delete``, every edge.

    Of n (n - 1) / 2 pairs few are edges: unrestricted, most random flips add one.
    """

    name: ClassVar[str] = 'random_flip'
    rank: ClassVar[int] = 4
    colour: ClassVar[str] = '#7a4a9c'
    marker: ClassVar[str] = 'v'

    def propose(self, graph: MultiTierGraph, count: int, allowed: Allowed,
                rng: np.random.Generator) -> NDArray[np.int64]:
        """Return random pairs."""
        if allowed.edits == 'delete':
            return allowed.filter(graph, rng.permutation(graph.edge.astype(np.int64)))[:count]
        pairs = np.zeros((0, 2), np.int64)
        for _ in range(ROUNDS):
            drawn = rng.integers(0, max(graph.node_count, 1), (2 * count, 2))
            pairs = allowed.filter(graph, np.concatenate([pairs, drawn]))
            if len(pairs) >= count:
                break
        return pairs[:count]
