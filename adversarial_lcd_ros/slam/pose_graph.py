# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pose graph: odometry and closures, as gtsam's factors and as a g2o file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
import tempfile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.files.reading import read_bytes
from adversarial_lcd_ros.files.writing import write_bytes
from adversarial_lcd_ros.slam.closures import Closures
from adversarial_lcd_ros.slam.library import gtsam
from adversarial_lcd_ros.slam.motions import Motions, chained
from adversarial_lcd_ros.slam.odometry import Odometry

# The first pose is where it is: without it nothing says where the map lies.
ANCHOR_SIGMA = 1e-4


@dataclass(frozen=True, eq=False)
class PoseGraph:
    """
    What a back end gets: n poses, n - 1 steps and k closures.

    Attributes
    ----------
    start : float64, (4, 4)
        Pose of the first frame.
    odometry : Odometry
    closures : Closures

    """

    start: NDArray[np.float64]
    odometry: Odometry
    closures: Closures

    def first(self, frames: int) -> PoseGraph:
        """Return the graph as it was after some frames, at least one."""
        odometry = Odometry(self.odometry.steps[:frames - 1], self.odometry.sigma[:frames - 1])
        return PoseGraph(self.start, odometry, self.closures.before(frames))

    @property
    def dead_reckoning(self) -> Motions:
        """Return the poses by odometry alone, (n, 4, 4)."""
        return chained(self.start, self.odometry.steps)


@dataclass(frozen=True, eq=False)
class Factors:
    """
    A pose graph in gtsam's terms.

    Attributes
    ----------
    graph : gtsam.NonlinearFactorGraph
        The anchor of the first pose, the steps, and from ``closures_from`` on the closures.
    initial : gtsam.Values
        The poses by odometry alone.
    closures_from : int

    """

    graph: Any
    initial: Any
    closures_from: int


def factors_of(pose_graph: PoseGraph, robust: Callable[[Any], Any] = lambda noise: noise,
               *, anchored: bool = True) -> Factors:
    """
    Return the factors of a pose graph.

    Parameters
    ----------
    pose_graph : PoseGraph
    robust : callable
        Returns the noise of a closure from its Gaussian one; steps stay Gaussian.
    anchored : bool
        Hold the first pose.

    """
    library = gtsam()
    graph, initial = library.NonlinearFactorGraph(), library.Values()
    for number, pose in enumerate(pose_graph.dead_reckoning):
        initial.insert(number, library.Pose3(pose))
    if anchored:
        graph.add(library.PriorFactorPose3(
            0, library.Pose3(pose_graph.start),
            library.noiseModel.Isotropic.Sigma(6, ANCHOR_SIGMA)))
    odometry, closures = pose_graph.odometry, pose_graph.closures
    for number, (step, sigma) in enumerate(zip(odometry.steps, odometry.sigma, strict=True)):
        graph.add(library.BetweenFactorPose3(number, number + 1, library.Pose3(step),
                                             library.noiseModel.Diagonal.Sigmas(sigma)))
    begin = graph.size()
    for match, query, relative, sigma in zip(closures.pairs.match, closures.pairs.query,
                                             closures.relative, closures.sigma, strict=True):
        graph.add(library.BetweenFactorPose3(
            int(match), int(query), library.Pose3(relative),
            robust(library.noiseModel.Diagonal.Sigmas(sigma))))
    return Factors(graph, initial, begin)


def poses_of(values: Any) -> Motions:
    """Return the poses (n, 4, 4) in gtsam's values, in order of their keys."""
    rows = gtsam().utilities.extractPose3(values)
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rows[:, :9].reshape(-1, 3, 3), rows[:, 9:]
    return poses


def write_g2o(path: Path, pose_graph: PoseGraph) -> None:
    """
    Write a pose graph as g2o: VERTEX_SE3:QUAT by odometry, EDGE_SE3:QUAT with information.

    No vertex is fixed: readers hold the first one. Closures are the edges between vertices that
    do not follow one another; which of them are false is not in the file.

    Raises
    ------
    FileError
        The file cannot be written.

    """
    factors = factors_of(pose_graph, anchored=False)
    with tempfile.TemporaryDirectory() as folder:
        draft = Path(folder) / 'graph.g2o'
        gtsam().writeG2o(factors.graph, factors.initial, str(draft))
        write_bytes(path, read_bytes(draft))
