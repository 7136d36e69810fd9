# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The exhaustive greedy optimum: how far flips can get when nothing is hidden.

Not an attack of the paper's kind: it looks into the detector and scores every single flip at each
step, n (n - 1) / 2 of them, for which a black box would take as many queries. It is the yardstick
that tells each attack's share of the achievable decline. Greedy: sets of flips that only work
together can be better still.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.attacker import AttackResult
from adversarial_lcd_ros.attack.oracle import edit_budget
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.flips import FlipScorer
from adversarial_lcd_ros.messages.types import MAX_LOGIT
from adversarial_lcd_ros.shown import Shown


class Optimum(Shown):
    """
    At each step the one flip that moves the log odds most towards the opposite decision.

    Attributes
    ----------
    detector : LoopClosureDetector
        Looked into, not asked: results say 0 queries.
    config : AttackConfig
        ``ratio`` and ``edits`` count, the rest does not.

    """

    name: ClassVar[str] = 'optimum'
    title: ClassVar[str] = 'optimum (yardstick)'
    rank: ClassVar[int] = 200
    colour: ClassVar[str] = '#33373d'
    marker: ClassVar[str] = '*'
    dash: ClassVar[str] = '--'

    def __init__(self, detector: LoopClosureDetector, config: AttackConfig | None = None) -> None:
        self.detector = detector
        self.config = config or AttackConfig()

    def process(self, graph: MultiTierGraph) -> AttackResult:
        """Return what an ``Attacker`` returns; ``trace`` holds the loss after each flip."""
        budget = edit_budget(graph.node_count, self.config.ratio)
        if not budget:
            return AttackResult(graph, graph, 'skipped', 'edit budget below one')
        if not len(self.detector.log_odds(graph)):
            return AttackResult(graph, graph, 'failure', 'nothing to compare with', budget,
                                loss_before=-MAX_LOGIT, loss_after=-MAX_LOGIT)
        is_loop = self.detector.judge(graph).is_loop
        before = self._loss(graph, is_loop)
        best, trace, reason = graph, [before], 'no flip left that helps'
        for flipped, loss in self.path(graph):
            best = flipped
            trace.append(loss)
            if self.detector.judge(best).is_loop != is_loop:
                reason = 'decision changed'
                break
            if len(trace) > budget:
                reason = 'edit budget spent'
                break
        status = 'success' if reason == 'decision changed' else 'failure'
        return AttackResult(graph, best, status, reason, budget, loss_before=before,
                            loss_after=trace[-1], trace=tuple(trace[1:]))

    def path(self, graph: MultiTierGraph) -> Iterator[tuple[MultiTierGraph, float]]:
        """Yield the graph and its attack loss after each flip, as long as a flip helps."""
        scorer = FlipScorer(self.detector, graph)
        is_loop = self.detector.judge(graph).is_loop
        pairs = np.stack(np.triu_indices(graph.node_count, 1), axis=1)
        allowed = self._allowed(graph, pairs)
        loss, best = self._loss(graph, is_loop), graph
        while True:
            logits = scorer.logits(best)
            losses = np.where(allowed, -logits if is_loop else logits, -np.inf)
            place = int(losses.argmax())
            if losses[place] <= loss:
                return
            allowed[place] = False
            best, loss = best.flip(pairs[place]), float(losses[place])
            yield best, loss

    def _allowed(self, graph: MultiTierGraph, pairs: NDArray[np.int64]) -> NDArray[np.bool_]:
        if self.config.edits == 'both':
            return np.ones(len(pairs), bool)
        edges = graph.has_edges(pairs)
        return edges if self.config.edits == 'delete' else ~edges

    def _loss(self, graph: MultiTierGraph, is_loop: bool) -> float:
        """Return L of Eq. (1): log odds against the detector's answer to the clean graph."""
        logit = self.detector.verdict_log_odds(graph)
        return -logit if is_loop else logit
