# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What every choice of flips has in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.shown import Shown


@dataclass
class Allowed:
    """
    Flips that an attack may still propose on one frame.

    Attributes
    ----------
    edits : str
        both, add or delete.
    tried : set of int
        Pairs, as source * n + target, that were queried or committed already.

    """

    edits: str = 'both'
    tried: set[int] = field(default_factory=set)

    def filter(self, graph: MultiTierGraph, pairs: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the allowed ones among (k, 2) pairs, source < target, first mention first."""
        pairs = np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1)
        if self.edits != 'both':
            pairs = pairs[graph.has_edges(pairs) == (self.edits == 'delete')]
        key = pairs[:, 0] * graph.node_count + pairs[:, 1]
        _, first = np.unique(key, return_index=True)
        fresh = [place for place in np.sort(first) if int(key[place]) not in self.tried]
        return pairs[fresh]

    def mark(self, graph: MultiTierGraph, pairs: NDArray[np.int64]) -> None:
        """Count (k, 2) pairs with source < target as tried."""
        self.tried.update((pairs[:, 0] * graph.node_count + pairs[:, 1]).tolist())


class Perturbation(Shown, ABC):
    """Proposes flips of a graph, the most promising first; one of your own is a subclass."""

    @abstractmethod
    def propose(self, graph: MultiTierGraph, count: int, allowed: Allowed,
                rng: np.random.Generator) -> NDArray[np.int64]:
        """
        Return at most ``count`` allowed pairs, shape (k, 2), source < target.

        An empty answer means that nothing is left to propose.
        """
