# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Log odds of a loop closure after every single flip of a graph, at once.

No attack on a black box has this: it looks into the detector. It is the yardstick for those that
ask (evaluation/frames/optimum.py).

Cosines come from products of x0; deletions are recomputed, since differences of sums lose digits
(flip_kernels.py).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd import flip_kernels, kernels
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.single_flips import Flips
from adversarial_lcd_ros.lcd.views import View


class FlipScorer:
    """
    Exact log odds of single flips of graphs that share their nodes.

    All flips of a graph are scored the sooner the fewer edges differ from the graph before: the
    steps of a greedy search cost half of the first.

    Attributes
    ----------
    detector : LoopClosureDetector
        Must not store further keyframes meanwhile.

    """

    def __init__(self, detector: LoopClosureDetector, graph: MultiTierGraph) -> None:
        self.detector = detector
        self._nodes = detector.query_nodes(graph)
        self._scoring = detector.judging.scoring
        self._before: MultiTierGraph | None = None
        if self._nodes.candidates:
            rows = self._nodes.base.x0.astype(np.float64)
            self._product = rows @ rows.T
            # Channels look at the edges of the graph that a flip was made in: behind a defence
            # that makes others of them, flips are judged one by one.
            made = () if self._scoring.changes_graphs else self._scoring.target.flip_channels
            self._channels = [make(self._nodes.base, self._nodes.compared.nodes,
                                   self._nodes.average) for make in made]

    def logits(self, graph: MultiTierGraph, pairs: ArrayLike | None = None
               ) -> NDArray[np.float64]:
        """
        Return the log odds in the detector's answer after each single flip, shape (k,).

        Parameters
        ----------
        graph : MultiTierGraph
            With the nodes of the one that this was made for.
        pairs : int, (k, 2), optional
            Default: all n (n - 1) / 2, in the order of ``numpy.triu_indices``.

        """
        ends = (None if pairs is None
                else np.sort(np.asarray(pairs, np.int64).reshape(-1, 2), axis=1))
        if not self._nodes.candidates:
            every = graph.node_count * (graph.node_count - 1) // 2
            return np.full(every if ends is None else len(ends), -np.inf)
        flips = self._flips(graph, ends)
        if not self._channels:
            return self._judged(graph, flips)
        scores = np.stack([channel.after(flips) for channel in self._channels], axis=2)
        return self.detector.judging.verdict_logits(
            self.detector.decision.logit(scores),
            lambda candidate: self.detector.support(graph, candidate))

    def _flips(self, graph: MultiTierGraph, pairs: NDArray[np.int64] | None) -> Flips:
        view = View(graph, self._nodes.base)  # as flipped, not as prepared
        moments = flip_kernels.moments(view.x0, view.incidence, self._product)
        before, self._before = self._before, graph if pairs is None else None
        if pairs is not None:
            return Flips(view, pairs, graph.has_edges(pairs), graph.length_between(pairs),
                          moments, None)
        ends, length = self._everything
        changed = None if before is None else kernels.changed_nodes(
            before.edge_key, before.edge_length, graph.edge_key, graph.edge_length,
            graph.node_count)
        return Flips(view, ends, graph.has_edges(ends), length, moments, changed)

    @cached_property
    def _everything(self) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """All pairs of nodes, and their lengths."""
        graph = self._nodes.base.graph
        ends = np.stack(np.triu_indices(graph.node_count, 1), axis=1)
        return ends, graph.length_between(ends)

    def _judged(self, graph: MultiTierGraph, flips: Flips) -> NDArray[np.float64]:
        """Return the log odds after each flip by making those that the target can feel."""
        logits = np.full(len(flips.pairs), self.detector.verdict_log_odds(graph))
        for place in np.flatnonzero(self._scoring.felt(flips.pairs, flips.view.objects)):
            logits[place] = self.detector.verdict_log_odds(graph.flip(flips.pairs[place]))
        return logits


def flip_logits(detector: LoopClosureDetector, graph: MultiTierGraph,
                pairs: ArrayLike | None = None) -> NDArray[np.float64]:
    """Return the log odds after each single flip, shape (k,); see ``FlipScorer.logits``."""
    return FlipScorer(detector, graph).logits(graph, pairs)
