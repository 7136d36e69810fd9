# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What a search for flips works on, and what it comes back with.

The paper's search and our own are of one kind and share budgets, oracle, deadline and report, so
that their figures compare.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
import math
from typing import ClassVar

import numpy as np

from adversarial_lcd_ros.attack.oracle import Oracle, answer_logit, edit_budget
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.shown import Shown


@dataclass(frozen=True)
class Budget:
    """
    What may be changed in a graph.

    Attributes
    ----------
    edits : int
        Edges flipped.
    nodes : int
        Nodes changed, and their edges with them.

    """

    edits: int = 0
    nodes: int = 0


COMMON_SETTINGS = ('mode', 'search', 'ratio', 'queries_per_edit', 'max_queries', 'deadline_ms',
                   'edits', 'seed')


@dataclass
class Hunt:
    """
    The best graph found so far, and the oracle that judges others.

    Attributes
    ----------
    clean, best : MultiTierGraph
    edit_budget : int
        Most pairs in which ``best`` may differ from ``clean``.
    oracle : Oracle
    is_loop : bool
        The detector's answer to the clean graph: y of Eq. (1).
    loss : float
        Attack loss of ``best``: -logit where the clean graph was a loop, else +logit.
    hopeless : bool
        The detector had nothing to compare with: no flip can change its mind.
    succeeded : bool
        The detector changes its decision on ``best``.
    trace : list of float
        Largest loss after each query.
    kept : (MultiTierGraph, float, bool), optional
        What ``keep`` was last given, in one piece: for another thread.
    node_budget : int
        Most nodes in which ``best`` may differ from ``clean``.

    """

    clean: MultiTierGraph
    best: MultiTierGraph
    edit_budget: int
    oracle: Oracle
    is_loop: bool
    loss: float
    hopeless: bool = False
    succeeded: bool = False
    trace: list[float] = field(default_factory=list)
    kept: tuple[MultiTierGraph, float, bool] | None = None
    node_budget: int = 0

    @classmethod
    def begin(cls, graph: MultiTierGraph, edit_budget: int, oracle: Oracle,
              node_budget: int = 0) -> Hunt:
        """Spend the first query on the clean graph."""
        answer = oracle(graph)
        logit = answer_logit(answer)
        return cls(graph, graph, edit_budget, oracle, answer.is_loop,
                   -logit if answer.is_loop else logit,
                   hopeless=answer.is_soft and answer.log_odds == -math.inf,
                   node_budget=node_budget)

    @property
    def over(self) -> str:
        """Why the hunt ends; empty while it goes on."""
        if self.hopeless:
            return 'nothing to compare with'
        return 'decision changed' if self.succeeded else self.oracle.exhausted

    def ask(self, graph: MultiTierGraph) -> tuple[float, bool]:
        """Spend a query; return a graph's attack loss, and whether it changes the decision."""
        answer = self.oracle(graph)
        logit = answer_logit(answer)
        loss = -logit if self.is_loop else logit
        self.trace.append(max(loss, self.trace[-1] if self.trace else self.loss))
        return loss, answer.is_loop != self.is_loop

    def keep(self, graph: MultiTierGraph, loss: float, succeeded: bool) -> None:
        """Make a graph the best so far."""
        self.best, self.loss, self.succeeded = self.kept = graph, loss, succeeded


class Search(Shown, ABC):
    """
    A way to look for flips; one of your own is a subclass that is made from an AttackConfig.

    Attributes
    ----------
    own_settings : tuple of str
        Settings of AttackConfig that count for this search, beside those of every attack
        (``COMMON_SETTINGS``). Reports name no others.
    query_share : float
        About which share of its queries it spends one by one. It only tells how long an
        evaluation may take.
    changes_nodes : bool
        It changes nodes, within a ``budget`` of them; else edges alone. The leaderboard of the
        defences counts the two apart.

    """

    own_settings: ClassVar[tuple[str, ...]] = ()
    query_share: ClassVar[float] = 1.0
    changes_nodes: ClassVar[bool] = False

    def __init__(self, config: AttackConfig) -> None:
        self.config = config

    def budget(self, graph: MultiTierGraph) -> Budget:
        """Return what may be changed in a graph; by default floor(r n^2) edges (Sec. 3.3)."""
        return Budget(edit_budget(graph.node_count, self.config.ratio))

    @abstractmethod
    def hunt(self, hunt: Hunt, rng: np.random.Generator) -> str:
        """Improve ``hunt.best``; return why it ended."""

    def guess(self, graph: MultiTierGraph, edit_budget: int,
              rng: np.random.Generator) -> MultiTierGraph:
        """Return a perturbed graph without a query (mode surrogate); by default the same."""
        return graph

    def observe(self, graph: MultiTierGraph) -> None:
        """Remember a graph as it was forwarded; called with each. By default nothing."""
