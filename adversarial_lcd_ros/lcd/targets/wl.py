# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""SymbioLCD2-style target: soft Weisfeiler-Lehman matching on the unified graph."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.bound import Bound
from adversarial_lcd_ros.lcd.bound_channels import EdgeBound, NeighbourhoodBound, ObjectBound
from adversarial_lcd_ros.lcd.flip_channels import EdgeFlips, NeighbourhoodFlips, ObjectFlips
from adversarial_lcd_ros.lcd.kernels import changed_nodes
from adversarial_lcd_ros.lcd.single_flips import FlipChannel
from adversarial_lcd_ros.lcd.targets.base import Scores, Target
from adversarial_lcd_ros.lcd.targets.scores import NeighbourhoodScore, ObjectScore, edge_score
from adversarial_lcd_ros.lcd.views import Comparison, View


class WlTarget(Target):
    """Edges that recur, features in their neighbourhoods, objects with what surrounds them."""

    name: ClassVar[str] = 'wl'
    channels: ClassVar[tuple[str, ...]] = ('edges', 'features', 'objects')
    flip_channels: ClassVar[Sequence[type[FlipChannel]]] = (
        EdgeFlips, NeighbourhoodFlips, ObjectFlips)
    bounds: ClassVar[Sequence[type[Bound]]] = (EdgeBound, NeighbourhoodBound, ObjectBound)

    def compare(self, query: View, nodes: Comparison) -> NDArray[np.float64]:
        """Return the scores of a query with every reference, shape (r, 3)."""
        return self.prepare(query, nodes)(query)

    def prepare(self, base: View, nodes: Comparison) -> Scores:
        """Return what scores the base and, sooner, others that differ in a few edges."""
        features, objects = NeighbourhoodScore(base, nodes), ObjectScore(base, nodes)

        def scores(query: View) -> NDArray[np.float64]:
            changed = changed_nodes(
                base.graph.edge_key, base.graph.edge_length,
                query.graph.edge_key, query.graph.edge_length, query.graph.node_count)
            rows = query.iterated(changed)
            return np.stack([edge_score(query, nodes), features.of(query, changed, rows),
                             objects.of(query, changed, rows)], axis=1)
        return scores
