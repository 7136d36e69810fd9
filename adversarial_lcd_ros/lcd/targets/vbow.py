# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Visual words without a graph: a control that no edge flip can touch."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.keyframes.database import bow_score
from adversarial_lcd_ros.lcd.targets.base import Target
from adversarial_lcd_ros.lcd.views import Comparison, Feels, View


class VbowTarget(Target):
    """The DBoW L1 score that also retrieves the candidates."""

    name: ClassVar[str] = 'vbow'
    channels: ClassVar[tuple[str, ...]] = ('words',)
    feels: ClassVar[Feels] = Feels.NONE

    def compare(self, query: View, nodes: Comparison) -> NDArray[np.float64]:
        """Return the DBoW L1 score of a query with every reference, shape (r, 1)."""
        return np.array([[bow_score(query.graph, view.graph)] for view in nodes.references])
