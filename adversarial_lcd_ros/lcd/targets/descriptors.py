# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Soft descriptor matching without a graph: a control that no edge flip can touch."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.targets.base import Target
from adversarial_lcd_ros.lcd.targets.scores import descriptor_score
from adversarial_lcd_ros.lcd.views import Comparison, Feels, View


class DescriptorsTarget(Target):
    """Nothing but matched features."""

    name: ClassVar[str] = 'descriptors'
    channels: ClassVar[tuple[str, ...]] = ('features',)
    feels: ClassVar[Feels] = Feels.NONE

    def compare(self, query: View, nodes: Comparison) -> NDArray[np.float64]:
        """Return the scores of a query with every reference, shape (r, 1)."""
        return np.stack([descriptor_score(query, nodes)], axis=1)
