# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What of one view is found again in another, at the places where the true poses put it; compiled.

Labels of a thousand frames look at half a million pairs of views, some hundred features each.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.hamming import _ones, compiled

CELL_PX = 32
# Columns of the result of count_sightings.
INSIDE, AGREEING, TESTED, FOUND, BY_CHANCE, UNTESTED = range(6)
COLUMNS = 6
# Mirrored left to right, upside down, and both.
MIRRORED = 3
_NEAREST_M = 0.05
# A point is hidden, or agrees, by this share of the depths around and this many metres.
_DEPTH_SHARE, _DEPTH_M = 0.15, 0.05
# What is known around a place says of a point seen there.
_BEFORE, _AGREES, _HIDDEN = range(3)


@compiled
def in_cells(position: NDArray[np.float32], count: NDArray[np.int64], columns: int, rows: int
             ) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """
    Return features by square cells of the image: where each cell starts, and their order.

    Parameters
    ----------
    position : float32, (n, k, 2)
        Pixels.
    count : int64, (n,)
        How many of the k a frame has.
    columns, rows : int
        Cells of CELL_PX.

    Returns
    -------
    start : int32, (n, columns * rows + 1)
    order : int32, (n, k)

    """
    frames, most = position.shape[0], position.shape[1]
    start = np.zeros((frames, columns * rows + 1), np.int32)
    order = np.zeros((frames, most), np.int32)
    for i in range(frames):
        cell = np.zeros(most, np.int32)
        for k in range(count[i]):
            column = min(max(int(position[i, k, 0] / CELL_PX), 0), columns - 1)
            row = min(max(int(position[i, k, 1] / CELL_PX), 0), rows - 1)
            cell[k] = row * columns + column
            start[i, cell[k] + 1] += 1
        for c in range(columns * rows):
            start[i, c + 1] += start[i, c]
        place = start[i].copy()
        for k in range(count[i]):
            order[i, place[cell[k]]] = k
            place[cell[k]] += 1
    return start, order


@compiled
def _clip(u: float, v: float, across: float, down: float, width: float, height: float
          ) -> tuple[float, float]:
    # The part of a segment that lies in the image, from and to which share; empty: from > to.
    first, last = 0.0, 1.0
    for step, room in ((-across, u), (across, width - u), (-down, v), (down, height - v)):
        if step == 0.0:
            if room < 0.0:
                return 1.0, 0.0
        elif step < 0.0:
            first = max(first, room / step)
        else:
            last = min(last, room / step)
    return first, last


@compiled
def _found(u: float, v: float, across: float, down: float, position: Any, start: Any, order: Any,
           other: Any, one: Any, columns: int, rows: int, radius: float, bits: int) -> bool:
    # Whether a feature within the radius of a segment looks alike.
    length2 = across * across + down * down
    left = max(int((min(u, u + across) - radius) / CELL_PX), 0)
    right = min(int((max(u, u + across) + radius) / CELL_PX), columns - 1)
    top = max(int((min(v, v + down) - radius) / CELL_PX), 0)
    bottom = min(int((max(v, v + down) + radius) / CELL_PX), rows - 1)
    for row in range(top, bottom + 1):
        for e in range(start[row * columns + left], start[row * columns + right + 1]):
            k = order[e]
            x, y = position[k, 0] - u, position[k, 1] - v
            along = 0.0
            if length2 > 0.0:
                along = min(max((x * across + y * down) / length2, 0.0), 1.0)
            x, y = x - along * across, y - along * down
            if x * x + y * y <= radius * radius:
                distance = (_ones(one[0] ^ other[k, 0]) + _ones(one[1] ^ other[k, 1])
                            + _ones(one[2] ^ other[k, 2]) + _ones(one[3] ^ other[k, 3]))
                if distance <= bits:
                    return True
    return False


@compiled
def _segment(ray: Any, offset: Any, near: float, far: float, camera: tuple[float, float, float]
             ) -> tuple[bool, float, float, float, float, float, float]:
    # Whether any of a ray is before the other camera; between which inverse depths, and where
    # these are seen: the far end, and how far the near one lies across and down, pixels.
    width, height, focal = camera
    low, high = far, near
    first, last = ray[2] + low * offset[2], ray[2] + high * offset[2]
    if first < _NEAREST_M and last < _NEAREST_M:
        return False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if first < _NEAREST_M:
        low += (high - low) * (_NEAREST_M - first) / (last - first)
    elif last < _NEAREST_M:
        high = low + (high - low) * (_NEAREST_M - first) / (last - first)
    first, last = ray[2] + low * offset[2], ray[2] + high * offset[2]
    u = (ray[0] + low * offset[0]) / first * focal + width / 2
    v = (ray[1] + low * offset[1]) / first * focal + height / 2
    across = (ray[0] + high * offset[0]) / last * focal + width / 2 - u
    down = (ray[1] + high * offset[1]) / last * focal + height / 2 - v
    return True, low, high, u, v, across, down


