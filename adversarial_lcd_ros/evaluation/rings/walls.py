# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where a poster can hang: a plane in the depth of a view, and how other views see it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

# Places tried in a view; rays around each that a plane is fitted to.
TRIES, RADIUS = 40, 4
# A plane if the rays are so near to it, over their depth; seen not too much from the side.
FLAT, LEAST_COSINE = 0.01, 0.5
# Of the rays within the poster, so many have to be on the plane, so near over their depth.
ON_PLANE, OFF_PLANE = 0.95, 0.03
_NEAR_M = 0.1


@dataclass(frozen=True, eq=False)
class Camera:
    """
    A pinhole camera in its place.

    Attributes
    ----------
    turn : float64, (3, 3)
        Camera to world.
    centre : float64, (3,)
        Metres.
    focal : float
        Over the image width.
    width, height : int
        Pixels.

    """

    turn: NDArray[np.float64]
    centre: NDArray[np.float64]
    focal: float
    width: int
    height: int

    def to_world(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points of the camera's frame, (k, 3), in that of the world."""
        return np.asarray(points @ self.turn.T + self.centre)

    def pixels(self, world: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return where points of the world appear, (k, 2); None if one is behind the camera."""
        points = (world - self.centre) @ self.turn
        if (points[:, 2] < _NEAR_M).any():
            return None
        return np.asarray(self.focal * self.width * points[:, :2] / points[:, 2:]
                          + (self.width / 2, self.height / 2))


def find_wall(camera: Camera, depth: NDArray[np.float32], share: float,
              rng: np.random.Generator) -> NDArray[np.float64] | None:
    """
    Return the corners of a square on a wall of a view, in the world; None if none was found.

    Parameters
    ----------
    camera : Camera
    depth : float32, (rows, columns)
        Along the optical axis, metres; 0: unknown.
    share : float
        Of the frame, that the square covers in this view.
    rng : Generator
        Of the places tried.

    Returns
    -------
    float64, (4, 3)
        From the upper left on, clockwise as seen.

    """
    points = _points(camera, depth)
    rows, columns = depth.shape
    for _ in range(TRIES):
        row = int(rng.integers(RADIUS, rows - RADIUS))
        column = int(rng.integers(RADIUS, columns - RADIUS))
        near = points[row - RADIUS:row + RADIUS + 1, column - RADIUS:column + RADIUS + 1]
        corners = _square(camera, near.reshape(-1, 3), share)
        if corners is not None and _is_free(camera, points, corners):
            return camera.to_world(corners)
    return None


def _points(camera: Camera, depth: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return what the rays of a depth image meet, in the camera's frame, (rows, columns, 3)."""
    rows, columns = depth.shape
    y, x = np.indices(depth.shape) + 0.5
    focal = camera.focal * columns
    ray = np.stack([(x - columns / 2) / focal, (y - rows / 2) / focal, np.ones_like(x)], axis=2)
    return np.asarray(ray * depth[:, :, None].astype(np.float64))


def _square(camera: Camera, near: NDArray[np.float64], share: float
            ) -> NDArray[np.float64] | None:
    """Return the corners of an upright square on the plane through some points, (4, 3)."""
    if (near[:, 2] <= 0).any():
        return None
    middle = near.mean(axis=0)
    _, spread, axes = np.linalg.svd(near - middle)
    normal = axes[2]
    cosine = abs(normal @ middle) / np.linalg.norm(middle)
    if spread[2] / np.sqrt(len(near)) > FLAT * middle[2] or cosine < LEAST_COSINE:
        return None
    up = np.array([0.0, -1.0, 0.0])
    up -= (up @ normal) * normal
    if np.linalg.norm(up) < LEAST_COSINE:
        return None
    up /= np.linalg.norm(up)
    right = np.cross(normal, up)
    right *= np.sign(right[0]) or 1.0
    ends = np.array([up - right, up + right, right - up, -up - right])
    half = 0.5 * np.sqrt(share * camera.width * camera.height) * middle[2] / (
        camera.focal * camera.width)
    # What it covers grows with the square of its side, nearly: two rounds come close enough.
    for _ in range(2):
        corners = middle + half * ends
        if (corners[:, 2] < _NEAR_M).any():
            return None
        half *= np.sqrt(share / _share(camera, corners))
    return np.asarray(middle + half * ends)


def _share(camera: Camera, corners: NDArray[np.float64]) -> float:
    pixels = corners[:, :2] / corners[:, 2:] * camera.focal * camera.width
    return float(cv2.contourArea(pixels.astype(np.float32)) / (camera.width * camera.height))


def _is_free(camera: Camera, points: NDArray[np.float64], corners: NDArray[np.float64]) -> bool:
    """Tell whether a square is in the frame, and nothing in front of it or missing behind it."""
    pixels = camera.pixels(camera.to_world(corners))
    if pixels is None or (pixels < 0).any() or (pixels > (camera.width, camera.height)).any():
        return False
    rows, columns = points.shape[:2]
    mask: NDArray[np.uint8] = np.zeros((rows, columns), np.uint8)
    scale = np.array([columns / camera.width, rows / camera.height])
    cv2.fillConvexPoly(mask, np.rint(pixels * scale - 0.5).astype(np.int32), 1)
    inside = points[mask > 0]
    normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
    normal /= np.linalg.norm(normal)
    off = np.abs((inside - corners[0]) @ normal)
    return len(inside) > 0 and bool(
        np.mean((inside[:, 2] > 0) & (off <= OFF_PLANE * inside[:, 2])) >= ON_PLANE)
