# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Soft edge matching alone: the share of edges that recur."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.bound import Bound
from adversarial_lcd_ros.lcd.bound_channels import EdgeBound
from adversarial_lcd_ros.lcd.flip_channels import EdgeFlips
from adversarial_lcd_ros.lcd.single_flips import FlipChannel
from adversarial_lcd_ros.lcd.targets.base import Target
from adversarial_lcd_ros.lcd.targets.scores import edge_score
from adversarial_lcd_ros.lcd.views import Comparison, View


class EdgesTarget(Target):
    """Nothing but edges between matched features."""

    name: ClassVar[str] = 'edges'
    channels: ClassVar[tuple[str, ...]] = ('edges',)
    flip_channels: ClassVar[Sequence[type[FlipChannel]]] = (EdgeFlips,)
    bounds: ClassVar[Sequence[type[Bound]]] = (EdgeBound,)

    def compare(self, query: View, nodes: Comparison) -> NDArray[np.float64]:
        """Return the scores of a query with every reference, shape (r, 1)."""
        return np.stack([edge_score(query, nodes)], axis=1)
