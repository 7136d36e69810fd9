"""Soft edge matching alone: the share of edges that recur."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.targets.scores import edge_score
from adversarial_lcd_ros.lcd.views import Comparison, View


class EdgesTarget:
    """Nothing but edges between matched features."""

    name: ClassVar[str] = 'edges'
    channels: ClassVar[tuple[str, ...]] = ('edges',)

    def compare(self, query: View, nodes: Comparison) -> NDArray[np.float64]:
        """Return the scores of a query with every reference, shape (r, 1)."""
        return np.stack([edge_score(query, nodes)], axis=1)
