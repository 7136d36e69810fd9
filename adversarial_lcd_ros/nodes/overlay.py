"""A graph drawn over its camera frame."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.graph import MultiTierGraph

_FEATURE_EDGE = (200, 160, 60)
_OBJECT_EDGE = (60, 200, 240)
_FEATURE = (80, 220, 80)
_OBJECT = (40, 120, 250)


def draw_graph(image: NDArray[np.uint8], graph: MultiTierGraph) -> NDArray[np.uint8]:
    """
    Return the frame with objects as boxes, features as dots, and edges, BGR.

    Parameters
    ----------
    image : uint8, (height, width, 3) BGR or (height, width) grey
        Not changed.
    graph : MultiTierGraph

    """
    canvas = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image.copy()
    place = np.rint(graph.position).astype(np.int32)
    touches_object = (graph.edge < graph.object_count).any(axis=1)
    for chosen, colour in ((~touches_object, _FEATURE_EDGE), (touches_object, _OBJECT_EDGE)):
        cv2.polylines(canvas, list(place[graph.edge[chosen]]), False, colour, 1, cv2.LINE_AA)
    for x, y in place[graph.object_count:]:
        cv2.circle(canvas, (int(x), int(y)), 2, _FEATURE, -1)
    for centre, size in zip(graph.position[:graph.object_count], graph.size, strict=False):
        low = np.rint(centre - size / 2).astype(int)
        high = np.rint(centre + size / 2).astype(int)
        cv2.rectangle(canvas, (int(low[0]), int(low[1])), (int(high[0]), int(high[1])), _OBJECT, 2)
    return np.asarray(canvas)
