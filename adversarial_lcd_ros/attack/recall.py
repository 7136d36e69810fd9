"""Our own search: replay, or erase, what earlier graphs have in common with this one."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.memory import Memory
from adversarial_lcd_ros.attack.outcome import Hunt
from adversarial_lcd_ros.attack.surrogate_data import SurrogateData
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.graph import MultiTierGraph


class Recall:
    """
    A man in the middle has seen the map: every keyframe passed him.

    To invent a loop he picks a graph from the past that looks most alike and adds the edges that
    like-looking features have there. To suppress one he deletes the edges that recur in the
    graphs from the past which look most alike. Many flips go into one query, so a handful of
    queries, one for each graph recalled, does what the paper's search spends forty an edit on.
    """

    def __init__(self, config: AttackConfig, data: Callable[[], SurrogateData]) -> None:
        self._edits = config.edits
        self._memory = Memory()
        self._bound = data().loop_bound() if config.mode == 'surrogate' else 0.0

    def observe(self, graph: MultiTierGraph) -> None:
        """Remember a clean graph."""
        self._memory.add(graph)

    def hunt(self, hunt: Hunt, rng: np.random.Generator) -> str:
        """Query one plan after another; return why it ended."""
        for plan in self._plans(hunt.clean, hunt.edit_budget, hunt.is_loop):
            if hunt.over:
                break
            graph = hunt.clean.flip(plan)
            loss, succeeded = hunt.ask(graph)
            if succeeded or loss > hunt.loss:
                hunt.keep(graph, loss, succeeded)
        return hunt.over or 'no graph left to recall'

    def guess(self, graph: MultiTierGraph, edit_budget: int,
              rng: np.random.Generator) -> MultiTierGraph:
        """Follow the first plan; whether this is a loop is told by the words seen before."""
        similar = self._memory.similar(graph, 1)
        likely_loop = bool(similar) and similar[0][1] >= self._bound
        plan = next(self._plans(graph, edit_budget, likely_loop), None)
        return graph if plan is None else graph.flip(plan)

    def _plans(self, graph: MultiTierGraph, edit_budget: int,
               is_loop: bool) -> Iterator[NDArray[np.int64]]:
        """Yield sets of flips, shape (k, 2), the most promising first."""
        recalled = [index for index, _ in self._memory.similar(graph)]
        if is_loop and self._edits != 'add':
            everything = sorted({near for index in recalled
                                 for near in self._memory.neighbours(index)})
            plan, _ = self._flips(graph, everything, edit_budget, delete=True)
            if len(plan):
                yield plan
        if not is_loop and self._edits != 'delete':
            found = [self._flips(graph, self._memory.neighbours(index), edit_budget, delete=False)
                     for index in recalled]
            for plan, _ in sorted(found, key=lambda entry: -entry[1]):
                if len(plan):
                    yield plan

    def _flips(self, graph: MultiTierGraph, past: list[int] | range, edit_budget: int, *,
               delete: bool) -> tuple[NDArray[np.int64], float]:
        """
        Return the flips that change most of what a graph shares with past ones.

        Returns
        -------
        pairs : int64, (k, 2)
        shared : float
            Summed weight of common edges once the flips are made.

        """
        echoes = [self._memory.echo(graph, index) for index in past]
        if not echoes:
            return np.zeros((0, 2), np.int64), 0.0
        pairs = np.concatenate([echo.pairs for echo in echoes])
        pairs, place = np.unique(pairs, axis=0, return_inverse=True)
        weight = np.bincount(place.ravel(), np.concatenate([echo.weight for echo in echoes]),
                             minlength=len(pairs))
        present = graph.has_edges(pairs)
        order = np.argsort(-weight, kind='stable')
        chosen = order[present[order] == delete][:edit_budget]
        shared = weight[present].sum() + (-1 if delete else 1) * weight[chosen].sum()
        return pairs[chosen], float(shared)
