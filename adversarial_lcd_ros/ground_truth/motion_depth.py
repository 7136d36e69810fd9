# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Depth of features from the camera's own motion, by true poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.ground_truth.view_features import ViewFeatures, match
from adversarial_lcd_ros.sequences.sequence import Progress

# Nothing is nearer than this to a camera, metres.
NEAREST_M = 0.3
# Partners of a frame for triangulation: within this time, about these distances, this angle.
_WINDOW_S, _BASELINES_M, _ANGLE_DEG = 4.0, (0.05, 0.1, 0.2, 0.4), 25.0
# A partner's distance may fall short of what is wanted by this factor; an angle of one degree
# costs as much as this many metres.
_SHORT, _METRES_A_DEGREE = 0.7, 0.01
_BITS = 64
# An inverse depth is known if its tolerance is at most this share of it.
_KNOWN_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class Camera:
    """
    Where a camera was, frame by frame, and what it is.

    Attributes
    ----------
    time_s : float64, (n,)
    turn : float64, (n, 3, 3)
        Camera to world.
    centre : float64, (n, 3)
        Metres.
    located : bool, (n,)
        The pose is known.
    width, height, focal : float
        Pixels; square pixels, central principal point.

    """

    time_s: NDArray[np.float64]
    turn: NDArray[np.float64]
    centre: NDArray[np.float64]
    located: NDArray[np.bool_]
    width: float
    height: float
    focal: float

    def rays(self, position: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return viewing rays of pixels, (..., 2) to (..., 3), at depth 1."""
        x = (position[..., 0] - self.width / 2) / self.focal
        y = (position[..., 1] - self.height / 2) / self.focal
        return np.stack([x, y, np.ones_like(x)], axis=-1).astype(np.float64)


def inverse_depths(features: ViewFeatures, camera: Camera, tolerance_px: float,
                   progress: Progress | None = None
                   ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
    """
    Return between which inverse depths every feature lies.

    A feature is matched with frames shortly before and after, some centimetres away; matches
    that obey the true epipolar geometry give its depth. Where none does, as after a turn in
    place, it may be anywhere beyond NEAREST_M.

    Parameters
    ----------
    features : ViewFeatures
    camera : Camera
    tolerance_px : float
        Of a match, from its epipolar line.
    progress : callable, optional
        Called with frames done and to do.

    Returns
    -------
    near, far : float32, (n, k)
        Largest and least inverse depth, 1/m.
    known : bool, (n, k)
        The depth was measured.

    """
    shape = features.position.shape[:2]
    near, far = np.full(shape, 1 / NEAREST_M, np.float32), np.zeros(shape, np.float32)
    known = np.zeros(shape, bool)
    for frame in np.flatnonzero(camera.located):
        value, spread = _triangulate(features, camera, int(frame), tolerance_px)
        sure = spread <= _KNOWN_SHARE * value
        known[frame] = sure
        near[frame, sure] = (value + spread)[sure]
        far[frame, sure] = np.maximum(value - spread, 0)[sure]
        if progress:
            progress(int(frame) + 1, len(camera.located))
    return near, far, known


def partners(camera: Camera, frame: int) -> list[int]:
    """Return frames shortly before and after that see the same from a little aside."""
    around = np.abs(camera.time_s - camera.time_s[frame]) <= _WINDOW_S
    other = np.flatnonzero(around & camera.located)
    distance = np.linalg.norm(camera.centre[other] - camera.centre[frame], axis=1)
    cosine = camera.turn[other][:, :, 2] @ camera.turn[frame][:, 2]
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    chosen = set()
    for side in (other < frame, other > frame):
        for wanted in _BASELINES_M:
            fit = np.flatnonzero(side & (angle < _ANGLE_DEG) & (distance >= _SHORT * wanted))
            if len(fit):
                cost = distance[fit] + _METRES_A_DEGREE * angle[fit]
                chosen.add(int(other[fit[np.argmin(cost)]]))
    return sorted(chosen)


def _triangulate(features: ViewFeatures, camera: Camera, frame: int, tolerance_px: float
                 ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    # Inverse depth and its tolerance, infinite where nothing is known. Of several partners the
    # value counts that agrees with most others, and of these the one with the least tolerance.
    most = features.position.shape[1]
    others = partners(camera, frame)
    value, spread = np.zeros((len(others), most)), np.full((len(others), most), np.inf)
    for row, other in enumerate(others):
        own, matched = match(features, frame, other, _BITS)
        if len(own):
            value[row, own], spread[row, own] = inverse_depth(
                camera, frame, other, features.position[frame, own],
                features.position[other, matched], tolerance_px)
    if not len(others):
        return np.zeros(most), np.full(most, np.inf)
    finite = np.isfinite(spread)
    width = np.where(finite, spread, 0)
    apart = np.abs(value[:, None] - value[None])
    agree = ((apart <= width[:, None] + width[None]) & finite[:, None] & finite[None]).sum(axis=1)
    best = np.lexsort((spread, -agree), axis=0)[0]
    column = np.arange(most)
    return value[best, column], spread[best, column]


def inverse_depth(camera: Camera, frame: int, other: int, own: NDArray[np.float32],
                  matched: NDArray[np.float32], tolerance_px: float
                  ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """
    Return inverse depths of matched features, and their tolerances.

    Parameters
    ----------
    camera : Camera
    frame, other : int
        Two frames.
    own, matched : float32, (k, 2)
        Places of the matches in the two frames, pixels.
    tolerance_px : float
        Of a match, from where some depth puts it.

    Returns
    -------
    value, spread : float64, (k,)
        In the first frame, 1/m; the spread is infinite where a match fits no depth.

    """
    # A point at inverse depth q is seen at (r + q t) / (r_z + q t_z): least squares over q.
    ray = camera.rays(own) @ (camera.turn[other].T @ camera.turn[frame]).T
    offset = camera.turn[other].T @ (camera.centre[frame] - camera.centre[other])
    seen = camera.rays(matched)[:, :2]
    left = seen * ray[:, 2:] - ray[:, :2]
    right = offset[:2] - seen * offset[2]
    strength = np.maximum((right**2).sum(axis=1), 1e-12)
    value = (left * right).sum(axis=1) / strength
    forward = np.maximum(ray[:, 2], 0.1)
    residual = np.linalg.norm(left - value[:, None] * right, axis=1) / forward * camera.focal
    spread = tolerance_px / camera.focal * forward / np.sqrt(strength)
    fits = (residual < tolerance_px) & (value > -spread) & (value < 1 / NEAREST_M)
    return value, np.where(fits, spread, np.inf)
