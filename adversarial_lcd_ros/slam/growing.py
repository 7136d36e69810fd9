# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A map that grows by a frame at a time (iSAM2, Kaess et al., IJRR 2012), for whoever runs live.

Nothing is told twice: each frame costs what it changes. Graduated non-convexity is not here, since
it weighs all closures anew from the start.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import MapConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.slam.back_ends import estimator, robust_noise
from adversarial_lcd_ros.slam.library import gtsam
from adversarial_lcd_ros.slam.motions import Motions
from adversarial_lcd_ros.slam.pose_graph import ANCHOR_SIGMA, poses_of

# After a closure the whole map moves: one step of Gauss-Newton is not enough.
_MORE_STEPS = 3


class GrowingMap:
    """
    Poses by odometry and closures, optimised after every frame.

    Parameters
    ----------
    back_end : str
        One of ``BACK_ENDS`` but for the last.
    step_sigma, closure_sigma : float64, (6,)
        Standard deviations of every step of the odometry and of every closure, radians and metres.
    config : MapConfig
        Thresholds of the back ends.

    Attributes
    ----------
    poses : float64, (n, 4, 4)
        The map.
    closures : int
        Edges that are no steps.

    """

    def __init__(self, back_end: str, step_sigma: NDArray[np.float64],
                 closure_sigma: NDArray[np.float64], config: MapConfig) -> None:
        self._library = gtsam()
        noise = self._library.noiseModel
        self._isam = self._library.ISAM2(self._library.ISAM2Params())
        self._anchor = noise.Isotropic.Sigma(6, ANCHOR_SIGMA)
        self._step = noise.Diagonal.Sigmas(step_sigma)
        self._closure = robust_noise(estimator(back_end, config))(
            noise.Diagonal.Sigmas(closure_sigma))
        self._last: NDArray[np.float64] | None = None
        self.poses: Motions = np.empty((0, 4, 4))
        self.closures = 0

    def __len__(self) -> int:
        return len(self.poses)

    def add(self, odometry: NDArray[np.float64], match: int | None = None) -> None:
        """
        Add a frame, and optimise.

        Parameters
        ----------
        odometry : float64, (4, 4)
            Its pose by odometry.
        match : int, optional
            The earlier frame where the camera is said to be again.

        Raises
        ------
        EvaluationError
            The map cannot be optimised any more: begin another one.

        """
        library, number = self._library, len(self.poses)
        graph, guess = library.NonlinearFactorGraph(), library.Values()
        if self._last is None:
            guess.insert(0, library.Pose3(odometry))
            graph.add(library.PriorFactorPose3(0, library.Pose3(odometry), self._anchor))
        else:
            step = np.linalg.inv(self._last) @ odometry
            guess.insert(number, library.Pose3(self.poses[-1] @ step))
            graph.add(library.BetweenFactorPose3(number - 1, number, library.Pose3(step),
                                                 self._step))
        if match is not None:
            graph.add(library.BetweenFactorPose3(match, number, library.Pose3(), self._closure))
        try:
            self._isam.update(graph, guess)
            for _ in range(_MORE_STEPS if match is not None else 0):
                self._isam.update()
            self.poses = poses_of(self._isam.calculateEstimate())
        except RuntimeError as error:  # such as a system that determines nothing
            reason = str(error).strip().splitlines()[0]
            raise EvaluationError(f'the map of {number} poses cannot be optimised '
                                  f'({reason}): begin another one') from error
        self._last = odometry
        self.closures += match is not None
