# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The man in the middle: clean graph in, perturbed graph out (paper, attack-module).

y of the objective (Eq. 1) is the detector's own answer to the clean graph: a man in the middle has
no ground truth. Frames that an attack so repairs are counted (regained, withdrawn) and lower the
decline. The generator of a frame is seeded with (seed, sequence number), so that its result does
not hang on how many random numbers others used. A deadline ends repeatability: time is no input.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
import math
import time

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.deadline import ending_at
from adversarial_lcd_ros.attack.forging import Change, change_between
from adversarial_lcd_ros.attack.oracle import (
    DEADLINE,
    Ask,
    Oracle,
    OracleSilentError,
)
from adversarial_lcd_ros.attack.search import Budget, Hunt
from adversarial_lcd_ros.attack.searches import make_search
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.errors import BudgetError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages.types import AttackReport


@dataclass(frozen=True)
class AttackResult:
    """
    A graph as it is forwarded, and what was spent on it.

    Attributes
    ----------
    clean, perturbed : MultiTierGraph
    status : str
        success: the detector's decision changed; failure: it did not, or nobody asked (zero
        queries); skipped: nothing was tried, ``reason`` says why.
    reason : str
        Why the attack ended, or was skipped.
    edit_budget, query_budget, queries : int
    loss_before, loss_after : float
        Attack loss L of Eq. (1): log odds against the detector's answer to the clean graph.
    trace : tuple of float
        Largest loss after each query.
    node_budget : int

    """

    clean: MultiTierGraph
    perturbed: MultiTierGraph
    status: str
    reason: str = ''
    edit_budget: int = 0
    query_budget: int = 0
    queries: int = 0
    loss_before: float = 0.0
    loss_after: float = 0.0
    trace: tuple[float, ...] = ()
    node_budget: int = 0

    @cached_property
    def flips(self) -> NDArray[np.uint32]:
        """Pairs that differ between two graphs of the same nodes, (k, 2); raises GraphError."""
        return self.clean.flips_to(self.perturbed)

    @cached_property
    def change(self) -> Change:
        """In how much the clean and the forwarded graph differ."""
        return change_between(self.clean, self.perturbed)

    def report(self, duration_s: float = 0.0) -> AttackReport:
        """Return the message that tells whoever measures the attack."""
        return AttackReport(
            self.clean.stamp_ns, self.clean.frame_id, self.clean.sequence, self.status,
            self.reason, self.edit_budget, self.change.edits, self.query_budget, self.queries,
            self.loss_before, self.loss_after, duration_s, self.node_budget, self.change.nodes)


class Attacker:
    """
    Perturbs graphs within a query and an edit budget.

    ``process`` never changes its input, and the same seed, graphs and answers give the same
    bytes. What it knows of the detector is the answers to its queries; what it knows of the map
    is the graphs that it forwarded.
    """

    def __init__(self, config: AttackConfig | None = None) -> None:
        self.config = config or AttackConfig()
        self._under_way: tuple[Hunt, float] | None = None
        self._search = make_search(self.config)

    def process(self, graph: MultiTierGraph, ask: Ask) -> AttackResult:
        """
        Return the graph to forward in place of the given one.

        Parameters
        ----------
        graph : MultiTierGraph
            Clean graph from the builder.
        ask : callable
            Puts a graph before the detector; returns its LcdAnswer, the probability of a loop,
            or whether it is one. May raise OracleSilentError, which ends the attack on this graph.

        """
        result = self.attack(graph, ask)
        self.observe(result.perturbed)
        return result

    def observe(self, graph: MultiTierGraph) -> None:
        """Remember a graph that goes by."""
        self._search.observe(graph)

    def attack(self, graph: MultiTierGraph, ask: Ask,
               deadline_s: float | None = None) -> AttackResult:
        """
        Return what ``process`` returns, without remembering the graph.

        Parameters
        ----------
        graph, ask
            See ``process``.
        deadline_s : float, optional
            ``time.monotonic()`` at which the attack ends; ``deadline_ms`` from now if not given.

        """
        budget = self._search.budget(graph)
        queries = min((budget.edits or budget.nodes) * self.config.queries_per_edit,
                      self.config.max_queries)
        if self.config.mode == 'pass':
            return _skipped(graph, 'mode is pass', budget)
        if not budget.edits and not budget.nodes:
            return _skipped(graph, 'edit budget below one', budget)
        rng = np.random.default_rng((self.config.seed, graph.sequence))
        if deadline_s is None:
            deadline_s = (time.monotonic() + self.config.deadline_ms / 1e3
                          if self.config.deadline_ms else math.inf)
        if self.config.mode != 'surrogate' and queries < 2:
            return _skipped(graph, 'query budget below two', budget, queries)
        with ending_at(deadline_s):
            if self.config.mode == 'surrogate':
                return self._guess(graph, budget, rng)
            return self._hunt(graph, budget, Oracle(ask, queries, deadline_s), rng)

    def _guess(self, graph: MultiTierGraph, budget: Budget, rng: np.random.Generator
               ) -> AttackResult:
        try:
            guess = self._search.guess(graph, budget.edits, rng)
        except BudgetError:
            return _skipped(graph, DEADLINE, budget)
        return AttackResult(graph, guess, 'failure', 'nobody asked', budget.edits,
                            node_budget=budget.nodes)

    def so_far(self, graph: MultiTierGraph) -> AttackResult:
        """
        Return what the attack on a graph, under way in another thread, has come to.

        A search asks for the time only between its steps; whoever cannot wait for the end of
        one takes this.
        """
        hunt, before = self._under_way or (None, 0.0)
        if hunt is None or hunt.clean is not graph:
            return _skipped(graph, DEADLINE, self._search.budget(graph))
        best, loss, succeeded = hunt.kept or (graph, before, False)
        return AttackResult(graph, best, 'success' if succeeded else 'failure', DEADLINE,
                            hunt.edit_budget, hunt.oracle.budget, hunt.oracle.used, before, loss,
                            tuple(hunt.trace), hunt.node_budget)

    def _hunt(self, graph: MultiTierGraph, budget: Budget, oracle: Oracle,
              rng: np.random.Generator) -> AttackResult:
        queries = oracle.budget
        try:
            hunt = Hunt.begin(graph, budget.edits, oracle, budget.nodes)
        except OracleSilentError:
            return _skipped(graph, 'no answer', budget, queries, oracle.used)
        except BudgetError:
            return _skipped(graph, oracle.exhausted, budget, queries)
        before = hunt.loss
        self._under_way = hunt, before
        try:
            reason = self._search.hunt(hunt, rng)
        except OracleSilentError:
            reason = 'no answer'
        except BudgetError:  # the deadline passed since the search looked
            reason = oracle.exhausted
        return AttackResult(graph, hunt.best, 'success' if hunt.succeeded else 'failure', reason,
                            budget.edits, queries, oracle.used, before, hunt.loss,
                            tuple(hunt.trace), budget.nodes)


def _skipped(graph: MultiTierGraph, reason: str, budget: Budget, queries: int = 0,
             used: int = 0) -> AttackResult:
    return AttackResult(graph, graph, 'skipped', reason, budget.edits, queries, used,
                        node_budget=budget.nodes)
