# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the numbers of a detection head cannot be: shapes alone do not tell heads apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.graph import SCENE_CLASS

# Heads of YOLO up to version 7: boxes of a cell, and the cells' sizes, pixels.
_ANCHORS = 3
_STRIDES = ((8, 16, 32), (8, 16, 32, 64), (16, 32))
# Of scores and classes, as networks in half precision compute them.
_TOLERANCE = 0.01
# The largest number of a box whose sides are shares of the image; no object is so few pixels.
_MAX_SHARE = 1.5
_MAX_CLASSES = SCENE_CLASS


def is_grid(rows: int | str, size: tuple[int, int]) -> bool:
    """Tell whether a number of rows is that of all cells of a YOLO up to version 7."""
    width, height = size
    return any(rows == _ANCHORS * sum((width // stride) * (height // stride)
                                      for stride in strides) for strides in _STRIDES)


def wrong_scores(score: NDArray[np.float32]) -> str:
    """Return what is wrong with scores, float32 (k,); '' if nothing is."""
    if not len(score):
        return ''
    low, high = float(score.min()), float(score.max())
    if -_TOLERANCE <= low and high <= 1 + _TOLERANCE:
        return ''
    return f'scores from {low:.4g} to {high:.4g} where 0 to 1 are expected'


def wrong_classes(label: NDArray[np.float32]) -> str:
    """Return what is wrong with classes, float32 (k,); '' if nothing is."""
    odd = label[~(np.abs(label - np.round(label)) <= _TOLERANCE) | (label < 0)
                | (label >= _MAX_CLASSES)]
    return (f'the class {odd[0]:.4g} where a whole number below {_MAX_CLASSES} is expected'
            if len(odd) else '')


def wrong_corners(corners: NDArray[np.float32]) -> str:
    """Return what is wrong with x1, y1, x2, y2 of sure boxes, float32 (k, 4); '' if nothing is."""
    if problem := not_finite(corners):
        return problem
    turned = corners[~(corners[:, :2] <= corners[:, 2:]).all(axis=1)]
    if len(turned):
        return (f'the box {turned[0].tolist()} whose second corner is not right of and below its '
                'first')
    return wrong_pixels(corners)


def wrong_pixels(boxes: NDArray[np.float32]) -> str:
    """Return what is wrong with the numbers of sure boxes, float32 (k, 4); '' if nothing is."""
    if len(boxes) and 0 < np.abs(boxes).max() <= _MAX_SHARE:
        return 'boxes in shares of the image where pixels of the input are expected'
    return not_finite(boxes)


def not_finite(boxes: NDArray[np.float32]) -> str:
    """Return what is wrong with boxes, float32 (k, 4), that are not of numbers; '' if nothing."""
    return '' if np.isfinite(boxes).all() else 'a box of NaN or infinity'
