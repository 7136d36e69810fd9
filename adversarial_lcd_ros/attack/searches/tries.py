# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which flips a stepwise search may still ask about: what the setting ``retry`` decides."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.perturbations import Allowed, Perturbation
from adversarial_lcd_ros.graph import MultiTierGraph

# Flips that the rule "set" commits at once, and edits' worth of queries that it spends on them.
SET_SIZE = 3


class Tries:
    """
    The flips of one frame that were asked about, and those of them that wait for another try.

    Parameters
    ----------
    retry : str
        never, gained or set, as in AttackConfig.
    edits : str
        both, add or delete.

    """

    def __init__(self, retry: str, edits: str) -> None:
        self._keeps = retry == 'gained'
        self._at_once = SET_SIZE if retry == 'set' else 1
        self._allowed = Allowed(edits)
        self._waiting: dict[tuple[int, int], float] = {}

    def step_size(self, edits_left: int) -> int:
        """Return how many flips the next step commits at most."""
        return min(self._at_once, edits_left)

    def pool(self, perturbation: Perturbation, graph: MultiTierGraph, count: int,
             rng: np.random.Generator) -> NDArray[np.int64]:
        """Return flips that wait, by falling gain, and at most ``count`` new ones, (k, 2)."""
        again = sorted(self._waiting, key=lambda pair: (-self._waiting[pair], pair))
        fresh = perturbation.propose(graph, count, self._allowed, rng)
        return np.concatenate([np.array(again, np.int64).reshape(-1, 2), fresh])

    def asking(self, graph: MultiTierGraph, pair: NDArray[np.int64]) -> None:
        """Note that a flip, shape (2,), is asked about: no perturbation proposes it again."""
        self._allowed.mark(graph, pair[None])
        self._waiting.pop(_key(pair), None)

    def asked(self, pair: NDArray[np.int64], gain: float) -> None:
        """Let a flip that gained wait for another try, where the rule says so."""
        if self._keeps and gain > 0:
            self._waiting[_key(pair)] = gain

    def committed(self, pairs: NDArray[np.int64]) -> None:
        """Note that flips, shape (k, 2), are part of the graph from now on."""
        for pair in pairs:
            self._waiting.pop(_key(pair), None)


def _key(pair: NDArray[np.int64]) -> tuple[int, int]:
    return int(pair[0]), int(pair[1])
