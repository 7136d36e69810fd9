# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is said of every two frames before time counts: by their poses, or by evidence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LabelConfig
from adversarial_lcd_ros.ground_truth.evidence import Evidence
from adversarial_lcd_ros.ground_truth.overlap import GRID_POINTS, visible_points
from adversarial_lcd_ros.sequences import PLACE_INDEX, Trajectory


@dataclass(frozen=True, eq=False)
class Judgement:
    """
    What is said of every two frames, whatever lies between them in time; symmetric.

    Attributes
    ----------
    near : bool, (n, n)
        A loop but for time.
    possible : bool, (n, n)
        A loop closure may rightly name them.
    scaled : bool, (n, n)
        That by a change of scale.
    wrong : bool, (n, n)
        A loop closure wrongly names them.
    far : bool, (n, n)
        A pair of different places.
    left : bool, (n, n)
        A camera that came from one to the other has left in between.

    """

    near: NDArray[np.bool_]
    possible: NDArray[np.bool_]
    scaled: NDArray[np.bool_]
    wrong: NDArray[np.bool_]
    far: NDArray[np.bool_]
    left: NDArray[np.bool_]


def judge_poses(rows: Trajectory, image_size: tuple[int, int], config: LabelConfig) -> Judgement:
    """
    Return what poses alone say of every two frames, by the rule "distance" or else "overlap".

    Parameters
    ----------
    rows : Trajectory
        One pose a frame.
    image_size : (int, int)
        Width and height, pixels.
    config : LabelConfig
        Thresholds.

    """
    none = np.zeros((len(rows.position),) * 2, bool)
    if rows.frame_id == PLACE_INDEX:
        apart = np.abs(rows.position[:, :1] - rows.position[:, 0])
        possible = apart < config.negative_index
        return Judgement(apart <= config.positive_index, possible, none, ~possible, ~possible,
                         ~possible)
    near, far = _by_distance(rows, config)
    if config.rule == 'distance':
        # Within a room a camera is never far by this rule: to leave is to be no longer near.
        return Judgement(near, ~far, none, far, far, ~near)
    seen = visible_points(rows.position, rows.quaternion, image_size, config.focal_length)
    mutual, either = np.minimum(seen, seen.T), np.maximum(seen, seen.T)
    possible = mutual >= config.possible_overlap * GRID_POINTS
    return Judgement(near & (mutual >= config.positive_overlap * GRID_POINTS), possible, none,
                     ~possible, either < config.negative_overlap * GRID_POINTS, ~possible)


def judge_evidence(evidence: Evidence) -> Judgement:
    """Return what evidence says of every two frames."""
    return Judgement(evidence.loop, evidence.shared, evidence.scaled, evidence.elsewhere,
                     evidence.elsewhere, evidence.left)


def _by_distance(rows: Trajectory,
                 config: LabelConfig) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    count = len(rows.position)
    unit = rows.quaternion / np.linalg.norm(rows.quaternion, axis=1, keepdims=True)
    near, far = np.zeros((count, count), bool), np.zeros((count, count), bool)
    for start in range(0, count, 256):  # bounds the float64 scratch memory
        block = slice(start, start + 256)
        offset = rows.position[block, None, :] - rows.position[None, :, :]
        distance = np.sqrt(np.einsum('ijk,ijk->ij', offset, offset))
        # Rotations are an angle apart of which half has the cosine |q_i . q_j|.
        cosine = np.minimum(np.abs(unit[block] @ unit.T), 1.0)
        angle = np.degrees(2.0 * np.arccos(cosine))
        near[block] = ((distance <= config.positive_distance_m)
                       & (angle <= config.positive_angle_deg))
        far[block] = ((distance >= config.negative_distance_m)
                      | (angle >= config.negative_angle_deg))
    return near, far
