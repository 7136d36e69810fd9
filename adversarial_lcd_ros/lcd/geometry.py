# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The geometric check of a match: whether the features of both frames agree on one motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.hamming import lanes, mutual
from adversarial_lcd_ros.graph import MultiTierGraph

MAX_HAMMING = 64
# A fundamental matrix takes seven matches; eight is the first number that can disagree.
LEAST_MATCHES = 8
CONFIDENCE, ROUNDS = 0.999, 1000


@dataclass(frozen=True)
class Inliers:
    """
    Matched features of two frames that fit one fundamental matrix.

    Attributes
    ----------
    count : int
    cover : float
        Share of the frame that their convex hull covers, of the frame where it is smaller.

    """

    count: int
    cover: float


NONE = Inliers(0, 0.0)


def find_inliers(one: MultiTierGraph, other: MultiTierGraph, threshold_px: float) -> Inliers:
    """
    Return the matched features of two frames that fit one fundamental matrix.

    Edges are not looked at. Matches are mutual nearest neighbours within 64 of 256 bits; the
    matrix is found by USAC or, where OpenCV's cannot go on, by its plain RANSAC. The draws of
    both are fixed: the same graphs give the same number.

    Parameters
    ----------
    one, other : MultiTierGraph
    threshold_px : float
        Largest distance from the epipolar line, pixels.

    """
    points = matched_points(one, other)
    if len(points[0]) < LEAST_MATCHES:
        return NONE
    try:
        matrix, inlier = _fundamental(points, cv2.USAC_DEFAULT, threshold_px)
    except cv2.error:
        matrix = None
    if matrix is None:
        # On some planar scenes USAC refines an empty matrix and raises, in OpenCV 4.6 it gives
        # up on all of them; RANSAC does not refine.
        matrix, inlier = _fundamental(points, cv2.FM_RANSAC, threshold_px)
    # None where the matches determine no matrix, as unrelated ones on one line.
    if matrix is None:
        return NONE
    agree = inlier.ravel() != 0
    return Inliers(int(agree.sum()), min(
        _hull(at[agree]) / (graph.width * graph.height)
        for graph, at in zip((one, other), points, strict=True)))


def _hull(points: NDArray[np.float64]) -> float:
    """Return the area of the convex hull of some points, square pixels."""
    if not len(points):
        return 0.0
    return float(cv2.contourArea(cv2.convexHull(points.astype(np.float32))))


def matched_points(one: MultiTierGraph, other: MultiTierGraph
                   ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where matched features are in both frames, (k, 2) each, pixels."""
    first, second, _ = mutual(lanes(one.descriptor[one.object_count:]),
                              lanes(other.descriptor[other.object_count:]), MAX_HAMMING)
    return (one.position[one.object_count + first].astype(np.float64),
            other.position[other.object_count + second].astype(np.float64))


def _fundamental(points: Sequence[NDArray[np.float64]], method: int, threshold_px: float
                 ) -> tuple[NDArray[np.float64] | None, NDArray[np.uint8]]:
    found: tuple[NDArray[np.float64] | None, NDArray[np.uint8]] = cv2.findFundamentalMat(
        *points, method, threshold_px, CONFIDENCE, ROUNDS)
    return found
