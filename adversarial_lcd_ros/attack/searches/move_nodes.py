# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Features moved to where they lie in a graph of the past; edges follow from them.

Beyond the paper, whose attacker changes edges: this one passes whoever makes edges again from
nodes. What an edge budget is to the paper's, ``nodes_moved`` is to him.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.deadline import check_time
from adversarial_lcd_ros.attack.forging import neighbours_of, with_positions
from adversarial_lcd_ros.attack.memory import Matched, Memory
from adversarial_lcd_ros.attack.search import Budget, Hunt, Search
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.graph import MultiTierGraph

RECALLED = 10
# Orders in which the moved features of a loop change places.
SHUFFLES = 5
# Spread: one in so many of the moved features is at the rim.
RIM_SHARE = 4


class MoveNodes(Search):
    """
    Gives matched features the positions that they have in a recalled graph of the past.

    To invent a loop, features take the places of their matches in one graph; which of them, if
    the budget is less than all: those that keep most edges of the past among themselves. To
    suppress one, the features that most edges recur between change places with each other. One
    query for each graph recalled, or order. Objects stay.
    """

    name: ClassVar[str] = 'move_nodes'
    rank: ClassVar[int] = 110
    colour: ClassVar[str] = '#7d3c98'
    own_settings: ClassVar[tuple[str, ...]] = ('nodes_moved', 'moved')
    query_share: ClassVar[float] = 0.01
    changes_nodes: ClassVar[bool] = True

    def __init__(self, config: AttackConfig) -> None:
        super().__init__(config)
        self._memory = Memory()

    def budget(self, graph: MultiTierGraph) -> Budget:
        """Return how many nodes may be moved; no edge is flipped beside."""
        return Budget(nodes=min(self.config.nodes_moved, graph.node_count))

    def observe(self, graph: MultiTierGraph) -> None:
        """Remember a graph as it was forwarded."""
        self._memory.add(graph)

    def hunt(self, hunt: Hunt, rng: np.random.Generator) -> str:
        """Query one forged graph after another; return why it ended."""
        if hunt.hopeless:
            self._memory.too_young(hunt.clean.stamp_ns)
        forge = self._scattered if hunt.is_loop else self._gathered
        tried = False
        for position in forge(hunt.clean, hunt.node_budget, rng):
            if hunt.over:
                break
            tried = True
            graph = with_positions(hunt.clean, position, neighbours_of(hunt.clean))
            loss, succeeded = hunt.ask(graph)
            if succeeded or loss > hunt.loss:
                hunt.keep(graph, loss, succeeded)
        return hunt.over or ('no better place known' if tried else 'no graph left to recall')

    def guess(self, graph: MultiTierGraph, edit_budget: int,
              rng: np.random.Generator) -> MultiTierGraph:
        """Move to where the most alike graph has them: unasked, he invents."""
        nodes = self.budget(graph).nodes
        position = next(iter(self._gathered(graph, nodes, rng)), None)
        return graph if position is None else with_positions(graph, position, neighbours_of(graph))

    def _recalled(self, graph: MultiTierGraph) -> list[Matched]:
        """Return matches with the graphs that look most alike, in pictures of the same size."""
        matched = [self._memory.matched(graph, index)
                   for index, _ in self._memory.similar(graph, RECALLED)]
        return [each for each in matched if len(each.node) and
                (each.past.width, each.past.height) == (graph.width, graph.height)]

    def _gathered(self, graph: MultiTierGraph, budget: int, rng: np.random.Generator
                  ) -> list[NDArray[np.float32]]:
        """Return positions that repeat a graph of the past, one set for each recalled."""
        found = []
        for each in self._recalled(graph):
            check_time()
            joined = _joined(each)
            if self.config.moved == 'spread':
                # Those at the rim hold the hull: they are worth more than any edge.
                joined[_rim(each, budget // RIM_SHARE)] += len(joined)
            kept = _closest_knit(joined, budget)
            position = graph.position.copy()
            position[each.node[kept]] = each.past.position[each.place[kept]]
            found.append(position)
        return found

    def _scattered(self, graph: MultiTierGraph, budget: int, rng: np.random.Generator
                   ) -> list[NDArray[np.float32]]:
        """Return positions in which the features that recur have changed places."""
        recurs = np.zeros(graph.node_count)
        for each in self._recalled(graph):
            check_time()
            np.add.at(recurs, each.node, _joined(each).sum(axis=1))
        chosen = np.argsort(-recurs, kind='stable')[:min(budget, np.count_nonzero(recurs))]
        if len(chosen) < 2:
            return []
        found = []
        for _ in range(SHUFFLES):
            position = graph.position.copy()
            position[chosen] = position[rng.permutation(chosen)]
            found.append(position)
        return found


def _joined(matched: Matched) -> NDArray[np.float64]:
    """Return which matches an edge of the past joins, by how alike they look, (k, k)."""
    row = np.full(matched.past.node_count, -1, np.int64)
    row[matched.place] = np.arange(len(matched.place))
    ends = row[matched.past.edge.astype(np.int64)]
    ends = ends[(ends >= 0).all(axis=1)]
    joined = np.zeros((len(matched.place), len(matched.place)))
    weight = np.sqrt(matched.alike[ends].prod(axis=1))
    joined[ends[:, 0], ends[:, 1]] = joined[ends[:, 1], ends[:, 0]] = weight
    return joined


def _rim(matched: Matched, count: int) -> NDArray[np.int64]:
    """Return matches far apart in the past graph, each the farthest from those before it."""
    place = matched.past.position[matched.place].astype(np.float64)
    far = np.linalg.norm(place - place.mean(axis=0), axis=1)
    chosen: list[int] = []
    for _ in range(min(count, len(place))):
        chosen.append(int(far.argmax()))
        distance = np.linalg.norm(place - place[chosen[-1]], axis=1)
        far = distance if len(chosen) == 1 else np.minimum(far, distance)
    return np.array(chosen, np.int64)


def _closest_knit(joined: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """
    Return which nodes, at most ``count``, keep most weight among themselves.

    The one that holds least is left out, again and again: the greedy peeling of Charikar (2000)
    for dense subgraphs, within a factor of two of the best where the number is free.
    """
    kept = np.ones(len(joined), bool)
    holds = joined.sum(axis=1)
    for _ in range(len(joined) - count):
        least = int(np.where(kept, holds, np.inf).argmin())
        kept[least] = False
        holds -= joined[least]
    return np.flatnonzero(kept)
