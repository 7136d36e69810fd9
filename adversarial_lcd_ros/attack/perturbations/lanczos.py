# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The leading eigenvector of an adjacency matrix by the Lanczos iteration, compiled."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.incidence import vectorised

MOST_STEPS = 160
_CHECK_EVERY = 4
_NEWTON_STEPS = 60


@vectorised
def _multiply(edge: NDArray[np.uint32], x: NDArray[np.float64],
              product: NDArray[np.float64]) -> None:
    """Write A x, from the edges themselves."""
    product[:] = 0
    for i in range(len(edge)):
        u, v = edge[i, 0], edge[i, 1]
        product[u] += x[v]
        product[v] += x[u]


@vectorised
def _trailing(diagonal: NDArray[np.float64], beside: NDArray[np.float64], size: int,
              value: float, pivot: NDArray[np.float64]) -> tuple[float, bool]:
    """
    Write the pivots of value - T from the last row up; return the slope of the first.

    The second result tells whether ``value`` is above all eigenvalues of T without its first row.
    """
    slope = 1.0
    pivot[size - 1] = value - diagonal[size - 1]
    for i in range(size - 2, -1, -1):
        if pivot[i + 1] <= 0:
            return slope, False
        factor = beside[i] / pivot[i + 1]
        pivot[i] = value - diagonal[i] - factor * beside[i]
        slope = 1 + factor * factor * slope
    return slope, True


@vectorised
def _top(diagonal: NDArray[np.float64], beside: NDArray[np.float64], size: int, low: float,
         high: float, pivot: NDArray[np.float64]) -> float:
    """Return the largest eigenvalue of a tridiagonal matrix, which is within the bounds."""
    value = low
    for _ in range(_NEWTON_STEPS):
        slope, above = _trailing(diagonal, beside, size, value, pivot)
        step = -pivot[0] / slope if above else high - low
        if above and pivot[0] > 0:
            high = value
        else:
            low = value
        if above and abs(step) <= 1e-16 * abs(value):
            break
        value += step
        if not low < value < high:
            value = (low + high) / 2
            if value in (low, high):
                break
    _trailing(diagonal, beside, size, value, pivot)
    return value


@vectorised
def leading(edge: NDArray[np.uint32], start: NDArray[np.float64], tolerance: float
            ) -> tuple[NDArray[np.float64], float]:
    """
    Return the eigenvector of the largest eigenvalue of A, unit length, and its residual.

    Parameters
    ----------
    edge : uint32, (m, 2)
        At least one.
    start : float64, (n,)
        Where to begin; must have a part in the eigenvector.
    tolerance : float
        The iteration ends when |A x - lambda x| is below this times lambda, or after 160 steps.

    Returns
    -------
    x : float64, (n,)
    residual : float
        |A x - lambda x| / lambda, not estimated but measured.

    """
    nodes = len(start)
    basis = np.empty((MOST_STEPS + 1, nodes))
    diagonal, beside = np.zeros(MOST_STEPS), np.zeros(MOST_STEPS)
    pivot, weight = np.zeros(MOST_STEPS), np.zeros(MOST_STEPS)
    basis[0] = start / sqrt((start * start).sum())
    value, residual, size = -np.inf, np.inf, 0
    for step in range(MOST_STEPS):
        now, after = basis[step], basis[step + 1]
        _multiply(edge, now, after)
        if step:
            for j in range(nodes):
                after[j] -= beside[step - 1] * basis[step - 1, j]
        along = 0.0
        for j in range(nodes):
            along += after[j] * now[j]
        square = 0.0
        for j in range(nodes):
            after[j] -= along * now[j]
            square += after[j] * after[j]
        diagonal[step], beside[step], size = along, sqrt(square), step + 1
        exhausted = beside[step] <= 1e-14 * abs(along)
        if size % _CHECK_EVERY == 0 or exhausted or size == MOST_STEPS:
            bound = diagonal[:size].max() + 2 * beside[:size].max()
            value = _top(diagonal, beside, size, diagonal[:size].max(), bound, pivot)
            weight[size - 1] = 1.0
            for i in range(size - 1, 0, -1):
                weight[i - 1] = weight[i] * pivot[i] / beside[i - 1]
            norm = sqrt((weight[:size] * weight[:size]).sum())
            residual = beside[step] / norm
            if residual <= tolerance * value or exhausted:
                break
        for j in range(nodes):
            after[j] /= beside[step]
    x = np.zeros(nodes)
    for i in range(size):
        for j in range(nodes):
            x[j] += weight[i] * basis[i, j]
    x /= sqrt((x * x).sum())
    product = np.empty(nodes)
    _multiply(edge, x, product)
    value = (product * x).sum()
    return x, sqrt(((product - value * x) ** 2).sum()) / value
