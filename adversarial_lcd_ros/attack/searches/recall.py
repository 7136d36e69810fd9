# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Our own search: replay, or erase, what earlier graphs have in common with this one.

Without queries it only invents: few loops can be suppressed within the budget.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.forging import among_nearest
from adversarial_lcd_ros.attack.memory import Echo, Memory
from adversarial_lcd_ros.attack.search import Hunt, Search
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.graph import MultiTierGraph

FAMILIES = ('features', 'objects')
LEARNING_RATE = 0.1
RESERVE = 2
RECALLED = 10
RECALLED_UNASKED = 5


@dataclass(frozen=True)
class _Plan:
    """
    Flips of one family of edges, the most promising first, more than the budget may allow.

    Attributes
    ----------
    family : str
        features: edges between features; objects: edges that end at an object.
    pairs : int64, (k, 2)
    shared : float
        Summed weight of what the graphs have in common once the budget is spent on the first.

    """

    family: str
    pairs: NDArray[np.int64]
    shared: float


class Recall(Search):
    """
    A man in the middle has seen the map: every keyframe passed him.

    To invent a loop he picks a graph from the past that looks most alike and adds the edges that
    like-looking nodes have there. To suppress one he deletes the edges that recur in the graphs
    from the past which look most alike. Many flips go into one query, one for each graph recalled
    and family of edges. Which family a detector looks at shows in its answers, and carries over
    to the next frame. If no plan changes the decision, each flip of the best plan, and of others
    in reserve, is weighed by one query.
    """

    name: ClassVar[str] = 'recall'
    rank: ClassVar[int] = 100
    colour: ClassVar[str] = '#c0392b'
    own_settings: ClassVar[tuple[str, ...]] = ('echoes', 'lengths', 'nearest')
    # Flips are grouped, many to a query.
    query_share: ClassVar[float] = 0.15

    def __init__(self, config: AttackConfig) -> None:
        super().__init__(config)
        self._edits = config.edits
        self._families = FAMILIES if config.echoes == 'both' else (config.echoes,)
        self._memory = Memory()
        self._gain: dict[tuple[bool, str], float] = {}

    def observe(self, graph: MultiTierGraph) -> None:
        """Remember a graph as it was forwarded."""
        self._memory.add(graph)

    def hunt(self, hunt: Hunt, rng: np.random.Generator) -> str:
        """Query one plan after another, then single flips; return why it ended."""
        if hunt.hopeless:
            self._memory.too_young(hunt.clean.stamp_ns)
        before = hunt.loss
        tried: list[tuple[float, _Plan]] = []
        for plan in self._plans(hunt.clean, hunt.edit_budget, hunt.is_loop):
            if hunt.over:
                break
            tried.append((_ask(hunt, plan.pairs[:hunt.edit_budget]), plan))
        self._learn(hunt.is_loop, before, tried)
        if not hunt.over and hunt.loss > before:
            _refine(hunt, [plan for _, plan in sorted(tried, key=lambda entry: -entry[0])])
        return hunt.over or ('no better flip known' if tried else 'no graph left to recall')

    def guess(self, graph: MultiTierGraph, edit_budget: int,
              rng: np.random.Generator) -> MultiTierGraph:
        """
        Follow the first plan that invents.

        Unasked, he cannot tell a loop from a new place; but few loops can be suppressed at all,
        and one that is made clearer is none the worse for him.
        """
        plan = next(iter(self._plans(graph, edit_budget, is_loop=False,
                                     recalled=RECALLED_UNASKED)), None)
        return graph if plan is None else graph.flip(plan.pairs[:edit_budget])

    def _learn(self, is_loop: bool, before: float, tried: list[tuple[float, _Plan]]) -> None:
        """Remember what each family gained at best on this frame."""
        for family in {plan.family for _, plan in tried}:
            gain = max(loss for loss, plan in tried if plan.family == family) - before
            known = self._gain.get((is_loop, family), 0.0)
            self._gain[is_loop, family] = known + LEARNING_RATE * (gain - known)

    def _plans(self, graph: MultiTierGraph, edit_budget: int, is_loop: bool,
               recalled: int = RECALLED) -> list[_Plan]:
        """Return sets of flips, the most promising first."""
        if self._edits == ('add' if is_loop else 'delete') or (is_loop and self.config.nearest):
            return []
        windows = [self._memory.neighbours(index)
                   for index, _ in self._memory.similar(graph, recalled)]
        echoes = {index: self._unseen(graph, self._memory.echo(graph, index))
                  for near in windows for index in near}
        # A loop has to be broken with all graphs at once, and made with one.
        together = ([list(echoes.values())] if is_loop
                    else [[echoes[index] for index in near] for near in windows])
        plans = [_plan(graph, echo, edit_budget, family, delete=is_loop)
                 for family in self._families for echo in together if echo]
        return sorted((plan for plan in plans if len(plan.pairs)),
                      key=lambda plan: (-self._gain.get((is_loop, plan.family), 0.0),
                                        FAMILIES.index(plan.family), -plan.shared))

    def _unseen(self, graph: MultiTierGraph, echo: Echo) -> Echo:
        """Return the echoes that pass what the detector may look at, as far as he expects it."""
        if self.config.lengths:
            echo = echo.among(echo.same_length)
        if self.config.nearest:
            echo = echo.among(among_nearest(graph, echo.pairs, self.config.nearest))
        return echo


