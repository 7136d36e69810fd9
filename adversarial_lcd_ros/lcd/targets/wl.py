"""SymbioLCD2-style target: soft Weisfeiler-Lehman matching on the unified graph."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.targets.scores import edge_score, neighbourhood_score, object_score
from adversarial_lcd_ros.lcd.views import Comparison, View


class WlTarget:
    """Edges that recur, features in their neighbourhoods, objects with what surrounds them."""

    name: ClassVar[str] = 'wl'
    channels: ClassVar[tuple[str, ...]] = ('edges', 'features', 'objects')

    def compare(self, query: View, nodes: Comparison) -> NDArray[np.float64]:
        """Return the scores of a query with every reference, shape (r, 3)."""
        return np.stack([edge_score(query, nodes), neighbourhood_score(query, nodes),
                         object_score(query, nodes)], axis=1)
