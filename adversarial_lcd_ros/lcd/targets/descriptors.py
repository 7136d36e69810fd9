"""Soft descriptor matching without a graph: a control that no edge flip can touch."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.targets.scores import node_score
from adversarial_lcd_ros.lcd.views import NodeMatch, View


class DescriptorsTarget:
    """Nothing but matched features."""

    name: ClassVar[str] = 'descriptors'
    channels: ClassVar[tuple[str, ...]] = ('features',)

    def compare(self, query: View, reference: View, match: NodeMatch) -> NDArray[np.float64]:
        """Return the soft sum of matched features of a pair."""
        return np.array([node_score(query, reference, match, iteration=0)])
