# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The one place where a graph is prepared and scored.

The detector, the yardstick that scores all single flips (flips.py), training and the pairs that
targets are measured on (training/pair_scores.py) all judge through it. So what is set for one
of them holds for the others: a defence or a check cannot be in the one and not in the other.

Behind a defence that makes other edges of a graph, single flips are judged one by one: slower,
never otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.decision import Decision, probability
from adversarial_lcd_ros.lcd.defences import Defence, make_defences
from adversarial_lcd_ros.lcd.targets import (
    Scores,
    Target,
    check_variant,
    decision_path,
    make_target,
)
from adversarial_lcd_ros.lcd.views import Comparison, Feels, View
from adversarial_lcd_ros.messages.types import MAX_LOGIT, log_odds


@dataclass(frozen=True)
class Compared:
    """
    A query's nodes beside references, behind the defences.

    Attributes
    ----------
    nodes : Comparison
    scores : callable
        Scores of a View with these nodes with every reference, shape (r, channels).

    """

    nodes: Comparison
    scores: Scores


class Scoring:
    """
    What a graph is worth beside others: prepared by the defences, compared by the target.

    Attributes
    ----------
    target : Target
    defences : tuple of Defence
        In the order in which they see a graph.

    """

    def __init__(self, target: Target, defences: Sequence[Defence] = ()) -> None:
        self.target = target
        self.defences = tuple(defences)
        # The graph that was prepared last, as received and as prepared: a decision asks for it
        # when nodes are compared, when it is scored, and when it is remembered.
        self._latest: tuple[MultiTierGraph, MultiTierGraph] | None = None

    @classmethod
    def of(cls, config: LcdConfig, network: Path | None = None) -> Scoring:
        """
        Return that of a detector.

        Parameters
        ----------
        config : LcdConfig
        network : Path, optional
            ONNX file of a target that has one; the one beside its decision if not given.

        """
        if network is None:
            network = decision_path(config.model, config.target).with_suffix('.onnx')
        return cls(make_target(config.target, network), make_defences(config))

    def view(self, graph: MultiTierGraph, same_nodes: View | None = None) -> View:
        """Return a graph as received, prepared, with what is derived from it."""
        return View(self.prepare(graph), same_nodes)

    def prepare(self, graph: MultiTierGraph) -> MultiTierGraph:
        """
        Return the graph that is judged in place of one received; again at no cost.

        Raises
        ------
        GraphError
            It is of another variant than the target needs.

        """
        if self._latest is None or self._latest[0] is not graph:
            check_variant(self.target, graph)
            self._latest = graph, prepared(graph, self.defences)
        return self._latest[1]

    def compare(self, query: View, references: Sequence[View]) -> Compared:
        """Return what scores a query, and others with its nodes, with every reference."""
        nodes = Comparison(query, references)
        for defence in self.defences:
            nodes = defence.compare(nodes)
        return Compared(nodes, self.target.prepare(query, nodes))

    def support(self, query: MultiTierGraph, match: MultiTierGraph) -> float:
        """Return how far a loop between two graphs is borne out, by nodes; 1: it stands."""
        return min((defence.support(query, match) for defence in self.defences), default=1.0)

    def unexplained(self, graph: MultiTierGraph) -> int:
        """Return how many edges of a graph as received defences have no explanation for."""
        return max((defence.unexplained(graph) for defence in self.defences), default=0)

    @property
    def counts_edges(self) -> bool:
        """Whether a defence tells which edges it has no explanation for."""
        return any(type(defence).unexplained is not Defence.unexplained
                   for defence in self.defences)

    @property
    def changes_graphs(self) -> bool:
        """Whether a defence may judge another graph than the one received."""
        return any(type(defence).prepare is not Defence.prepare for defence in self.defences)

    @property
    def may_refuse(self) -> bool:
        """Whether a defence may refuse a loop."""
        return any(type(defence).support is not Defence.support for defence in self.defences)

    def felt(self, pairs: NDArray[np.int64], objects: int) -> NDArray[np.bool_]:
        """Return which flips of (k, 2) pairs, source < target, can make a difference, (k,)."""
        if any(defence.ignores_edges for defence in self.defences):
            return np.zeros(len(pairs), bool)
        if self.changes_graphs and self.target.feels is not Feels.NONE:
            return np.ones(len(pairs), bool)  # what a defence makes of a flip may be anywhere
        return self.target.feels.among(pairs, objects)


def prepared(graph: MultiTierGraph, defences: Sequence[Defence]) -> MultiTierGraph:
    """
    Return what defences make of a graph received.

    Raises
    ------
    ConfigError
        A defence changed the nodes, of which much is kept between flips.

    """
    for defence in defences:
        changed = defence.prepare(graph)
        if changed is not graph and changed.node_digest != graph.node_digest:
            raise ConfigError(f'defence {defence.name} returned a graph with other nodes: '
                              'expected the same, with edges of its own')
        graph = changed
    return graph


class Judge:
    """
    Scores, and what is decided on them.

    Attributes
    ----------
    scoring : Scoring
    decision : Decision
        Trained, of the target, at the operating point of the settings.
    threshold : float
        Probability from which on a loop is declared.

    """

    def __init__(self, config: LcdConfig) -> None:
        self.scoring = Scoring.of(config)
        target = self.scoring.target
        fitted = Decision.load(decision_path(config.model, config.target), target.name,
                               target.channels)
        self.decision = fitted.keeping(config.kept_loops)
        self.threshold = config.threshold

    def verdict(self, logit: float, support: Callable[[], float]) -> tuple[bool, float]:
        """
        Return whether a loop is declared, and its probability.

        Parameters
        ----------
        logit : float
            Log odds by the scores.
        support : callable
            Returns how far the loop is borne out; asked only if one would be declared.

        """
        chance = probability(logit)
        if chance >= self.threshold and self.scoring.may_refuse:
            share = support()
            if share < 1:
                return False, self.threshold * share
        return chance >= self.threshold, chance

    def verdict_logits(self, logits: NDArray[np.float64], support: Callable[[int], float]
                       ) -> NDArray[np.float64]:
        """
        Return the log odds of the probabilities that ``verdict`` gives many graphs.

        Parameters
        ----------
        logits : float64, (k, candidates)
            By the scores, of graphs that share their nodes.
        support : callable
            Returns how far a loop with a candidate is borne out.

        Returns
        -------
        float64, (k,)
            Of each graph's best candidate; at least -700, where nothing bears a loop out.

        """
        # Along few candidates numpy's maximum is slow: turned around it takes a tenth.
        turned = np.ascontiguousarray(logits.T)
        settled: NDArray[np.float64] = turned.max(axis=0)
        if not self.scoring.may_refuse:
            return settled
        best = turned.argmax(axis=0)
        declared = np.array([probability(logit) >= self.threshold for logit in settled.tolist()],
                            bool)
        for candidate in np.unique(best[declared]).tolist():
            share = support(candidate)
            if share < 1:
                settled[declared & (best == candidate)] = max(
                    log_odds(self.threshold * share), -MAX_LOGIT)
        return settled
