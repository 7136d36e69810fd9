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
_OBJECT: Colour = (60, 190, 255)
_FEATURE_EDGE: Colour = (235, 215, 190)
_OBJECT_EDGE: Colour = (130, 210, 255)
_FLIPPED: Colour = (40, 30, 255)
_INK: Colour = (245, 245, 245)
_PAPER: Colour = (34, 28, 24)

_FRAME_STRENGTH = 0.72
_EDGE_STRENGTH = 0.34
_LEGEND_STRENGTH = 0.72
_FONT = cv2.FONT_HERSHEY_SIMPLEX
# Coordinates of lines are handed over in 1/16 pixel.
_SHIFT = 4
# No box, however large, reaches further, pixels; OpenCV takes no number of any size.
_FAR = 1 << 15
_DASH, _GAP = 7.0, 5.0
_PANEL_WIDTH, _PANEL_HEIGHT, _PANEL_GAP = 476, 360, 6
_TEXT_HEIGHT = 30
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
    canvas = _resized(image, round(scale * graph.width), round(scale * graph.height))
    canvas = cv2.convertScaleAbs(canvas, alpha=_FRAME_STRENGTH)
    position = scale * graph.position
    pairs = np.asarray([] if flips is None else flips, np.int64).reshape(-1, 2)
    is_added = graph.has_edges(pairs)
    canvas = _with_edges(canvas, graph, position)
    for x, y in np.rint(position[graph.object_count:]).astype(int).tolist():
        cv2.circle(canvas, (x, y), 2, _FEATURE, -1, cv2.LINE_AA)
    for first, second in position[pairs[~is_added]]:
        _segments(canvas, _dashes(first, second), _FLIPPED, 2)
    _segments(canvas, position[pairs[is_added]], _FLIPPED, 2)
    for x, y in np.rint(position[np.unique(pairs)]).astype(int).tolist():
        cv2.circle(canvas, (x, y), 3, _FLIPPED, -1, cv2.LINE_AA)
    _draw_objects(canvas, graph, classes, scale)
    if legend:
        _draw_legend(canvas, graph, None if flips is None else is_added)
    return np.asarray(canvas, np.uint8)


def draw_attack(query: NDArray[np.uint8], clean: MultiTierGraph, match: NDArray[np.uint8],
                match_graph: MultiTierGraph | None, perturbed: MultiTierGraph,
                caption: str = '') -> NDArray[np.uint8]:
    """
    Return three panels side by side: query, match, attacked graph with what was changed in red.

    Of features that were moved a dashed line shows where from.

    Parameters
    ----------
    query : uint8, (h, w, 3) BGR or (h, w) grey
        The frame that was attacked.
    clean : MultiTierGraph
        Its graph as built.
    match : uint8, (h, w, 3) BGR or (h, w) grey
        The keyframe that the detector matched it with.
    match_graph : MultiTierGraph or None
        Its graph, if it is at hand.
    perturbed : MultiTierGraph
        The graph that the attacker forwarded.
    caption : str
        A line below the panels.

    Returns
    -------
    uint8, (h, 1440, 3)
        1440 x 390 pixels, BGR; 30 rows more with a caption.

    Raises
    ------
    GraphError
        An image and its graph differ in size.

    """
    panels = [('query', _panel(query, clean)), ('match', _panel(match, match_graph)),
              ('attacked graph', _changed_panel(query, clean, perturbed))]
    return _side_by_side(panels, [(caption, _INK)] if caption else [])


def draw_decision(query: NDArray[np.uint8], clean: MultiTierGraph | None, graph: MultiTierGraph,
                  match: NDArray[np.uint8] | None, verdict: str, why: str, *,
                  is_loop: bool) -> NDArray[np.uint8]:
    """
    Return a frame with its graph, the keyframe it was matched with beside it, and the verdict.

    Parameters
    ----------
    query : uint8, (h, w, 3) BGR or (h, w) grey
    clean : MultiTierGraph or None
        The graph as built: what an attacker has changed is drawn red; None where nobody knows.
    graph : MultiTierGraph
        As the detector got it.
    match : uint8, (h, w, 3) BGR or (h, w) grey, or None
        None where there was no candidate, or its picture is not at hand.
    verdict, why : str
        Two lines below; the first in a colour of its own for a loop.
    is_loop : bool

    Returns
    -------
    uint8, (450, 958, 3)
        BGR.

    Raises
    ------
    GraphError
        Image and graph differ in size.

    """
    blank = np.full((_PANEL_HEIGHT, _PANEL_WIDTH, 3), _PAPER, np.uint8)
    panels = [('frame, with the graph that the detector got', _changed_panel(query, clean, graph)),
              ('best matching keyframe: no picture of it', blank) if match is None else
              ('best matching keyframe', _panel(match, None))]
    return _side_by_side(panels, [(verdict, _OBJECT if is_loop else _INK), (why, _INK)])


