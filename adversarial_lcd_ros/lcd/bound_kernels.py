# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How far a few flips can turn a neighbourhood, compiled; proofs: bound_channels.py."""

from __future__ import annotations

from math import acos, atan, cos, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.hamming import compiled

_ROUNDS = 50
_TINY = 1e-9
# |m| <= 1: x0 + m / 2 is within asin(1 / 2) of x0, and its slope in any plane within this.
_STEEPEST = 1 / sqrt(3)


@compiled
def largest_ratio(top: NDArray[np.float64], bottom: NDArray[np.float64],
                  present: NDArray[np.bool_], flips: int, otherwise: float,
                  known: float = -np.inf) -> float:
    """
    Return the largest sum(top) / sum(bottom) over the terms of a set, after some flips of it.

    By Dinkelbach: for a ratio r, sum(top - r bottom) is largest with those flips that add most to
    it; where that is 0, r is the largest there is. A set without terms has the ratio
    ``otherwise``.

    Parameters
    ----------
    top, bottom : float64, (n,)
        Bottom above 0.
    present : bool, (n,)
        The set.
    flips : int
        Most terms that come or go.
    otherwise : float
    known : float
        A ratio that so many flips are known to reach, as fewer do: saves rounds.

    """
    count = 0
    above = below = 0.0
    for i in range(len(top)):
        if present[i]:
            count += 1
            above += top[i]
            below += bottom[i]
    ratio = above / below if count else otherwise
    if flips >= count:
        ratio = max(ratio, otherwise)
    ratio = max(ratio, known)
    gain = np.empty(len(top))
    for _ in range(_ROUNDS):
        for i in range(len(top)):
            value = top[i] - ratio * bottom[i]
            gain[i] = -value if present[i] else value
        last = max(len(top) - flips, 0)
        least = np.partition(gain, last)[last] if flips and len(top) else np.inf
        left = flips  # for those that are equal, behind all that are better
        for i in range(len(top)):
            left -= gain[i] > least
        more, less = above, below
        for i in range(len(top)):
            if gain[i] > 0 and (gain[i] > least or (left > 0 and gain[i] == least)):
                left -= gain[i] == least
                sign = -1.0 if present[i] else 1.0
                more += sign * top[i]
                less += sign * bottom[i]
        if less <= _TINY or more / less <= ratio + 1e-12:
            return ratio
        ratio = more / less
    return np.inf


@compiled
def cosine_bounds(node: NDArray[np.int64], gram: NDArray[np.float64],
                  product: NDArray[np.float64], omega: NDArray[np.float64],
                  present: NDArray[np.bool_], levels: NDArray[np.int64]
                  ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """
    Return the least and largest cosines of nodes' features with vectors after some flips.

    Parameters
    ----------
    node : int64, (k,)
        Features of the query.
    gram : float64, (n, n)
        Scalar products of x0 of all nodes; 0 with an object.
    product : float64, (n, k)
        Scalar products of x0 with the unit vectors that the features are compared with.
    omega : float64, (n, n)
        Weight of every edge, and of every pair if it became one.
    present : bool, (n, n)
        The edges.
    levels : int64, (l,)
        Numbers of flips at a node.

    Returns
    -------
    least, largest : float64, (k, l)

    """
    least = np.empty((len(node), len(levels)))
    largest = np.empty((len(node), len(levels)))
    for row in range(len(node)):
        u = node[row]
        here = present[u].copy()
        weight, along, towards = omega[u].copy(), gram[u].copy(), product[:, row].copy()
        here[u], weight[u] = False, 0.0  # no node is its own neighbour
        alpha = min(max(towards[u], -1.0), 1.0)
        theta, sine = acos(alpha), sqrt(max(1 - alpha * alpha, 0.0))
        _turned_towards(weight * (towards - along * alpha), weight * (2 + along) + _TINY, sine,
                        theta, here, levels, largest[row])
        _turned_away(weight, along, towards, alpha, here, levels, least[row])
    return least, largest


@compiled
def _turned_towards(top: NDArray[np.float64], bottom: NDArray[np.float64], sine: float,
                    theta: float, here: NDArray[np.bool_], levels: NDArray[np.int64],
                    largest: NDArray[np.float64]) -> None:
    """Write the largest cosine after each number of flips, ascending, into ``largest``."""
    slope = -np.inf
    for level in range(len(levels)):
        if sine > 1e-6 and slope < _STEEPEST:
            slope = largest_ratio(top / sine, bottom, here, levels[level], 0.0, slope)
        else:
            slope = _STEEPEST
        angle = theta - atan(min(slope, _STEEPEST))
        largest[level] = cos(min(max(angle, 0.0), pi))


@compiled
def _turned_away(weight: NDArray[np.float64], along: NDArray[np.float64],
                 towards: NDArray[np.float64], alpha: float, here: NDArray[np.bool_],
                 levels: NDArray[np.int64], least: NDArray[np.float64]) -> None:
    """Write the least cosine after each number of flips, ascending, into ``least``."""
    total, centre = 0.0, 0.0
    for i in range(len(weight)):
        if here[i]:
            total += weight[i]
            centre += weight[i] * along[i]
    centre = max(centre / total, -0.5) if total > 0 else 0.0
    root = sqrt(1.25 + centre)
    # The ratio of -numerator to denominator is largest where the cosine is least.
    top = -weight * (alpha + towards / 2)
    bottom = weight * (root + (along - centre) / (2 * root)) + _TINY
    worst = -np.inf
    for level in range(len(levels)):
        worst = largest_ratio(top, bottom, here, levels[level], -alpha, worst)
        least[level] = max(-worst, -1.0)


@compiled
def mean_bounds(member: NDArray[np.bool_], low: NDArray[np.float64],
                high: NDArray[np.float64], levels: NDArray[np.int64]
                ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """
    Return the least and largest means over sets after some members came or went, (k, l) each.

    Parameters
    ----------
    member : bool, (k, n)
        The sets; the mean of an empty one is 0.
    low, high : float64, (k, n)
        What each member is worth at least and at most.
    levels : int64, (l,)
        Most members that come or go.

    """
    least = np.empty((len(member), len(levels)))
    largest = np.empty((len(member), len(levels)))
    one = np.ones(member.shape[1])
    for row in range(len(member)):
        for level in range(len(levels)):
            flips = levels[level]
            largest[row, level] = largest_ratio(high[row], one, member[row], flips, 0.0)
            least[row, level] = -largest_ratio(-low[row], one, member[row], flips, 0.0)
    return least, largest


@compiled
def spent(before: NDArray[np.float64], price: NDArray[np.int64], worth: NDArray[np.float64]
          ) -> NDArray[np.float64]:
    """
    Return the most that can be had for up to so many flips, with one node more to spend them on.

    Parameters
    ----------
    before : float64, (ends + 1,)
        Without the node.
    price : int64, (l,)
        Flips at the node from which on it may be worth that much.
    worth : float64, (l,)

    """
    after = before.copy()
    for ends in range(len(before)):
        for level in range(len(price)):
            if price[level] > ends:
                break
            after[ends] = max(after[ends], before[ends - price[level]] + worth[level])
    return after