def _plan(graph: MultiTierGraph, echoes: list[Echo], edit_budget: int, family: str, *,
          delete: bool) -> _Plan:
    """Return the flips of a family that change most of what a graph shares with past ones."""
    rows = [echo.at_object == (family == 'objects') for echo in echoes]
    pairs = np.concatenate([echo.pairs[row] for echo, row in zip(echoes, rows, strict=True)])
    each = np.concatenate([echo.weight[row] for echo, row in zip(echoes, rows, strict=True)])
    # One number a pair: rows are sorted ten times slower than numbers.
    number, place = np.unique(pairs @ (graph.node_count, 1), return_inverse=True)
    pairs = np.stack(np.divmod(number, graph.node_count), axis=1)
    weight = np.bincount(place, each, minlength=len(pairs))
    present = graph.has_edges(pairs)
    order = np.argsort(-weight, kind='stable')
    order = order[present[order] == delete]
    change = weight[order[:edit_budget]].sum()
    return _Plan(family, pairs[order],
                 float(weight[present].sum() + (-change if delete else change)))


def _ask(hunt: Hunt, pairs: NDArray[np.int64]) -> float:
    """Query the clean graph with some pairs flipped, keep it if it is better; return its loss."""
    graph = hunt.clean.flip(pairs)
    loss, succeeded = hunt.ask(graph)
    if succeeded or loss > hunt.loss:
        hunt.keep(graph, loss, succeeded)
    return loss


def _refine(hunt: Hunt, plans: list[_Plan]) -> None:
    """
    Replace flips of the first plan by better ones.

    What a flip of the plan is worth shows when it is left out; what one in reserve is worth, when
    it takes the place of the least of the plan. That needs soft answers: hard ones do not show a
    plan to be better than the clean graph.
    """
    budget = hunt.edit_budget
    size = min(budget, len(plans[0].pairs))
    ranked = np.concatenate([plan.pairs for plan in plans])
    _, first = np.unique(ranked, axis=0, return_index=True)
    ranked = ranked[np.sort(first)][:size + RESERVE * budget]
    full, worth = hunt.loss, np.zeros(len(ranked))
    rest, without = ranked[:size], full
    for flip in range(len(ranked)):
        if flip == size and size == budget:
            least = int(worth[:size].argmin())
            rest, without = np.delete(ranked[:size], least, axis=0), full - worth[least]
        if hunt.over:
            return
        if flip < size:
            worth[flip] = full - _ask(hunt, np.delete(ranked[:size], flip, axis=0))
        else:
            worth[flip] = _ask(hunt, np.concatenate([rest, ranked[flip:flip + 1]])) - without
    best = np.argsort(-worth, kind='stable')[:budget]
    if not hunt.over:
        _ask(hunt, ranked[best[worth[best] > 0]])