def _changed_panel(image: NDArray[np.uint8], clean: MultiTierGraph | None,
                   graph: MultiTierGraph) -> NDArray[np.uint8]:
    """Return a panel with a graph, and what it has other than the clean one in red."""
    if clean is None:
        return _panel(image, graph)
    same = clean.node_digest == graph.node_digest
    flips = clean.flips_to(graph) if same else None
    moves = None if same or clean.node_count != graph.node_count else np.stack(
        [clean.position, graph.position], axis=1)
    return _panel(image, graph, flips, moves)


def _side_by_side(panels: Sequence[tuple[str, NDArray[np.uint8]]],
                  lines: Sequence[tuple[str, Colour]]) -> NDArray[np.uint8]:
    """Return panels under their titles, and lines of text below them all."""
    gap = np.full((_TEXT_HEIGHT + _PANEL_HEIGHT, _PANEL_GAP, 3), _PAPER, np.uint8)
    columns = [gap]
    for title, panel in panels:
        columns += [np.vstack([_strip(title, _PANEL_WIDTH), panel]), gap]
    rows = [np.hstack(columns[1:-1])]
    rows += [_strip(text, rows[0].shape[1], colour) for text, colour in lines]
    return np.asarray(np.vstack(rows), np.uint8)


def _resized(image: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """Return a BGR copy of an image in another size."""
    bgr = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image
    shrinks = width < image.shape[1]
    return np.array(cv2.resize(bgr, (width, height),
                               interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR),
                    np.uint8)


def _panel(image: NDArray[np.uint8], graph: MultiTierGraph | None,
           flips: ArrayLike | None = None,
           moves: NDArray[np.float32] | None = None) -> NDArray[np.uint8]:
    """Return a picture that fits a panel, centred on paper."""
    height, width = image.shape[:2]
    scale = min(_PANEL_WIDTH / width, _PANEL_HEIGHT / height)
    if graph is None:
        drawn = _resized(image, round(scale * width), round(scale * height))
    else:
        drawn = draw_graph(image, graph, flips, scale=scale)
        if moves is not None:
            _draw_moves(drawn, scale * moves)
    panel = np.full((_PANEL_HEIGHT, _PANEL_WIDTH, 3), _PAPER, np.uint8)
    top = (_PANEL_HEIGHT - drawn.shape[0]) // 2
    left = (_PANEL_WIDTH - drawn.shape[1]) // 2
    panel[top:top + drawn.shape[0], left:left + drawn.shape[1]] = drawn
    return panel


def _draw_moves(canvas: NDArray[np.uint8], moves: NDArray[np.float32]) -> None:
    """Draw where nodes were moved from and to, (n, 2, 2) pixels; those that stay are left out."""
    for before, after in moves[(moves[:, 0] != moves[:, 1]).any(axis=1)]:
        _segments(canvas, _dashes(before, after), _FLIPPED, 1)
        cv2.circle(canvas, np.rint(after).astype(int).tolist(), 3, _FLIPPED, -1, cv2.LINE_AA)


def _with_edges(canvas: NDArray[np.uint8], graph: MultiTierGraph,
                position: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the canvas with all edges, half transparent."""
    of_object = graph.edge[:, 0] < graph.object_count
    overlay = canvas.copy()
    _segments(overlay, position[graph.edge[~of_object]], _FEATURE_EDGE, 1)
    _segments(overlay, position[graph.edge[of_object]], _OBJECT_EDGE, 1)
    return np.array(cv2.addWeighted(overlay, _EDGE_STRENGTH, canvas, 1 - _EDGE_STRENGTH, 0),
                    np.uint8)


def _segments(canvas: NDArray[np.uint8], ends: NDArray[np.floating], colour: Colour,
              thickness: int) -> None:
    """Draw lines between ends, (k, 2, 2) pixels."""
    points = np.rint(ends * (1 << _SHIFT)).astype(np.int32)
    cv2.polylines(canvas, list(points), False, colour, thickness, cv2.LINE_AA, _SHIFT)


def _dashes(first: NDArray[np.float32], second: NDArray[np.float32]) -> NDArray[np.floating]:
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
        cv2.rectangle(canvas, (left, top), (right, bottom), _OBJECT, 1, cv2.LINE_AA)
    names = [classes[label] if label < len(classes) else f'class {label}'
             for label in graph.label[:count].tolist()]
    if graph.has_scene:
        names.append('scene')
        corners.append(np.rint(scale * graph.position[count]).astype(int).tolist() * 2)
    taken: list[tuple[int, int, int]] = []
    for name, (left, top, _, _) in zip(names, corners, strict=True):
        width = cv2.getTextSize(name, _FONT, 0.4, 1)[0][0] + 6
        # Inside the frame, also where the box begins above it.
        x = max(0, min(left, canvas.shape[1] - width))
        y = max(_TAG_HEIGHT, top)
        while any(abs(y - other) < _TAG_HEIGHT and x < end and start < x + width
                  for start, end, other in taken):
            y += 1
        taken.append((x, x + width, y))
        cv2.rectangle(canvas, (x, y - _TAG_HEIGHT + 1), (x + width - 1, y - 1), _OBJECT, -1)
        cv2.putText(canvas, name, (x + 3, y - 4), _FONT, 0.4, _PAPER, 1, cv2.LINE_AA)


def _draw_legend(canvas: NDArray[np.uint8], graph: MultiTierGraph,
                 is_added: NDArray[np.bool_] | None) -> None:
    """Explain colours, with counts, in a line at the bottom."""
    scene = ' and the scene' if graph.has_scene else ''
    entries = [('box', _OBJECT, f'{graph.found_objects} objects{scene}'),
               ('dot', _FEATURE, f'{graph.node_count - graph.object_count} features'),
               ('line', _FEATURE_EDGE, f'{graph.edge_count} edges')]
    if is_added is not None:
        entries += [('line', _FLIPPED, f'{int(is_added.sum())} added'),
                    ('dashes', _FLIPPED, f'{int((~is_added).sum())} deleted')]
    strip = canvas[-22:]
    strip[:] = cv2.addWeighted(strip, 1 - _LEGEND_STRENGTH, np.full_like(strip, _PAPER),
                               _LEGEND_STRENGTH, 0)
    x, y = 8, len(strip) // 2
    for shape, colour, text in entries:
        _draw_sample(strip, shape, colour, x, y)
        cv2.putText(strip, text, (x + 22, y + 4), _FONT, 0.38, _INK, 1, cv2.LINE_AA)
        x += 22 + cv2.getTextSize(text, _FONT, 0.38, 1)[0][0] + 12


def _draw_sample(strip: NDArray[np.uint8], shape: str, colour: Colour, x: int, y: int) -> None:
    ends = np.array([[x, y], [x + 16, y]], np.float32)
    if shape == 'box':
        cv2.rectangle(strip, (x + 3, y - 5), (x + 15, y + 5), colour, 1, cv2.LINE_AA)
    elif shape == 'dot':
        cv2.circle(strip, (x + 12, y), 3, colour, -1, cv2.LINE_AA)
    else:
        thickness = 2 if colour == _FLIPPED else 1
        _segments(strip, _dashes(*ends) if shape == 'dashes' else ends[None], colour, thickness)


def _strip(text: str, width: int, colour: Colour = _INK) -> NDArray[np.uint8]:
    """Return a strip of paper with a line of text that is made to fit."""
    strip = np.full((_TEXT_HEIGHT, width, 3), _PAPER, np.uint8)
    size = 0.5
    needed = cv2.getTextSize(text, _FONT, size, 1)[0][0]
    size *= min(1.0, (width - 20) / max(needed, 1))
    cv2.putText(strip, text, (10, 20), _FONT, size, colour, 1, cv2.LINE_AA)
    return strip
