# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Decisions that no few flips can turn over, whoever chooses them.

A certificate looks into the detector and holds against any flips of the query, a white box
included, while the keyframes are as they are. It says nothing of other attacks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.scoring import Scoring
from adversarial_lcd_ros.lcd.views import Feels
from adversarial_lcd_ros.messages.types import MAX_LOGIT, log_odds

# Scores of bounds and of the detector are summed in another order.
_ROUNDING = 1e-15
_MARGIN = 1e-4


@dataclass(frozen=True)
class Certificate:
    """
    What up to 0, 1, ... b flips can do to the log odds of each candidate.

    Attributes
    ----------
    least, largest : float64, (b + 1, candidates)
        By the scores.
    stands : bool, (candidates,)
        A loop with the candidate would be borne out by the defences.
    is_loop : bool
        The decision on the graph as it is.
    threshold : float
        Log odds from which on a loop is declared.

    """

    least: NDArray[np.float64]
    largest: NDArray[np.float64]
    stands: NDArray[np.bool_]
    is_loop: bool
    threshold: float

    @property
    def holds(self) -> NDArray[np.bool_]:
        """
        Whether no so many flips change the decision, shape (b + 1,).

        No loop: no candidate that would be borne out reaches the threshold. A loop: one candidate
        stays above it, and above all that would not be borne out; whichever is best then is
        borne out, too.
        """
        if not self.is_loop:
            high = self.largest[:, self.stands].max(axis=1, initial=-np.inf)
            calm: NDArray[np.bool_] = high + _MARGIN < self.threshold
            return calm
        low = self.least[:, self.stands].max(axis=1, initial=-np.inf) - _MARGIN
        rival = self.largest[:, ~self.stands].max(axis=1, initial=-np.inf) + _MARGIN
        firm: NDArray[np.bool_] = (low >= self.threshold) & (low > rival)
        return firm


def certify(detector: LoopClosureDetector, graph: MultiTierGraph, budget: int) -> Certificate:
    """
    Return what is proven of the decision on a graph, against any up to ``budget`` flips.

    Raises
    ------
    ConfigError
        Nothing is proven of the target, or of a defence that makes other edges of a graph.

    """
    scoring = detector.judging.scoring
    nodes = detector.query_nodes(graph)
    count = len(nodes.candidates)
    least, largest = _log_odds(detector, graph, budget)
    stands = np.array([not scoring.may_refuse or detector.support(graph, candidate) >= 1
                       for candidate in range(count)], bool)
    return Certificate(least, largest, stands, detector.judge(graph).is_loop,
                       _log_odds_of(detector.judging.threshold))


def check_provable(config: LcdConfig) -> None:
    """Raise ConfigError where nothing can be proven of a detector."""
    scoring = Scoring.of(config)
    if not _feels_nothing(scoring):
        _check(scoring)


def _feels_nothing(scoring: Scoring) -> bool:
    return (scoring.target.feels is Feels.NONE
            or any(defence.ignores_edges for defence in scoring.defences))


def _check(scoring: Scoring) -> None:
    if scoring.target.bounds and not scoring.changes_graphs:
        return
    what = ('a defence that makes other edges of a graph' if scoring.target.bounds
            else f'target {scoring.target.name}')
    raise ConfigError(f'nothing is proven of {what}: certificates are for targets with bounds, '
                      'such as edges and wl, behind defences that leave graphs as they are or '
                      'ignore edges')


def _log_odds_of(threshold: float) -> float:
    return float(np.clip(log_odds(threshold), -MAX_LOGIT, MAX_LOGIT))


def _log_odds(detector: LoopClosureDetector, graph: MultiTierGraph, budget: int
              ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the least and the largest log odds, (budget + 1, candidates) each."""
    scoring, nodes = detector.judging.scoring, detector.query_nodes(graph)
    if not nodes.candidates or _feels_nothing(scoring):
        same = np.tile(detector.log_odds(graph), (budget + 1, 1))
        return same, same
    _check(scoring)
    query = scoring.view(graph)
    ranges = [bound(query, nodes.compared.nodes, nodes.average).after(budget)
              for bound in scoring.target.bounds]
    least, largest = (np.stack([pair[side] for pair in ranges], axis=2) for side in (0, 1))
    low, high = np.sqrt(np.maximum(least - _ROUNDING, 0)), np.sqrt(largest + _ROUNDING)
    weights = np.array(detector.decision.weights)
    up, down = np.maximum(weights, 0), np.minimum(weights, 0)
    return (detector.decision.bias + low @ up + high @ down,
            detector.decision.bias + high @ up + low @ down)
