# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Panels side by side: a frame with its graph, what it was matched with, what was changed."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.vision.draw import (
    FLIPPED,
    FONT,
    INK,
    OBJECT,
    PAPER,
    Colour,
    dashes,
    draw_graph,
    draw_segments,
    resized,
)

_PANEL_WIDTH, _PANEL_HEIGHT, _PANEL_GAP = 476, 360, 6
_TEXT_HEIGHT = 30


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
    return _side_by_side(panels, [(caption, INK)] if caption else [])


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
    blank = np.full((_PANEL_HEIGHT, _PANEL_WIDTH, 3), PAPER, np.uint8)
    panels = [('frame, with the graph that the detector got', _changed_panel(query, clean, graph)),
              ('best matching keyframe: no picture of it', blank) if match is None else
              ('best matching keyframe', _panel(match, None))]
    return _side_by_side(panels, [(verdict, OBJECT if is_loop else INK), (why, INK)])


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
    gap = np.full((_TEXT_HEIGHT + _PANEL_HEIGHT, _PANEL_GAP, 3), PAPER, np.uint8)
    columns = [gap]
    for title, panel in panels:
        columns += [np.vstack([_strip(title, _PANEL_WIDTH), panel]), gap]
    rows = [np.hstack(columns[1:-1])]
    rows += [_strip(text, rows[0].shape[1], colour) for text, colour in lines]
    return np.asarray(np.vstack(rows), np.uint8)


def _panel(image: NDArray[np.uint8], graph: MultiTierGraph | None,
           flips: ArrayLike | None = None,
           moves: NDArray[np.float32] | None = None) -> NDArray[np.uint8]:
    """Return a picture that fits a panel, centred on paper."""
    height, width = image.shape[:2]
    scale = min(_PANEL_WIDTH / width, _PANEL_HEIGHT / height)
    if graph is None:
        drawn = resized(image, round(scale * width), round(scale * height))
    else:
        drawn = draw_graph(image, graph, flips, scale=scale)
        if moves is not None:
            _draw_moves(drawn, scale * moves)
    panel = np.full((_PANEL_HEIGHT, _PANEL_WIDTH, 3), PAPER, np.uint8)
    top = (_PANEL_HEIGHT - drawn.shape[0]) // 2
    left = (_PANEL_WIDTH - drawn.shape[1]) // 2
    panel[top:top + drawn.shape[0], left:left + drawn.shape[1]] = drawn
    return panel


def _draw_moves(canvas: NDArray[np.uint8], moves: NDArray[np.float32]) -> None:
    """Draw where nodes were moved from and to, (n, 2, 2) pixels; those that stay are left out."""
    for before, after in moves[(moves[:, 0] != moves[:, 1]).any(axis=1)]:
        draw_segments(canvas, dashes(before, after), FLIPPED, 1)
        cv2.circle(canvas, np.rint(after).astype(int).tolist(), 3, FLIPPED, -1, cv2.LINE_AA)


def _strip(text: str, width: int, colour: Colour = INK) -> NDArray[np.uint8]:
    """Return a strip of paper with a line of text that is made to fit."""
    strip = np.full((_TEXT_HEIGHT, width, 3), PAPER, np.uint8)
    size = 0.5
    needed = cv2.getTextSize(text, FONT, size, 1)[0][0]
    size *= min(1.0, (width - 20) / max(needed, 1))
    cv2.putText(strip, text, (10, 20), FONT, size, colour, 1, cv2.LINE_AA)
    return strip
