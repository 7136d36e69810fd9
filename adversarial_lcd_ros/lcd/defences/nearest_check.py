# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
An edge counts only if nodes may explain it: for a verifier who is not sure of the builder's k.

Edges at objects follow from the nodes and hang on no k: they are made again. Between features,
nobody can tell an edge that was never there from one that was taken away, but an edge between two
that are not even among the K nearest of each other is none of a builder with k <= K.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.edge_rule import joined_pairs
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.defences.base import Defence

# Distances are summed in another order here than in the tree.
_ROUNDING = 1e-9


class NearestCheck(Defence):
    """
    Drops edges between features that are among the K nearest of neither, and counts them.

    Where several features are equally far, all of them are among the nearest: so a clean graph
    loses no edge, whichever of them its builder has joined. With the whole scene as an object no
    two features are joined, and all edges are made again.
    """

    name: ClassVar[str] = 'nearest_check'

    def __init__(self, config: LcdConfig) -> None:
        super().__init__(config)
        # Of the nodes that were seen last: an attack asks about the same ones again and again.
        self._latest: bytes | None = None
        self._at_objects: NDArray[np.int64]
        self._reach: NDArray[np.float64]

    def prepare(self, graph: MultiTierGraph) -> MultiTierGraph:
        """Return the graph with the edges that may be, and all that have to be."""
        key = self._explained(graph)
        edge = np.stack(np.divmod(key, max(graph.node_count, 1)), axis=1).astype(np.uint32)
        return graph.with_edges(edge, graph.length_between(edge))

    def unexplained(self, graph: MultiTierGraph) -> int:
        """Return how many edges cannot be there, or are missing at objects."""
        return len(np.setxor1d(graph.edge_key, self._explained(graph), assume_unique=True))

    def _explained(self, graph: MultiTierGraph) -> NDArray[np.int64]:
        """Return the edges that are judged, as source * n + target, ascending."""
        self._look_at(graph)
        ends = graph.edge[graph.edge[:, 0] >= graph.object_count].astype(np.int64)
        place = graph.position.astype(np.float64)
        distance = np.linalg.norm(place[ends[:, 0]] - place[ends[:, 1]], axis=1)
        near = ends[distance <= self._reach[ends].max(axis=1)]
        # Edges at objects come first, and all in order: sources below those of the others.
        return np.concatenate([self._at_objects, near @ (graph.node_count, 1)])

    def _look_at(self, graph: MultiTierGraph) -> None:
        """Find what hangs on the nodes: edges at objects, and how far the K-th feature is."""
        if self._latest == graph.node_digest:
            return
        first = graph.object_count
        self._at_objects = joined_pairs(graph.position, graph.size, first, 0,
                                        graph.has_scene).astype(np.int64) @ (graph.node_count, 1)
        self._reach = np.full(graph.node_count, -np.inf)
        nearest = min(self.config.nearest_neighbours, graph.node_count - first - 1)
        if nearest > 0 and not graph.has_scene:
            features = graph.position[first:]
            # The feature itself is the first, at no distance.
            far = cKDTree(features).query(features, [nearest + 1])[0][:, 0]
            self._reach[first:] = far * (1 + _ROUNDING)
        self._latest = graph.node_digest
