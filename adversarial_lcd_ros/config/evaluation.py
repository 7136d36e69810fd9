# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings of what figures are made with: labels, and maps of the closures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from adversarial_lcd_ros.config.base import Config, setting
from adversarial_lcd_ros.errors import ConfigError


@dataclass(frozen=True)
class LabelConfig(Config):
    """Which pairs of frames are a loop, from ground truth only (docs/labels.md)."""

    title: ClassVar[str] = 'labels'

    rule: str = setting(
        'auto', 'How two views are judged: by co-visibility or depth images where they lie '
        'beside the recording, else by an audit (auto); by what can be shown in the pictures '
        'under the true poses (audit); or from poses alone, by the overlap that they may have '
        '(overlap) or by distance and angle (distance).',
        choices=('auto', 'audit', 'overlap', 'distance'))
    loop_share: float = setting(
        0.5, 'Auto: least share of a loop, of the surface of either view, that the other sees.',
        low=0.0, high=1.0)
    shared_share: float = setting(
        0.3, 'Auto: least share, of the surface of one of two views, at which a match is right; '
        'where the other has less in common, it is a change of scale.', low=0.0, high=1.0)
    elsewhere_share: float = setting(
        0.1, 'Auto: pairs of which either view shares less are different places, and a match '
        'that names one is wrong.', low=0.0, high=1.0)
    positive_overlap: float = setting(
        0.6, 'Least view overlap of a loop, seen from both sides.', low=0.0, high=1.0)
    possible_overlap: float = setting(
        0.4, 'View overlap, seen from both sides, below which a match is wrong, a camera has '
        'looked elsewhere, and a frame that has no other candidates is at a new place.',
        low=0.0, high=1.0)
    negative_overlap: float = setting(
        0.1, 'Pairs whose view overlap is below this from either side are different places; '
        'the band between is left out.', low=0.0, high=1.0)
    positive_distance_m: float = setting(
        0.5, 'Largest distance of a loop, metres (also under the overlap rule).',
        low=0.0, high=1e3)
    positive_angle_deg: float = setting(
        25.0, 'Largest angle of a loop, degrees (also under the overlap rule).',
        low=0.0, high=180.0)
    negative_distance_m: float = setting(
        2.0, 'Distance rule: two views are different places from this distance on, metres.',
        low=0.0, high=1e6)
    negative_angle_deg: float = setting(
        60.0, 'Distance rule: or from this angle on, degrees.', low=0.0, high=180.0)
    positive_index: int = setting(
        2, 'Ground truth by index: largest difference of a loop.', low=0, high=10_000)
    negative_index: int = setting(
        10, 'Ground truth by index: least difference of two places.', low=1, high=100_000)
    min_gap_s: float = setting(
        8.0, 'A loop joins frames at least this far apart in time, seconds.',
        low=0.0, high=1e6)
    pose_tolerance_s: float = setting(
        0.05, 'Largest offset in time between a frame and its ground truth pose, seconds.',
        low=0.0, high=1e3)
    focal_length: float = setting(
        0.82, 'Focal length over the image width (TUM: 525 / 640).', low=0.1, high=10.0)

    def __post_init__(self) -> None:
        """Check the ranges, and that no pair can be a loop and two places at once."""
        super().__post_init__()
        ascending = (('negative_overlap', 'possible_overlap'),
                     ('possible_overlap', 'positive_overlap'),
                     ('elsewhere_share', 'shared_share'),
                     ('shared_share', 'loop_share'),
                     ('positive_distance_m', 'negative_distance_m'),
                     ('positive_angle_deg', 'negative_angle_deg'),
                     ('positive_index', 'negative_index'))
        for low, high in ascending:
            if getattr(self, low) >= getattr(self, high):
                raise ConfigError(f'LabelConfig.{low} = {getattr(self, low)}: expected less than '
                                  f'{high} = {getattr(self, high)}')


@dataclass(frozen=True)
class MapConfig(Config):
    """What closures do to a map: odometry, front end and back ends (docs/map.md)."""

    title: ClassVar[str] = 'map'

    drift_model: str = setting(
        'independent', 'Errors of the odometry: drawn at every step (independent), or once for '
        'the whole run (biased).', choices=('independent', 'biased'))
    drift_rotation_deg: float = setting(
        0.2, 'Odometry: standard deviation of a step about each axis, degrees.',
        low=0.0, high=180.0)
    drift_rotation_share: float = setting(
        0.01, 'Odometry: and this share of the rotation of the step.', low=0.0, high=10.0)
    drift_translation_m: float = setting(
        0.002, 'Odometry: standard deviation of a step along each axis, metres.',
        low=0.0, high=1e3)
    drift_translation_share: float = setting(
        0.02, 'Odometry: and this share of the length of the step.', low=0.0, high=10.0)
    trust: float = setting(
        1.0, 'What a back end takes the errors of the odometry for, as a multiple of what they '
        'are.', low=1e-3, high=1e3)
    right_claim: str = setting(
        'noisy_truth', 'Relative pose that a right closure claims: the true one with noise '
        '(noisy_truth), or that of the essential matrix of the features (essential).',
        choices=('noisy_truth', 'essential'))
    false_claim: str = setting(
        'identity', 'Relative pose that a false closure claims: the camera is where it was '
        '(identity); all of a run by one displacement, that of the first, as views of a sheet '
        'that hangs in two places do (consistent); or that of the essential matrix of the '
        'features (essential).', choices=('identity', 'consistent', 'essential'))
    closure_rotation_deg: float = setting(
        1.0, 'Closures: standard deviation about each axis, degrees.', low=1e-3, high=180.0)
    closure_translation_m: float = setting(
        0.05, 'Closures: standard deviation along each axis, metres.', low=1e-6, high=1e3)
    scene_depth_m: float = setting(
        2.0, 'Claim essential: depth of the scene that gives the translation its length, metres.',
        low=1e-3, high=1e4)
    essential_threshold_px: float = setting(
        3.0, 'Claim essential: largest distance of a match from its epipolar line, pixels.',
        low=0.01, high=1000.0)
    huber: float = setting(
        1.345, 'Back end huber: standard deviations from which on a closure counts less.',
        low=1e-3, high=1e6)
    cauchy: float = setting(
        2.385, 'Back end cauchy: standard deviations at which a closure counts half.',
        low=1e-3, high=1e6)
    gnc_probability: float = setting(
        0.99, 'Back end gnc: share of right closures that its bound on errors lets pass.',
        low=0.5, high=0.999999)
    rpe_s: float = setting(
        1.0, 'Relative pose error: over pairs of frames this far apart, seconds.',
        low=1e-3, high=1e6)
    young_frames: int = setting(
        0, 'Frames of the young map; 0: up to the first frame that by ground truth has a loop.',
        low=0, high=1_000_000)
    draws: int = setting(
        5, 'Draws of the odometry; intervals are over them.', low=1, high=1000)
    seed: int = setting(42, 'Seed of all draws.', low=0, high=2**31 - 1)
