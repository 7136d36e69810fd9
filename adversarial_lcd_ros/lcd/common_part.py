# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How much of what two views could have in common they do have in common.

Rooms with the same furniture have many matches, and they agree on one geometry. What tells them
apart is in between: features that lie where both cameras look, and have no counterpart.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.hamming import lanes, mutual
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.geometry import LEAST_MATCHES, MAX_HAMMING

# The surface is no plane: a homography holds to within some pixels.
TOLERANCE_PX = 8.0
# Nearer to the border the other view has no features: their patches need room.
MARGIN_PX = 15.0
# Few features in common prove little, however many of them match.
LEAST_FEATURES = 20


def share_in_common(one: MultiTierGraph, other: MultiTierGraph) -> float:
    """
    Return the share of the features in the common part of two views that match in place, 0 to 1.

    The common part is what a homography, found from matches of mutual nearest neighbours within
    64 of 256 bits by RHO with fixed draws, maps into the other picture; matches count within 8
    pixels of it. The share is over the geometric mean of both views' features there. Edges are
    not looked at.
    """
    first, second, _ = mutual(lanes(one.descriptor[one.object_count:]),
                              lanes(other.descriptor[other.object_count:]), MAX_HAMMING)
    if len(first) < LEAST_MATCHES:
        return 0.0
    here, there = (graph.position[graph.object_count:].astype(np.float64)
                   for graph in (one, other))
    mapping, inlier = cv2.findHomography(here[first], there[second], cv2.RHO, TOLERANCE_PX)
    # None where the matches determine none, as those on one line.
    if mapping is None or abs(np.linalg.det(mapping)) < np.finfo(float).tiny:
        return 0.0
    seen = [max(LEAST_FEATURES, _inside(mapped, graph))
            for mapped, graph in ((_mapped(here, mapping), other),
                                  (_mapped(there, np.linalg.inv(mapping)), one))]
    return min(1.0, float(np.count_nonzero(inlier) / np.sqrt(seen[0] * seen[1])))


def _mapped(points: NDArray[np.float64], mapping: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where a homography takes points, (k, 2); what it takes behind the camera is NaN."""
    ahead = points @ mapping[2, :2] + mapping[2, 2]
    ahead[ahead * np.sign(mapping[2, 2]) <= 0] = np.nan
    return np.asarray((points @ mapping[:2, :2].T + mapping[:2, 2]) / ahead[:, None])


def _inside(points: NDArray[np.float64], graph: MultiTierGraph) -> int:
    high = np.array([graph.width, graph.height]) - MARGIN_PX
    return int(np.count_nonzero(((points >= MARGIN_PX) & (points <= high)).all(axis=1)))
