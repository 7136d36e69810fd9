# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Odometry: the true steps of the camera, with the drift that a real one has.

The tours have ground truth and no odometry. An error model in its place can be turned up, drawn
as often as one likes, and told to the back end as it is, which a recorded odometry cannot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import MapConfig
from adversarial_lcd_ros.slam.motions import Motions, angles_rad, between, lengths_m, moved

# A back end divides by sigmas: no step is known better than this, radians and metres.
_LEAST_SIGMA = 1e-6


@dataclass(frozen=True, eq=False)
class Odometry:
    """
    What an odometry says of n frames.

    Attributes
    ----------
    steps : float64, (n - 1, 4, 4)
        Every frame as seen from the one before.
    sigma : float64, (n - 1, 6)
        What a back end is told of their errors: standard deviations, radians and metres.

    """

    steps: Motions
    sigma: NDArray[np.float64]


def drifting(truth: Motions, config: MapConfig, drift: float,
             rng: np.random.Generator) -> Odometry:
    """
    Return one draw of an odometry along a true path.

    Every axis of a step errs by a constant plus a share of the step, Gaussian: independently at
    every step, or (model "biased") by one draw for the whole run, which adds up.

    Parameters
    ----------
    truth : float64, (n, 4, 4)
        Camera to world.
    config : MapConfig
    drift : float
        Multiplies all errors. The back end is told (``config.trust`` 1).
    rng : numpy.random.Generator

    """
    steps = between(truth[:-1], truth[1:])
    rotation = (np.radians(config.drift_rotation_deg)
                + config.drift_rotation_share * angles_rad(steps))
    translation = (config.drift_translation_m
                   + config.drift_translation_share * lengths_m(steps))
    sigma = drift * np.repeat(np.stack([rotation, translation], axis=1), 3, axis=1)
    rows = 1 if config.drift_model == 'biased' else len(steps)
    return Odometry(moved(steps, sigma * rng.standard_normal((rows, 6))),
                    np.maximum(sigma * config.trust, _LEAST_SIGMA))
