"""The geometric check of a match: whether the features of both frames agree on one motion."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.hamming import lanes, mutual
from adversarial_lcd_ros.graph import MultiTierGraph

MAX_HAMMING = 64
# A fundamental matrix takes seven matches; eight is the first number that can disagree.
LEAST_MATCHES = 8
CONFIDENCE, ROUNDS = 0.999, 1000


def count_inliers(one: MultiTierGraph, other: MultiTierGraph, threshold_px: float) -> int:
    """
    Return how many matched features of two frames fit one fundamental matrix.

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
        return 0
    try:
        matrix, inlier = _fundamental(points, cv2.USAC_DEFAULT, threshold_px)
    except cv2.error:
        # On some planar scenes USAC refines an empty matrix and raises; RANSAC does not refine.
        matrix, inlier = _fundamental(points, cv2.FM_RANSAC, threshold_px)
    # None where the matches determine no matrix, as unrelated ones on one line.
    return 0 if matrix is None else int(np.count_nonzero(inlier))


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
