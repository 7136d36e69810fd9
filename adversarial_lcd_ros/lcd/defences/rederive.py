# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Edges follow from nodes: made again from them, edges that somebody changed are of no use, or seen.

That ends attacks on edges, where the builder's rule is known and nodes can be trusted. It says
nothing of nodes: a graph whose features were moved, and whose edges fit, passes.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.edge_rule import joined_pairs
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.defences.base import Defence


class RederiveCheck(Defence):
    """Counts edges that nodes do not explain, and judges the graph as it came."""

    name: ClassVar[str] = 'rederive_check'

    def __init__(self, config: LcdConfig) -> None:
        super().__init__(config)
        # Of the nodes that were seen last: an attack asks about the same ones again and again.
        self._latest: tuple[bytes, int, int] | None = None
        self._made: tuple[NDArray[np.uint32], NDArray[np.float32]]

    def unexplained(self, graph: MultiTierGraph) -> int:
        """Return how many edges are there and should not be, or should be and are not."""
        edge = self._edges(graph)[0].astype(np.int64)
        key = edge[:, 0] * graph.node_count + edge[:, 1]
        return len(np.setxor1d(graph.edge_key, key, assume_unique=True))

    def _edges(self, graph: MultiTierGraph) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
        """Return the edges that the nodes explain, and their lengths."""
        nodes = graph.node_digest, graph.width, graph.height
        if self._latest != nodes:
            edge = joined_pairs(graph.position, graph.size, graph.object_count,
                                self.config.rederive_neighbours, graph.has_scene)
            self._latest, self._made = nodes, (edge, graph.length_between(edge))
        return self._made


class Rederive(RederiveCheck):
    """Judges every graph with the edges that its nodes explain, and counts the others."""

    name: ClassVar[str] = 'rederive'
    ignores_edges: ClassVar[bool] = True

    def prepare(self, graph: MultiTierGraph) -> MultiTierGraph:
        """Return the graph with edges made from its nodes."""
        return graph.with_edges(*self._edges(graph))
