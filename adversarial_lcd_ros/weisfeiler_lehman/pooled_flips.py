# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How single flips change pooled features of two iterations, without visiting their neighbours.

After one iteration only the two ends of a flip differ; after two, besides them, their neighbours,
each by a multiple of what the ends differ by. Sums over the neighbours of a node are made once
for a graph, and a flip costs as much as its ends have neighbours in common: flips at an object
with hundreds of features, which centrality proposes first, cost no more than others.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.incidence import vectorised

ITERATIONS = 2
# Below, the neighbours of an end are summed anew: differences of few numbers lose digits.
_FEW = 16


@vectorised
def _sums(level: NDArray[np.float64], centre: NDArray[np.float64], total: NDArray[np.float64],
          start: NDArray[np.int64], neighbour: NDArray[np.int64], weight: NDArray[np.float64],
          around: NDArray[np.float64], passed: NDArray[np.float64],
          beside: NDArray[np.float64]) -> None:
    """
    Write sums over the neighbours i of every node u, with a_i = w_ui / (2 total_i).

    ``around`` (2, n, d): w_ui x_i of levels 0 and 1. ``passed`` (n, 2): a_i and a_i^2.
    ``beside`` (n, d): a_i (x_i - centre) of level 2.
    """
    nodes, width = level.shape[1:]
    for u in range(nodes):
        for k in range(start[u], start[u + 1]):
            i = neighbour[k]
            a = 0.5 * weight[k] / total[i]
            passed[u, 0] += a
            passed[u, 1] += a * a
            for j in range(width):
                around[0, u, j] += weight[k] * level[0, i, j]
                around[1, u, j] += weight[k] * level[1, i, j]
                beside[u, j] += a * (level[2, i, j] - centre[2, j])


@vectorised
def _end(h: int, end: int, other: int, edge: float, gained: float,
         level: NDArray[np.float64], changed: NDArray[np.float64], mine: int,
         start: NDArray[np.int64], neighbour: NDArray[np.int64], weight: NDArray[np.float64],
         total: NDArray[np.float64], around: NDArray[np.float64],
         out: NDArray[np.float64]) -> None:
    """Write how x_h of an end changes; ``changed`` (2, d) is that of both ends at h - 1."""
    width = level.shape[2]
    before, few = level[h - 1], start[end + 1] - start[end] < _FEW
    present = edge > 0
    now = 0.0 if present else gained
    for j in range(width):
        out[j] = now * (before[other, j] + changed[1 - mine, j])
    if few:
        for k in range(start[end], start[end + 1]):
            if neighbour[k] != other:
                now += weight[k]
                for j in range(width):
                    out[j] += weight[k] * before[neighbour[k], j]
    else:
        now += total[end] - edge
        for j in range(width):
            out[j] += around[h - 1, end, j] - edge * before[other, j]
    scale = 0.5 / now if now > 0 else 0.0
    own = 0.5 if now > 0 else 1.0  # a node without neighbours keeps its features
    for j in range(width):
        out[j] = own * (before[end, j] + changed[mine, j]) + scale * out[j] - level[h, end, j]


@vectorised
def _edge(u: int, v: int, start: NDArray[np.int64], neighbour: NDArray[np.int64],
          weight: NDArray[np.float64]) -> float:
    """Return the weight of an edge, 0 where there is none."""
    low, high = start[u], start[u + 1]
    while low < high:
        middle = (low + high) // 2
        if neighbour[middle] < v:
            low = middle + 1
        else:
            high = middle
    return weight[low] if low < start[u + 1] and neighbour[low] == v else 0.0


@vectorised
def _common(u: int, v: int, start: NDArray[np.int64], neighbour: NDArray[np.int64],
            weight: NDArray[np.float64], total: NDArray[np.float64]) -> float:
    """Return the sum of a_i b_i over the common neighbours i of two nodes."""
    if start[u + 1] - start[u] > start[v + 1] - start[v]:
        u, v = v, u
    found = 0.0
    for k in range(start[u], start[u + 1]):
        i = neighbour[k]
        found += weight[k] * _edge(v, i, start, neighbour, weight) / (4 * total[i] * total[i])
    return found


@vectorised
def pooled_changes(pairs: NDArray[np.int64], gained: NDArray[np.float64],
                   level: NDArray[np.float64], start: NDArray[np.int64],
                   neighbour: NDArray[np.int64], weight: NDArray[np.float64]
                   ) -> NDArray[np.float64]:
    """
    Return what ``flips.changes`` returns pooled, of two iterations, shape (k, 4 d).

    Parameters
    ----------
    pairs : int64, (k, 2)
    gained : float64, (k,)
        Weight of each as an edge.
    level : float64, (3, n, d)
        x_0 to x_2 of the graph.
    start, neighbour, weight
        As ``incidence`` gives them.

    """
    nodes, width = level.shape[1:]
    total = np.zeros(nodes)
    for node in range(nodes):
        for k in range(start[node], start[node + 1]):
            total[node] += weight[k]
    centre, spread = np.zeros((3, width)), np.zeros((3, width))
    for h in range(3):
        for node in range(nodes):
            for j in range(width):
                centre[h, j] += level[h, node, j] / nodes
        for node in range(nodes):
            for j in range(width):
                spread[h, j] += (level[h, node, j] - centre[h, j]) ** 2
    around, passed = np.zeros((2, nodes, width)), np.zeros((nodes, 2))
    beside = np.zeros((nodes, width))
    _sums(level, centre, total, start, neighbour, weight, around, passed, beside)
    out = np.zeros((len(pairs), 4 * width))
    change = np.zeros((3, 2, width))
    for p in range(len(pairs)):
        u, v = pairs[p, 0], pairs[p, 1]
        edge = _edge(u, v, start, neighbour, weight)
        common = _common(u, v, start, neighbour, weight, total)
        for h in range(1, 3):
            _end(h, u, v, edge, gained[p], level, change[h - 1], 0, start, neighbour, weight,
                 total, around, change[h, 0])
            _end(h, v, u, edge, gained[p], level, change[h - 1], 1, start, neighbour, weight,
                 total, around, change[h, 1])
        # Ends are no neighbours of each other here: their own change is known already.
        to_v = 0.5 * edge / total[v] if edge > 0 else 0.0
        to_u = 0.5 * edge / total[u] if edge > 0 else 0.0
        for j in range(width):
            for h in range(1, 3):
                a, b = change[h, 0, j], change[h, 1, j]
                shift = a + b
                square = (a * (2 * (level[h, u, j] - centre[h, j]) + a)
                          + b * (2 * (level[h, v, j] - centre[h, j]) + b))
                if h == 2:
                    a, b = change[1, 0, j], change[1, 1, j]
                    shift += a * (passed[u, 0] - to_v) + b * (passed[v, 0] - to_u)
                    square += 2 * a * (beside[u, j] - to_v * (level[2, v, j] - centre[2, j]))
                    square += 2 * b * (beside[v, j] - to_u * (level[2, u, j] - centre[2, j]))
                    square += a * a * (passed[u, 1] - to_v * to_v) + 2 * a * b * common
                    square += b * b * (passed[v, 1] - to_u * to_u)
                shift /= nodes
                now = max((spread[h, j] + square) / nodes - shift * shift, 0.0)
                first = 2 * (h - 1) * width + j
                out[p, first] = shift
                out[p, first + width] = sqrt(now) - sqrt(spread[h, j] / nodes)
    return out
