# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of graphs over their camera frames; flipped edges are red."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from adversarial_lcd_ros.errors import GraphError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.vision.objects import COCO_CLASSES

Colour = tuple[int, int, int]

# BGR
_FEATURE: Colour = (120, 230, 120)
OBJECT: Colour = (60, 190, 255)
_FEATURE_EDGE: Colour = (235, 215, 190)
_OBJECT_EDGE: Colour = (130, 210, 255)
FLIPPED: Colour = (40, 30, 255)
INK: Colour = (245, 245, 245)
PAPER: Colour = (34, 28, 24)

_FRAME_STRENGTH = 0.72
_EDGE_STRENGTH = 0.34
_LEGEND_STRENGTH = 0.72
FONT = cv2.FONT_HERSHEY_SIMPLEX
# Coordinates of lines are handed over in 1/16 pixel.
_SHIFT = 4
# No box, however large, reaches further, pixels; OpenCV takes no number of any size.
_FAR = 1 << 15
_DASH, _GAP = 7.0, 5.0
_TAG_HEIGHT = 16


def draw_graph(image: NDArray[np.uint8], graph: MultiTierGraph, flips: ArrayLike | None = None, *,
               classes: Sequence[str] = COCO_CLASSES, scale: float = 1.0,
               legend: bool = True) -> NDArray[np.uint8]:
    """
    Return the frame with a graph over it, BGR.

    Objects are boxes with their class, the whole scene is a tag in the middle, where its edges
    meet; features are dots, edges thin and pale. Of the flipped
    pairs, those that are edges of the graph were added (solid red), the others deleted (dashed
    red).

    Parameters
    ----------
    image : uint8, (h, w, 3) BGR or (h, w) grey
        The frame; not changed.
    graph : MultiTierGraph
    flips : int, (k, 2), optional
        Pairs of nodes whose flip has led to the graph.
    classes : sequence of str
        Names of the object classes; a class beyond them is shown by its number.
    scale : float
        Size of the picture over that of the frame.
    legend : bool
        Whether a line at the bottom explains colours and gives counts.

    Returns
    -------
    uint8, (round(scale h), round(scale w), 3)

    Raises
    ------
    GraphError
        The graph is not of an image of this size, or a flip names a node that it has not.

    """
    if image.shape[:2] != (graph.height, graph.width):
        raise GraphError(f'image of {image.shape[1]} x {image.shape[0]} pixels: the graph is of '
                         f'one of {graph.width} x {graph.height}')
    canvas = resized(image, round(scale * graph.width), round(scale * graph.height))
    canvas = cv2.convertScaleAbs(canvas, alpha=_FRAME_STRENGTH)
    position = scale * graph.position
    pairs = np.asarray([] if flips is None else flips, np.int64).reshape(-1, 2)
    is_added = graph.has_edges(pairs)
    canvas = _with_edges(canvas, graph, position)
    for x, y in np.rint(position[graph.object_count:]).astype(int).tolist():
        cv2.circle(canvas, (x, y), 2, _FEATURE, -1, cv2.LINE_AA)
    for first, second in position[pairs[~is_added]]:
        draw_segments(canvas, dashes(first, second), FLIPPED, 2)
    draw_segments(canvas, position[pairs[is_added]], FLIPPED, 2)
    for x, y in np.rint(position[np.unique(pairs)]).astype(int).tolist():
        cv2.circle(canvas, (x, y), 3, FLIPPED, -1, cv2.LINE_AA)
    _draw_objects(canvas, graph, classes, scale)
    if legend:
        _draw_legend(canvas, graph, None if flips is None else is_added)
    return np.asarray(canvas, np.uint8)