@compiled
def _looks_alike(ray: Any, middle: Any, zoom: float, steepest: float) -> bool:
    # Whether a point is seen from so near a direction and distance that its picture may match.
    straight = middle[0] * ray[0] + middle[1] * ray[1] + middle[2] * ray[2]
    bent = straight < steepest * np.sqrt((middle * middle).sum() * (ray * ray).sum())
    return not bent and 1 / zoom < middle[2] < zoom


@compiled
def _against_depth(least: float, most: float, known: Any) -> int:
    # Of the near and the far end, the one that agrees or is not hidden counts.
    if least > known[1] * (1 + _DEPTH_SHARE) + _DEPTH_M:
        return _HIDDEN
    return _AGREES if most > known[0] / (1 + _DEPTH_SHARE) - _DEPTH_M else _BEFORE


@compiled
def count_sightings(pairs: NDArray[np.int64], position: NDArray[np.float32],
                    descriptor: NDArray[np.uint64], count: NDArray[np.int64],
                    near: NDArray[np.float32], far: NDArray[np.float32],
                    turn: NDArray[np.float64], centre: NDArray[np.float64],
                    camera: tuple[float, float, float], depth: NDArray[np.float32],
                    cells: tuple[NDArray[np.int32], NDArray[np.int32], int, int],
                    radius: float, longest: float, zoom: float, steepest: float,
                    bits: int) -> NDArray[np.int32]:
    """
    Return for pairs of views what of the first may be, and is, seen in the second.

    A feature lies between two depths, hence on a segment of its epipolar line. It is tested where
    that segment is short enough to mean something.

    Parameters
    ----------
    pairs : int64, (m, 2)
        One view, and the other that is looked into.
    position : float32, (n, k, 2)
        Features, pixels.
    descriptor : uint64, (n, k, 4)
    count : int64, (n,)
        How many features a view has.
    near, far : float32, (n, k)
        Largest and least inverse depth of a feature, 1/m.
    turn, centre : float64, (n, 3, 3) and (n, 3)
        Camera to world; camera centres, metres.
    camera : (float, float, float)
        Width, height and focal length, pixels.
    depth : float32, (n, rows, columns, 2)
        Least and largest known depth around each cell, metres; 0: unknown.
    cells : start, order, columns, rows
        From ``in_cells``.
    radius : float
        Largest distance from the segment, pixels.
    longest : float
        Longest segment that is looked along, pixels.
    zoom : float
        Largest change of scale at which a feature still looks alike.
    steepest : float
        Cosine of the largest angle between the two directions it is seen from.
    bits : int
        Largest Hamming distance of descriptors that look alike.

    Returns
    -------
    int32, (m, 6)
        Features that may be INSIDE the other view, not hidden; of these, those AGREEING with the
        depths known there; those TESTED; of these, those FOUND, and those found BY_CHANCE at the
        three mirror images of the place; and those AGREEING but UNTESTED: they would look too
        different.

    """
    width, height, focal = camera
    start, order, columns, rows = cells
    result = np.zeros((len(pairs), COLUMNS), np.int32)
    for pair in range(len(pairs)):
        i, j = pairs[pair, 0], pairs[pair, 1]
        if i == j:
            continue
        between = turn[j].T @ turn[i]
        offset = turn[j].T @ (centre[i] - centre[j])
        for k in range(count[i]):
            x = (position[i, k, 0] - width / 2) / focal
            y = (position[i, k, 1] - height / 2) / focal
            ray = between[:, 0] * x + between[:, 1] * y + between[:, 2]
            ahead, low, high, u, v, across, down = _segment(ray, offset, near[i, k], far[i, k],
                                                            camera)
            if not ahead:
                continue
            begin, end = _clip(u, v, across, down, width, height)
            if begin > end:
                continue
            u, v = u + begin * across, v + begin * down
            across, down = (end - begin) * across, (end - begin) * down
            is_long = across * across + down * down > longest * longest
            is_alike = _looks_alike(ray, ray + (low + high) / 2 * offset, zoom, steepest)
            column = min(int((u + across / 2) / CELL_PX), columns - 1)
            row = min(int((v + down / 2) / CELL_PX), rows - 1)
            if not is_long and depth[j, row, column, 1] > 0:
                least = (ray[2] + high * offset[2]) / high if high > 0 else np.inf
                most = (ray[2] + low * offset[2]) / low if low > 0 else np.inf
                against = _against_depth(least, most, depth[j, row, column])
                if against == _HIDDEN:
                    continue
                if against == _AGREES:
                    result[pair, AGREEING] += 1
                    if not is_alike:
                        result[pair, UNTESTED] += 1
            result[pair, INSIDE] += 1
            if is_long or not is_alike:
                continue
            result[pair, TESTED] += 1
            for mirror in range(MIRRORED + 1):
                at, along = (width - u, -across) if mirror & 1 else (u, across)
                below, beneath = (height - v, -down) if mirror & 2 else (v, down)
                if _found(at, below, along, beneath, position[j], start[j], order[j],
                          descriptor[j], descriptor[i, k], columns, rows, radius, bits):
                    result[pair, BY_CHANCE if mirror else FOUND] += 1
    return result
