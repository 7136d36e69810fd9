"""Soft edge matching alone: the share of edges that recur."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.targets.scores import edge_score
from adversarial_lcd_ros.lcd.views import NodeMatch, View


class EdgesTarget:
    """Nothing but edges between matched features."""

    name: ClassVar[str] = 'edges'
    channels: ClassVar[tuple[str, ...]] = ('edges',)

    def compare(self, query: View, reference: View, match: NodeMatch) -> NDArray[np.float64]:
        """Return the edge score of a pair."""
        return np.array([edge_score(query, reference, match)])
