# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How much two camera views share, from their poses alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.errors import EvaluationError

GRID = (9, 7)
GRID_POINTS = GRID[0] * GRID[1]
DEPTHS_M = (1.0, 2.0, 4.0)
# Scratch memory of one block of rows, in float32 values: small enough to stay in the cache.
_BLOCK_VALUES = 1 << 19


def visible_points(position: NDArray[np.float64], quaternion: NDArray[np.float64],
                   image_size: tuple[int, int], focal_length: float,
                   depths_m: Sequence[float] = DEPTHS_M) -> NDArray[np.uint8]:
    """
    Return how many grid points of view i camera j sees, shape (n, n), 0 to GRID_POINTS.

    The pixels of a 9 x 7 grid over view i are put at some depths and projected into
    view j; the depth at which most of them fall into its image counts. Without a depth image
    the true depth is unknown: the largest share is what the views could have in common.
    Divided by GRID_POINTS this is the directed view overlap; memory is n^2 bytes.

    Parameters
    ----------
    position : float64, (n, 3)
        Camera centres in the world, metres.
    quaternion : float64, (n, 4)
        Camera optical frame to world, x y z w.
    image_size : (int, int)
        Width and height, pixels.
    focal_length : float
        Focal length over the image width; square pixels, central principal point.
    depths_m : sequence of float
        Metres.

    """
    count = len(position)
    rotation = rotations(quaternion)
    ray = rotation @ _rays(image_size, focal_length).T  # (n, 3, GRID_POINTS), world axes
    centre = position - position.mean(axis=0) if count else position  # float32 needs small numbers
    projection = _projections(centre, rotation, image_size, focal_length)
    best: NDArray[np.uint8] = np.zeros((count, count), np.uint8)
    rows = max(1, _BLOCK_VALUES // (GRID_POINTS * max(count, 1)))
    for start in range(0, count, rows):
        block = slice(start, min(start + rows, count))
        for depth in depths_m:
            point = centre[block, None, :] + depth * ray[block].transpose(0, 2, 1)
            np.maximum(best[block], _seen(point.astype(np.float32), projection), out=best[block])
    return best


def rotations(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (n, 3, 3) matrices of (n, 4) quaternions x y z w; EvaluationError if not one."""
    norm = np.linalg.norm(quaternion, axis=1)
    if not np.all(norm > 1e-6):  # also catches NaN
        bad = int(np.flatnonzero(~(norm > 1e-6))[0])
        raise EvaluationError(f'ground truth pose {bad} has the quaternion {quaternion[bad]}: '
                              'expected a rotation; repair or remove that line')
    matrix: NDArray[np.float64] = Rotation.from_quat(quaternion).as_matrix().reshape(-1, 3, 3)
    return matrix


def _rays(image_size: tuple[int, int], focal_length: float) -> NDArray[np.float64]:
    # Viewing rays of the grid's cell centres in the optical frame, at depth 1.
    width, height = image_size
    across = ((np.arange(GRID[0]) + 0.5) / GRID[0] - 0.5) / focal_length
    down = ((np.arange(GRID[1]) + 0.5) / GRID[1] - 0.5) / focal_length * height / width
    x, y = np.meshgrid(across, down)
    return np.stack([x.ravel(), y.ravel(), np.ones(GRID_POINTS)], axis=1)


def _projections(centre: NDArray[np.float64], rotation: NDArray[np.float64],
                 image_size: tuple[int, int], focal_length: float) -> NDArray[np.float32]:
    # World (homogeneous) to x, y, z of every camera, scaled so that a point is in the image
    # where |x| <= z and |y| <= z. Shape (4, 3 n): all x columns, all y, all z.
    width, height = image_size
    scale = np.array([2 * focal_length, 2 * focal_length * width / height, 1.0])
    turn = scale[:, None] * rotation.transpose(0, 2, 1)
    shift = -np.einsum('nij,nj->ni', turn, centre)
    full: NDArray[Any] = np.concatenate([turn, shift[:, :, None]], axis=2)  # (n, 3, 4)
    return np.ascontiguousarray(full.transpose(2, 1, 0).reshape(4, -1), np.float32)


def _seen(point: NDArray[np.float32], projection: NDArray[np.float32]) -> NDArray[np.uint8]:
    # Points (rows, GRID_POINTS, 3) seen by each camera: (rows, n).
    rows, count = len(point), projection.shape[1] // 3
    flat = np.concatenate([point.reshape(-1, 3),
                           np.ones((rows * GRID_POINTS, 1), np.float32)], axis=1)
    x, y, z = np.split(flat @ projection, 3, axis=1)
    inside = np.maximum(np.abs(x), np.abs(y)) <= z
    seen: NDArray[np.uint8] = inside.reshape(rows, GRID_POINTS, count).sum(1, dtype=np.uint8)
    return seen
