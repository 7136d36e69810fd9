# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Hamming distances between binary descriptors, compiled.

A detector's time goes into these: matching a frame with its candidates takes 1.2 ms here where
a float matrix product of the same bits takes 9 (docs/performance.md). Compiled code is kept in
numba's cache on disk, so only the first process on a machine compiles.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.extending import intrinsic
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.caching import compiled_with
from adversarial_lcd_ros.graph import DESCRIPTOR_BYTES

LANES = DESCRIPTOR_BYTES // 8
_FAR = 8 * DESCRIPTOR_BYTES + 1
compiled = compiled_with()


def _population_count(_: Any, value: Any) -> Any:
    def generate(__: Any, builder: Any, ___: Any, arguments: Any) -> Any:
        return builder.ctpop(arguments[0])
    return types.uint64(value), generate


# Number of ones of a uint64, in one instruction where the processor has it.
_ones: Any = intrinsic(_population_count)


def lanes(descriptor: NDArray[np.uint8]) -> NDArray[np.uint64]:
    """Return descriptors, uint8 (k, 32), as uint64 (4, k): what the functions below compare."""
    packed = np.ascontiguousarray(descriptor, np.uint8).view(np.uint64)
    return np.ascontiguousarray(packed.reshape(-1, LANES).T)


@compiled
def _distances(one: NDArray[np.uint64], many: NDArray[np.uint64],
               distance: NDArray[np.uint16]) -> None:
    a, b, c, d = one[0], one[1], one[2], one[3]
    for j in range(len(distance)):
        distance[j] = (_ones(a ^ many[0, j]) + _ones(b ^ many[1, j])
                       + _ones(c ^ many[2, j]) + _ones(d ^ many[3, j]))


@compiled
def nearest(a: NDArray[np.uint64], b: NDArray[np.uint64]
            ) -> tuple[NDArray[np.int64], NDArray[np.uint16]]:
    """
    Return the nearest descriptor of b to each of a, the first of equals.

    Parameters
    ----------
    a, b : uint64, (4, k) and (4, m)
        As ``lanes`` gives them; m at least 1.

    Returns
    -------
    index : int64, (k,)
    distance : uint16, (k,)
        Bits, 0 to 256.

    """
    count, others = a.shape[1], b.shape[1]
    index = np.zeros(count, np.int64)
    least = np.zeros(count, np.uint16)
    distance = np.empty(others, np.uint16)
    for i in range(count):
        _distances(a[:, i], b, distance)
        index[i] = np.argmin(distance)
        least[i] = distance[index[i]]
    return index, least


@compiled
def mutual(a: NDArray[np.uint64], b: NDArray[np.uint64], farthest: int
           ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.uint16]]:
    """
    Return the descriptors of a and b that are each other's nearest, the first of equals.

    Parameters
    ----------
    a, b : uint64, (4, k) and (4, m)
        As ``lanes`` gives them.
    farthest : int
        Largest distance of a pair, bits.

    Returns
    -------
    first, second : int64, (p,)
        Indices in a, ascending, and in b.
    distance : uint16, (p,)
        Bits, 0 to 256.

    """
    count, others = a.shape[1], b.shape[1]
    forward = np.zeros(count, np.int64)
    least = np.full(count, _FAR, np.uint16)
    backward = np.zeros(others, np.int64)
    least_back = np.full(others, _FAR, np.uint16)
    distance = np.empty(others, np.uint16)
    for i in range(count if others else 0):
        _distances(a[:, i], b, distance)
        forward[i] = np.argmin(distance)
        least[i] = distance[forward[i]]
        for j in range(others):
            if distance[j] < least_back[j]:
                least_back[j] = distance[j]
                backward[j] = i
    first = np.array([i for i in range(count)
                      if least[i] <= farthest and backward[forward[i]] == i], np.int64)
    return first, forward[first], least[first]


@compiled
def descend(bits: NDArray[np.uint64], centre: NDArray[np.uint64], branching: int, depth: int
            ) -> NDArray[np.int64]:
    """
    Return the leaf of each descriptor: at every level the nearest child, the first of equals.

    Parameters
    ----------
    bits : uint64, (4, k)
    centre : uint64, (4, b + b^2 + .. + b^d)
        Levels one after the other, children of a node side by side.
    branching, depth : int
        b and d.

    Returns
    -------
    int64, (k,)
        0 to b^d - 1.

    """
    leaf = np.zeros(bits.shape[1], np.int64)
    distance = np.empty(branching, np.uint16)
    for i in range(len(leaf)):
        level = 0
        width = branching
        node = 0
        for _ in range(depth):
            start = level + node * branching
            _distances(bits[:, i], centre[:, start:start + branching], distance)
            node = node * branching + int(np.argmin(distance))
            level += width
            width *= branching
        leaf[i] = node
    return leaf
