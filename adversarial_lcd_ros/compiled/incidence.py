# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Edges around every node, and how compiled code here sums."""

from __future__ import annotations

from math import exp

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.caching import compiled_with

LENGTH_SCALE = 0.1
# Sums may be reordered to use vector registers; one function orders them in one way.
vectorised = compiled_with(error_model='numpy', fastmath={'reassoc', 'contract'})

Incidence = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]


@vectorised
def incidence(edge: NDArray[np.uint32], length: NDArray[np.float32], nodes: int) -> Incidence:
    """
    Return the neighbours of every node, ascending, and the weights of the edges to them.

    Parameters
    ----------
    edge : uint32, (m, 2)
        Sorted by source, then target.
    length : float32, (m,)
        Over the image diagonal.
    nodes : int
        n.

    Returns
    -------
    start : int64, (n + 1,)
        Where the neighbours of each node begin.
    neighbour : int64, (2 m,)
    weight : float64, (2 m,)
        exp(-length / 0.1).

    """
    start = np.zeros(nodes + 1, np.int64)
    for i in range(len(edge)):
        start[edge[i, 0] + 1] += 1
        start[edge[i, 1] + 1] += 1
    start = np.cumsum(start)
    free = start.copy()
    neighbour = np.empty(2 * len(edge), np.int64)
    weight = np.empty(2 * len(edge), np.float64)
    # In this order of edges each node meets its neighbours in ascending order.
    for i in range(len(edge)):
        value = exp(-np.float64(length[i]) / LENGTH_SCALE)
        for side in range(2):
            node = edge[i, side]
            neighbour[free[node]] = edge[i, 1 - side]
            weight[free[node]] = value
            free[node] += 1
    return start, neighbour, weight
