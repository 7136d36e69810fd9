# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Paths and pose graphs that can be worked out by hand."""

import numpy as np
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.config import MapConfig
from adversarial_lcd_ros.slam.closures import Closures, Pairs
from adversarial_lcd_ros.slam.motions import between, from_parts
from adversarial_lcd_ros.slam.odometry import Odometry
from adversarial_lcd_ros.slam.pose_graph import PoseGraph

# Rotations are all but known: what is left is linear, and done by hand.
SIGMA = np.array([1e-5] * 3 + [0.1] * 3)


def square(side=2, laps=1):
    """Return a walk around a square that always looks one way: a pose each metre, (n, 4, 4)."""
    corner = [(1, 0), (0, 1), (-1, 0), (0, -1)]
    step = np.array([(*way, 0) for _ in range(laps) for way in corner for _ in range(side)], float)
    position = np.concatenate([np.zeros((1, 3)), np.cumsum(step, axis=0)])
    return from_parts(np.tile(np.eye(3), (len(position), 1, 1)), position)


def wavy(count=120, laps=3):
    """Return laps of a bumpy circle on which the camera turns along, (count, 4, 4)."""
    angle = np.linspace(0, 2 * np.pi * laps, count)
    position = np.stack([3 * np.cos(angle), 2 * np.sin(angle), 0.3 * np.sin(3 * angle)], axis=1)
    turn = Rotation.from_euler('zyx', np.stack([angle, 0.1 * np.sin(angle), 0 * angle], axis=1))
    return from_parts(turn.as_matrix(), position)


def pairs(*given):
    """Return pairs of (query, match, is_false)."""
    rows = np.array(given, np.int64).reshape(-1, 3)
    return Pairs(rows[:, 0], rows[:, 1], rows[:, 2].astype(bool))


def closures(truth, given):
    """Return closures of (query, match, is_false): false ones claim identity."""
    found = pairs(*given)
    relative = between(truth[found.match], truth[found.query])
    relative[found.is_false] = np.eye(4)
    return Closures(found, relative, np.tile(SIGMA, (len(found), 1)))


def perfect_graph(truth, given):
    """Return a pose graph whose odometry has no error."""
    steps = between(truth[:-1], truth[1:])
    return PoseGraph(truth[0], Odometry(steps, np.tile(SIGMA, (len(steps), 1))),
                     closures(truth, given))


def quiet(**settings):
    """Return settings of a map."""
    return MapConfig.from_mapping(settings)
