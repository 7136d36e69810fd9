# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rigid motions as 4 x 4 matrices, many at once; tangents are rotation vector, then metres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.poses.trajectory import Trajectory

Motions = NDArray[np.float64]  # (n, 4, 4)


def from_parts(rotation: NDArray[np.float64], translation: NDArray[np.float64]) -> Motions:
    """Return motions of rotations (n, 3, 3) and translations (n, 3), metres."""
    motions = np.tile(np.eye(4), (len(translation), 1, 1))
    motions[:, :3, :3], motions[:, :3, 3] = rotation, translation
    return motions


def of_trajectory(trajectory: Trajectory) -> Motions:
    """Return camera to world for every pose of a trajectory."""
    return from_parts(Rotation.from_quat(trajectory.quaternion).as_matrix(), trajectory.position)


def inverse(motions: Motions) -> Motions:
    """Return the inverse of every motion."""
    back = motions[:, :3, :3].transpose(0, 2, 1)
    return from_parts(back, -np.einsum('nij,nj->ni', back, motions[:, :3, 3]))


def between(first: Motions, second: Motions) -> Motions:
    """Return the second poses as seen from the first ones."""
    seen: Motions = inverse(first) @ second
    return seen


def chained(start: NDArray[np.float64], steps: Motions) -> Motions:
    """Return the poses (n + 1, 4, 4) that n steps lead through from a start (4, 4)."""
    poses = np.empty((len(steps) + 1, 4, 4))
    poses[0] = start
    for number, step in enumerate(steps):
        poses[number + 1] = poses[number] @ step
    # Products of rotations lose their length after some thousand factors.
    poses[:, :3, :3] = Rotation.from_matrix(poses[:, :3, :3]).as_matrix()
    return poses


def moved(motions: Motions, tangent: NDArray[np.float64]) -> Motions:
    """Return the motions, each followed by a small one: (n, 6), radians and metres."""
    small = from_parts(Rotation.from_rotvec(tangent[:, :3]).as_matrix(), tangent[:, 3:])
    after: Motions = motions @ small
    return after


def angles_rad(motions: Motions) -> NDArray[np.float64]:
    """Return the angle of every rotation, (n,), radians."""
    angle: NDArray[np.float64] = Rotation.from_matrix(motions[:, :3, :3]).magnitude()
    return angle


def lengths_m(motions: Motions) -> NDArray[np.float64]:
    """Return the length of every translation, (n,), metres."""
    length: NDArray[np.float64] = np.linalg.norm(motions[:, :3, 3], axis=1)
    return length
