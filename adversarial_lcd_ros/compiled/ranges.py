# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a graph's schema says of its numbers, held against them in one pass, compiled."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.hamming import compiled

NONE, POSITION, SIZE, LABEL, SCORE, WORD, WEIGHTS, LENGTH = range(8)
# More words than any vocabulary has: its centres alone would take half a gigabyte.
MAX_WORD = 2 ** 24 - 1
# ORB's response is Harris's, det - 0.04 trace^2 of gradients between -1 and 1.
LEAST_RESPONSE = -0.1601
WEIGHT_TOLERANCE = 1e-3
LENGTH_TOLERANCE = 1e-5


@compiled
def node_fault(position: NDArray[np.float32], size: NDArray[np.float32],
               label: NDArray[np.uint32], score: NDArray[np.float32], objects: int,
               width: int, height: int) -> tuple[int, int]:
    """Return what is wrong with which node, the first of them; NONE without one."""
    for i in range(len(position)):
        x, y = position[i, 0], position[i, 1]
        if not (0 <= x <= width and 0 <= y <= height):
            return POSITION, i
        if not (size[i, 0] > 0 and size[i, 1] > 0):
            return SIZE, i
        if label[i] > MAX_WORD:
            return LABEL, i
        if not (score[i] >= LEAST_RESPONSE if i >= objects else 0 <= score[i] <= 1):
            return SCORE, i
    return NONE, 0


@compiled
def word_fault(word: NDArray[np.uint32], weight: NDArray[np.float32]) -> tuple[int, int]:
    """Return what is wrong with which word, or with all; NONE without a fault."""
    total = 0.0
    for i in range(len(word)):
        if word[i] > MAX_WORD:
            return WORD, i
        total += weight[i]
    if len(word) and not abs(total - 1) <= WEIGHT_TOLERANCE:
        return WEIGHTS, 0
    return NONE, 0


@compiled
def length_fault(position: NDArray[np.float32], edge: NDArray[np.uint32],
                 length: NDArray[np.float32], diagonal: float) -> tuple[int, int]:
    """Return which edge has not the length between its ends; NONE without one."""
    for i in range(len(edge)):
        u, v = edge[i, 0], edge[i, 1]
        x = np.float64(position[u, 0]) - position[v, 0]
        y = np.float64(position[u, 1]) - position[v, 1]
        if not abs(sqrt(x * x + y * y) / diagonal - length[i]) <= LENGTH_TOLERANCE:
            return LENGTH, i
    return NONE, 0
