# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Back ends: what makes a map of odometry and closures, some of which may be false.

All start from odometry alone and minimise by Levenberg-Marquardt. Least squares believes every
closure. Huber and Cauchy weigh down a closure the further it is off. Graduated non-convexity
(Yang et al., RA-L 2020; truncated least squares) decides which closures to leave out. Steps of
the odometry are believed by all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import BACK_ENDS, MapConfig
from adversarial_lcd_ros.slam.library import gtsam
from adversarial_lcd_ros.slam.motions import Motions
from adversarial_lcd_ros.slam.pose_graph import Factors, PoseGraph, factors_of, poses_of

LEAST_SQUARES, HUBER, CAUCHY, GNC = BACK_ENDS
# A closure that counts for less than a tenth of what it would in least squares was rejected.
KEPT_WEIGHT = 0.1


@dataclass(frozen=True, eq=False)
class Solution:
    """
    A map.

    Attributes
    ----------
    poses : float64, (n, 4, 4)
        Camera to world.
    weight : float64, (k,)
        What the back end gave each closure in the end, 0 to 1.
    duration_s : float

    """

    poses: Motions
    weight: NDArray[np.float64]
    duration_s: float

    @property
    def kept(self) -> NDArray[np.bool_]:
        """Tell which closures were kept, (k,)."""
        kept: NDArray[np.bool_] = self.weight >= KEPT_WEIGHT
        return kept


def solve(pose_graph: PoseGraph, back_end: str, config: MapConfig) -> Solution:
    """
    Return the map that a back end makes of a pose graph.

    Parameters
    ----------
    pose_graph : PoseGraph
    back_end : str
        One of ``BACK_ENDS``.
    config : MapConfig

    Raises
    ------
    ConfigError
        gtsam is missing.

    """
    began_s = time.perf_counter()
    if back_end == GNC:
        values, weight = _graduated(pose_graph, config)
    else:
        values, weight = _weighed(pose_graph, estimator(back_end, config))
    return Solution(poses_of(values), weight, time.perf_counter() - began_s)


def estimator(back_end: str, config: MapConfig) -> Any | None:
    """Return gtsam's estimator of a back end that weighs closures; None for least squares."""
    kinds = gtsam().noiseModel.mEstimator
    if back_end == HUBER:
        return kinds.Huber.Create(config.huber)
    return kinds.Cauchy.Create(config.cauchy) if back_end == CAUCHY else None


def robust_noise(kind: Any | None) -> Callable[[Any], Any]:
    """Return what makes the noise of a closure from its Gaussian one."""
    if kind is None:
        return lambda noise: noise
    return lambda noise: gtsam().noiseModel.Robust.Create(kind, noise)


def _weighed(pose_graph: PoseGraph, kind: Any | None) -> tuple[Any, NDArray[np.float64]]:
    factors = factors_of(pose_graph, robust_noise(kind))
    library = gtsam()
    values = library.LevenbergMarquardtOptimizer(
        factors.graph, factors.initial, library.LevenbergMarquardtParams()).optimize()
    if kind is None:
        return values, np.ones(len(pose_graph.closures.pairs))
    distance = _distances(factors_of(pose_graph), values)
    return values, np.array([kind.weight(off) for off in distance])


def _distances(factors: Factors, values: Any) -> NDArray[np.float64]:
    """Return how far every closure is off, (k,), in its standard deviations."""
    return np.array([np.sqrt(2 * factors.graph.at(number).error(values))
                     for number in range(factors.closures_from, factors.graph.size())])


def _graduated(pose_graph: PoseGraph, config: MapConfig) -> tuple[Any, NDArray[np.float64]]:
    library, factors = gtsam(), factors_of(pose_graph)
    settings = library.GncLMParams(library.LevenbergMarquardtParams())
    settings.setLossType(library.GncLossType.TLS)
    settings.setKnownInliers(list(range(factors.closures_from)))
    optimizer = library.GncLMOptimizer(factors.graph, factors.initial, settings)
    optimizer.setInlierCostThresholdsAtProbability(config.gnc_probability)
    values = optimizer.optimize()
    weight = np.asarray(optimizer.getWeights(), np.float64)
    return values, weight[factors.closures_from:]
