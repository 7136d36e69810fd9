# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How far a map is off, after the rigid motion that lays it best over the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.slam.motions import Motions, angles_rad, between, lengths_m


@dataclass(frozen=True)
class RelativeError:
    """Root mean square error over pairs of frames a fixed number of frames apart."""

    translation_m: float
    rotation_deg: float


def aligned(poses: Motions, truth: Motions) -> Motions:
    """
    Return the poses, moved as a whole so that their positions lie best over the true ones.

    Rotation and translation without scale, by least squares (Horn 1987; Umeyama 1991).

    Parameters
    ----------
    poses, truth : float64, (n, 4, 4)

    """
    here, there = poses[:, :3, 3].mean(axis=0), truth[:, :3, 3].mean(axis=0)
    turn = _rotation(poses[:, :3, 3] - here, truth[:, :3, 3] - there)
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = turn, there - turn @ here
    laid: Motions = motion @ poses
    return laid


def _rotation(source: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    if len(source) < 2 or not source.any() or not target.any():
        return np.eye(3)  # any rotation is as good
    turn, _ = Rotation.align_vectors(target, source)
    matrix: NDArray[np.float64] = turn.as_matrix()
    return matrix


def errors_m(poses: Motions, truth: Motions) -> NDArray[np.float64]:
    """Return the distance of every position from the true one after alignment, (n,), metres."""
    off: NDArray[np.float64] = np.linalg.norm(
        (aligned(poses, truth) - truth)[:, :3, 3], axis=1)
    return off


def absolute_error_m(poses: Motions, truth: Motions) -> float:
    """
    Return the absolute trajectory error, metres: the root mean square of ``errors_m``.

    Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems, IROS 2012; aligned by
    SE(3), scale untouched.
    """
    return float(np.sqrt(np.mean(errors_m(poses, truth) ** 2)))


def relative_error(poses: Motions, truth: Motions, frames: int) -> RelativeError | None:
    """
    Return the relative pose error (Sturm et al. 2012) over all pairs that far apart.

    Parameters
    ----------
    poses, truth : float64, (n, 4, 4)
    frames : int
        From the first to the second of a pair; None is returned where no pair is.

    """
    if len(poses) <= frames:
        return None
    off = between(between(truth[:-frames], truth[frames:]), between(poses[:-frames],
                                                                    poses[frames:]))
    return RelativeError(float(np.sqrt(np.mean(lengths_m(off) ** 2))),
                         float(np.degrees(np.sqrt(np.mean(angles_rad(off) ** 2)))))
