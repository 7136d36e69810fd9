# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How far the bounds of a certificate are from what somebody reaches who looks into the detector.

A proof can be wrong, and its code, too: no flips that anybody finds may lead beyond a bound. The
greedy optimum finds the worst that is known, flips drawn at random what it does not look for.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from adversarial_lcd_ros.evaluation.frames.optimum import Optimum
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.certificates import Certificate, certify
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector


@dataclass(frozen=True)
class Gap:
    """
    The bounds of one frame beside what some flips reached, log odds.

    Attributes
    ----------
    flips : int
    is_loop : bool
        The decision on the graph as it is.
    inside : float
        How far the nearest bound of any candidate is; below 0 it is no bound.
    loose : float
        How far the best candidate is from its bound in the direction of the other decision.
    kept : bool
        The certificate does not claim what is not so: the decision changed only where it does
        not hold.

    """

    flips: int
    is_loop: bool
    inside: float
    loose: float
    kept: bool


def optimum_gaps(detector: LoopClosureDetector, graph: MultiTierGraph, budget: int
                 ) -> Iterator[Gap]:
    """Yield what the greedy optimum leaves of the bounds after each flip, up to the budget."""
    found = certify(detector, graph, budget)
    for flips, (flipped, _) in enumerate(Optimum(detector).path(graph), 1):
        yield _gap(detector, found, flipped, flips)
        if flips == budget:
            return


def random_gaps(detector: LoopClosureDetector, graph: MultiTierGraph, budget: int,
                draws: Iterable[int], rng: np.random.Generator) -> Iterator[Gap]:
    """Yield what flips drawn at random leave of the bounds, so many in each draw."""
    found = certify(detector, graph, budget)
    pairs = np.stack(np.triu_indices(graph.node_count, 1), axis=1)
    for flips in draws:
        chosen = rng.choice(len(pairs), min(flips, len(pairs)), replace=False)
        yield _gap(detector, found, graph.flip(pairs[chosen]), flips)


def _gap(detector: LoopClosureDetector, found: Certificate, flipped: MultiTierGraph, flips: int
         ) -> Gap:
    odds = detector.log_odds(flipped)
    least, largest = found.least[flips], found.largest[flips]
    none = -np.inf  # of no candidate, and its bound
    reached = odds.max(initial=none)
    loose = (reached - least.max(initial=none) if found.is_loop
             else largest.max(initial=none) - reached) if len(odds) else 0.0
    kept = not found.holds[flips] or detector.judge(flipped).is_loop == found.is_loop
    return Gap(flips, found.is_loop,
               float(np.minimum(odds - least, largest - odds).min(initial=np.inf)),
               float(loose), bool(kept))
