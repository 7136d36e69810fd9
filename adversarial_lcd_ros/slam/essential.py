# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The relative pose of two frames from their features, as a front end with one camera has it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.geometry import CONFIDENCE, LEAST_MATCHES, matched_points

_FAR = 1e6  # baselines: nothing is left out for being far away


def relative_pose(older: MultiTierGraph, newer: MultiTierGraph, focal_px: float,
                  threshold_px: float, scene_depth_m: float) -> NDArray[np.float64] | None:
    """
    Return the newer camera as seen from the older one, (4, 4); None where features give none.

    Rotation and direction are those of the essential matrix that most matches fit (RANSAC, fixed
    draws). One camera does not know the scale: the translation is as long as puts the median
    of the triangulated matches at the assumed depth of a scene, so that a pure rotation moves
    nothing.

    Parameters
    ----------
    older, newer : MultiTierGraph
    focal_px : float
        Square pixels, principal point in the middle.
    threshold_px : float
        Largest distance from the epipolar line.
    scene_depth_m : float
        Metres.

    """
    there, here = matched_points(older, newer)
    if len(here) < LEAST_MATCHES:
        return None
    camera = np.array([[focal_px, 0.0, newer.width / 2], [0.0, focal_px, newer.height / 2],
                       [0.0, 0.0, 1.0]])
    matrix, inlier = cv2.findEssentialMat(here, there, camera, cv2.RANSAC, CONFIDENCE,
                                          threshold_px)
    if matrix is None or matrix.shape != (3, 3):
        return None
    count, rotation, direction, _, point = cv2.recoverPose(
        matrix, here, there, camera, distanceThresh=_FAR, mask=inlier.copy())
    if count < LEAST_MATCHES:
        return None
    depth = _median_depth(point, inlier[:, 0] > 0)
    if depth is None:
        return None
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, direction[:, 0] * scene_depth_m / depth
    return pose


def _median_depth(point: NDArray[np.float64], inlier: NDArray[np.bool_]) -> float | None:
    """Return the median depth of triangulated points (4, k) in baselines; None without."""
    with np.errstate(divide='ignore', invalid='ignore'):
        depth = (point[2] / point[3])[inlier]
    depth = depth[np.isfinite(depth) & (depth > 0)]
    return float(np.median(depth)) if len(depth) else None
