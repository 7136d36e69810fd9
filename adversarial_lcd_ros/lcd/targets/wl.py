"""SymbioLCD2-style target: soft Weisfeiler-Lehman matching on the unified graph."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.targets.scores import edge_score, node_score, object_score
from adversarial_lcd_ros.lcd.views import NodeMatch, View


class WlTarget:
    """Edges that recur, features in their neighbourhoods, objects with what surrounds them."""

    name: ClassVar[str] = 'wl'
    channels: ClassVar[tuple[str, ...]] = ('edges', 'features', 'objects')

    def compare(self, query: View, reference: View, match: NodeMatch) -> NDArray[np.float64]:
        """Return the scores (edges, features, objects) of a pair."""
        return np.array([edge_score(query, reference, match),
                         node_score(query, reference, match, iteration=1),
                         object_score(query, reference)])
