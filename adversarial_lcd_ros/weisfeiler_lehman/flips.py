# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How single flips change continuous Weisfeiler-Lehman features, compiled.

After iteration h only nodes within h hops of the flip differ. The iteration is linear, so that
difference is passed on along edges; the two ends, whose weights change, are computed anew.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.incidence import vectorised


@vectorised
def _new_end(end: int, other: int, present: bool, gained: float, before: NDArray[np.float64],
             changed: NDArray[np.float64], start: NDArray[np.int64],
             neighbour: NDArray[np.int64], weight: NDArray[np.float64],
             row: NDArray[np.float64]) -> None:
    """Write x_h of an end of the flip, given x_(h-1) before it and how that changed."""
    total = 0.0 if present else gained
    for j in range(len(row)):
        row[j] = total * (before[other, j] + changed[other, j])
    for k in range(start[end], start[end + 1]):
        node = neighbour[k]
        if node != other:
            total += weight[k]
            for j in range(len(row)):
                row[j] += weight[k] * (before[node, j] + changed[node, j])
    scale = 1 / total if total > 0 else 0.0
    own = 0.5 if total > 0 else 1.0  # a node without neighbours keeps its features
    for j in range(len(row)):
        row[j] = own * (before[end, j] + changed[end, j]) + 0.5 * scale * row[j]


@vectorised
def _spread(flip: int, u: int, v: int, present: bool, gained: float,
            level: NDArray[np.float64], start: NDArray[np.int64], neighbour: NDArray[np.int64],
            weight: NDArray[np.float64], total: NDArray[np.float64],
            change: NDArray[np.float64], ball: NDArray[np.int64], size: NDArray[np.int64],
            mark: NDArray[np.int64], row: NDArray[np.float64]) -> None:
    """Write the change of every level, and the ``size`` nodes that have one to ``ball``."""
    size[0] = 0
    for h in range(1, len(level)):
        now, before, stamp = change[h], change[h - 1], flip * len(level) + h
        nodes = ball[h]
        nodes[0], nodes[1], count = u, v, 2
        mark[u] = mark[v] = stamp
        for i in range(size[h - 1]):
            node = ball[h - 1, i]
            if mark[node] != stamp:
                mark[node], nodes[count] = stamp, node
                count += 1
            for j in range(len(row)):
                now[node, j] += 0.5 * before[node, j]
            for k in range(start[node], start[node + 1]):
                near = neighbour[k]
                if mark[near] != stamp:
                    mark[near], nodes[count] = stamp, near
                    count += 1
                part = 0.5 * weight[k] / total[near] if total[near] > 0 else 0.0
                for j in range(len(row)):
                    now[near, j] += part * before[node, j]
        for side in range(2):
            end, other = (u, v) if side == 0 else (v, u)
            _new_end(end, other, present, gained, level[h - 1], before, start, neighbour,
                     weight, row)
            for j in range(len(row)):
                now[end, j] = row[j] - level[h, end, j]
        size[h] = count


@vectorised
def changes(pairs: NDArray[np.int64], present: NDArray[np.bool_], gained: NDArray[np.float64],
            level: NDArray[np.float64], start: NDArray[np.int64],
            neighbour: NDArray[np.int64], weight: NDArray[np.float64], pooled: bool
            ) -> NDArray[np.float64]:
    """
    Return how each single flip changes phi: of all nodes, or pooled.

    Parameters
    ----------
    pairs : int64, (k, 2)
    present : bool, (k,)
        Which are edges.
    gained : float64, (k,)
        Weight of each as an edge.
    level : float64, (H + 1, n, d)
        x_0 to x_H of the graph.
    start, neighbour, weight
        As ``incidence`` gives them.
    pooled : bool

    Returns
    -------
    float64, (k, 2 d H) or (k, n d H)
        Mean and deviation over the nodes of each level, one after the other; or the nodes of
        each level side by side.

    """
    levels, nodes, width = level.shape
    total = np.zeros(nodes)
    for node in range(nodes):
        for k in range(start[node], start[node + 1]):
            total[node] += weight[k]
    centre = np.zeros((levels, width))
    spread = np.zeros((levels, width))
    for h in range(levels):
        for node in range(nodes):
            for j in range(width):
                centre[h, j] += level[h, node, j] / nodes
        for node in range(nodes):
            for j in range(width):
                spread[h, j] += (level[h, node, j] - centre[h, j]) ** 2
    change = np.zeros((levels, nodes, width))
    ball, size = np.empty((levels, nodes + 2), np.int64), np.empty(levels, np.int64)
    mark, row = np.full(nodes, -1), np.empty(width)
    out = np.zeros((len(pairs), (levels - 1) * width * (2 if pooled else nodes)))
    for p in range(len(pairs)):
        _spread(p, pairs[p, 0], pairs[p, 1], present[p], gained[p], level, start, neighbour,
                weight, total, change, ball, size, mark, row)
        for h in range(1, levels):
            if pooled:
                _pool(ball[h, :size[h]], change[h], level[h], centre[h], spread[h],
                      out[p, 2 * (h - 1) * width:2 * h * width])
            for i in range(size[h]):
                node = ball[h, i]
                if not pooled:
                    first = ((h - 1) * nodes + node) * width
                    out[p, first:first + width] = change[h, node]
                change[h, node] = 0
    return out


@vectorised
def _pool(ball: NDArray[np.int64], change: NDArray[np.float64], level: NDArray[np.float64],
          centre: NDArray[np.float64], spread: NDArray[np.float64],
          out: NDArray[np.float64]) -> None:
    """Write how mean and deviation of a level change."""
    nodes, width = level.shape
    for j in range(width):
        shift = square = 0.0
        for i in range(len(ball)):
            step = change[ball[i], j]
            shift += step
            square += step * (2 * (level[ball[i], j] - centre[j]) + step)
        shift /= nodes
        now = max((spread[j] + square) / nodes - shift * shift, 0.0)
        out[j] = shift
        out[width + j] = sqrt(now) - sqrt(spread[j] / nodes)
