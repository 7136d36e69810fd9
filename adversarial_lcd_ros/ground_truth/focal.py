# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The focal length of a camera that nobody calibrated, from true poses and matches."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.ground_truth.motion_depth import Camera, inverse_depth
from adversarial_lcd_ros.ground_truth.view_features import ViewFeatures, match

# Tried: focal lengths over the image width, a wide fisheye to a long lens.
TRIED = np.geomspace(0.4, 2.0, 162)
# Frames looked at, each with a later one that has turned by about so much.
_FRAMES, _TURN_DEG, _LEAST_TURN_DEG, _WITHIN_S = 60, 10.0, 4.0, 4.0
_BITS, _TOLERANCE_PX = 40, 2.0
# The best must explain this share more matches than the worst, and so many in all.
_PEAK, _LEAST_MATCHES = 1.1, 200


@dataclass(frozen=True)
class Focal:
    """A focal length over the image width, and where it is from, in words."""

    share: float
    source: str


def measure_focal(features: ViewFeatures, camera: Camera) -> float | None:
    """
    Return the focal length over the image width that explains most matches.

    Frames that follow each other closely are matched; how far a point moves when the camera
    turns tells the focal length.

    Parameters
    ----------
    features : ViewFeatures
    camera : Camera
        Its focal length is not used.

    Returns
    -------
    float or None
        None: the camera hardly turns, or matches agree with no focal length better than with
        others.

    """
    pairs = _turning_pairs(camera)
    agreeing = np.zeros(len(TRIED), np.int64)
    for one, other in pairs:
        own, matched = match(features, one, other, _BITS)
        if len(own):
            agreeing += _agreeing(camera, one, other, features.position[one, own],
                                  features.position[other, matched])
    if agreeing.max() < _LEAST_MATCHES or agreeing.max() < _PEAK * agreeing.min():
        return None
    # The middle of the peak: its tip is flat, and noisy.
    top = agreeing >= 0.98 * agreeing.max()
    return float(np.average(TRIED[top], weights=agreeing[top]))


def _agreeing(camera: Camera, one: int, other: int, own: NDArray[np.float32],
              matched: NDArray[np.float32]) -> NDArray[np.int64]:
    return np.array([np.isfinite(inverse_depth(
        replace(camera, focal=share * camera.width), one, other, own, matched,
        _TOLERANCE_PX)[1]).sum() for share in TRIED], np.int64)


def _turning_pairs(camera: Camera) -> list[tuple[int, int]]:
    pairs = []
    located = np.flatnonzero(camera.located)
    for one in located[np.linspace(0, len(located) - 1, min(_FRAMES, len(located))).astype(int)]:
        later = located[(located > one)
                        & (camera.time_s[located] <= camera.time_s[one] + _WITHIN_S)]
        trace = np.einsum('nij,ij->n', camera.turn[later], camera.turn[one])
        angle = np.degrees(np.arccos(np.clip((trace - 1) / 2, -1, 1)))
        fit = np.flatnonzero(angle >= _LEAST_TURN_DEG)
        if len(fit):
            best = fit[np.argmin(np.abs(angle[fit] - _TURN_DEG))]
            pairs.append((int(one), int(later[best])))
    return pairs