def resized(image: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """Return a BGR copy of an image in another size."""
    bgr = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image
    shrinks = width < image.shape[1]
    return np.array(cv2.resize(bgr, (width, height),
                               interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR),
                    np.uint8)


def _with_edges(canvas: NDArray[np.uint8], graph: MultiTierGraph,
                position: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the canvas with all edges, half transparent."""
    of_object = graph.edge[:, 0] < graph.object_count
    overlay = canvas.copy()
    draw_segments(overlay, position[graph.edge[~of_object]], _FEATURE_EDGE, 1)
    draw_segments(overlay, position[graph.edge[of_object]], _OBJECT_EDGE, 1)
    return np.array(cv2.addWeighted(overlay, _EDGE_STRENGTH, canvas, 1 - _EDGE_STRENGTH, 0),
                    np.uint8)


def draw_segments(canvas: NDArray[np.uint8], ends: NDArray[np.floating], colour: Colour,
              thickness: int) -> None:
    """Draw lines between ends, (k, 2, 2) pixels."""
    points = np.rint(ends * (1 << _SHIFT)).astype(np.int32)
    cv2.polylines(canvas, list(points), False, colour, thickness, cv2.LINE_AA, _SHIFT)


def dashes(first: NDArray[np.float32], second: NDArray[np.float32]) -> NDArray[np.floating]:
    """Return the dashes of a line as segments, (k, 2, 2)."""
    length = max(float(np.hypot(*(second - first))), 1e-6)
    start = np.arange(0.0, length, _DASH + _GAP)
    along = np.stack([start, np.minimum(start + _DASH, length)], axis=1)[..., None] / length
    return np.asarray(first + along * (second - first), np.float64)


def _draw_objects(canvas: NDArray[np.uint8], graph: MultiTierGraph, classes: Sequence[str],
                  scale: float) -> None:
    """Draw boxes and, over them, the class names, none on another; the scene without a box."""
    count = graph.found_objects
    half = graph.size[:count] / 2
    corners = np.clip(np.rint(scale * np.hstack([
        graph.position[:count] - half, graph.position[:count] + half])), -_FAR, _FAR
        ).astype(int).tolist()
    for left, top, right, bottom in corners:
        cv2.rectangle(canvas, (left, top), (right, bottom), OBJECT, 1, cv2.LINE_AA)
    names = [classes[label] if label < len(classes) else f'class {label}'
             for label in graph.label[:count].tolist()]
    if graph.has_scene:
        names.append('scene')
        corners.append(np.rint(scale * graph.position[count]).astype(int).tolist() * 2)
    taken: list[tuple[int, int, int]] = []
    for name, (left, top, _, _) in zip(names, corners, strict=True):
        width = cv2.getTextSize(name, FONT, 0.4, 1)[0][0] + 6
        # Inside the frame, also where the box begins above it.
        x = max(0, min(left, canvas.shape[1] - width))
        y = max(_TAG_HEIGHT, top)
        while any(abs(y - other) < _TAG_HEIGHT and x < end and start < x + width
                  for start, end, other in taken):
            y += 1
        taken.append((x, x + width, y))
        cv2.rectangle(canvas, (x, y - _TAG_HEIGHT + 1), (x + width - 1, y - 1), OBJECT, -1)
        cv2.putText(canvas, name, (x + 3, y - 4), FONT, 0.4, PAPER, 1, cv2.LINE_AA)


def _draw_legend(canvas: NDArray[np.uint8], graph: MultiTierGraph,
                 is_added: NDArray[np.bool_] | None) -> None:
    """Explain colours, with counts, in a line at the bottom."""
    scene = ' and the scene' if graph.has_scene else ''
    entries = [('box', OBJECT, f'{graph.found_objects} objects{scene}'),
               ('dot', _FEATURE, f'{graph.node_count - graph.object_count} features'),
               ('line', _FEATURE_EDGE, f'{graph.edge_count} edges')]
    if is_added is not None:
        entries += [('line', FLIPPED, f'{int(is_added.sum())} added'),
                    ('dashes', FLIPPED, f'{int((~is_added).sum())} deleted')]
    strip = canvas[-22:]
    strip[:] = cv2.addWeighted(strip, 1 - _LEGEND_STRENGTH, np.full_like(strip, PAPER),
                               _LEGEND_STRENGTH, 0)
    x, y = 8, len(strip) // 2
    for shape, colour, text in entries:
        _draw_sample(strip, shape, colour, x, y)
        cv2.putText(strip, text, (x + 22, y + 4), FONT, 0.38, INK, 1, cv2.LINE_AA)
        x += 22 + cv2.getTextSize(text, FONT, 0.38, 1)[0][0] + 12


def _draw_sample(strip: NDArray[np.uint8], shape: str, colour: Colour, x: int, y: int) -> None:
    ends = np.array([[x, y], [x + 16, y]], np.float32)
    if shape == 'box':
        cv2.rectangle(strip, (x + 3, y - 5), (x + 15, y + 5), colour, 1, cv2.LINE_AA)
    elif shape == 'dot':
        cv2.circle(strip, (x + 12, y), 3, colour, -1, cv2.LINE_AA)
    else:
        thickness = 2 if colour == FLIPPED else 1
        draw_segments(strip, dashes(*ends) if shape == 'dashes' else ends[None], colour, thickness)
