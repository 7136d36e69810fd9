# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A graph of the past in place of the present one.

Beyond the paper: nothing in such a graph is out of place but its time. Whoever makes edges again
from nodes, compares lengths or checks geometry finds it whole; a seal that covers the stamp does
not.
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from adversarial_lcd_ros.attack.memory import Memory
from adversarial_lcd_ros.attack.search import Budget, Hunt, Search
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.graph import MultiTierGraph

RECALLED = 10


class Replay(Search):
    """
    Sends a payload of the past under the present stamp and sequence number.

    To invent a loop: the graphs old enough to be compared with that share most visual words with
    the present one. To suppress one: graphs too young to be compared with, spread over that
    time, the oldest first, since least else may be known of them. One query each.
    """

    name: ClassVar[str] = 'replay'
    rank: ClassVar[int] = 120
    colour: ClassVar[str] = '#b9770e'
    query_share: ClassVar[float] = 0.01
    changes_nodes: ClassVar[bool] = True

    def __init__(self, config: AttackConfig) -> None:
        super().__init__(config)
        self._memory = Memory()
        self._largest = 0

    def budget(self, graph: MultiTierGraph) -> Budget:
        """Return the nodes of a whole graph, the largest that there is: all may be others."""
        return Budget(nodes=max(graph.node_count, self._largest))

    def observe(self, graph: MultiTierGraph) -> None:
        """Remember a graph as it was forwarded."""
        self._memory.add(graph)
        self._largest = max(self._largest, graph.node_count)

    def hunt(self, hunt: Hunt, rng: np.random.Generator) -> str:
        """Query one graph of the past after another; return why it ended."""
        if hunt.hopeless:
            self._memory.too_young(hunt.clean.stamp_ns)
        graphs = (self._memory.young(hunt.clean, RECALLED) if hunt.is_loop
                  else self._old(hunt.clean))
        for past in graphs:
            if hunt.over:
                break
            graph = _under_stamp_of(hunt.clean, past)
            loss, succeeded = hunt.ask(graph)
            if succeeded or loss > hunt.loss:
                hunt.keep(graph, loss, succeeded)
        return hunt.over or ('no better graph known' if graphs else 'no graph left to recall')

    def guess(self, graph: MultiTierGraph, edit_budget: int,
              rng: np.random.Generator) -> MultiTierGraph:
        """Send the most alike graph of the past: unasked, he invents."""
        old = self._old(graph)
        return _under_stamp_of(graph, old[0]) if old else graph

    def _old(self, graph: MultiTierGraph) -> list[MultiTierGraph]:
        return [self._memory[index] for index, _ in self._memory.similar(graph, RECALLED)]


def _under_stamp_of(present: MultiTierGraph, past: MultiTierGraph) -> MultiTierGraph:
    """Return a graph of the past with everything that says when it was made."""
    return replace(past, stamp_ns=present.stamp_ns, frame_id=present.frame_id,
                   sequence=present.sequence, session=present.session)
