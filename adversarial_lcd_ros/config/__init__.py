# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Every setting of the package: default, range, unit and description, once.

Command line options, ROS parameters, YAML files and the documentation are made from these
frozen dataclasses. Field metadata holds what a range check and a help text need.
"""

from __future__ import annotations

from adversarial_lcd_ros.config.base import Config, ConfigT, names_in, setting
from adversarial_lcd_ros.config.evaluation import LabelConfig, MapConfig
from adversarial_lcd_ros.config.nodes import (
    BACK_ENDS,
    POSTERS,
    AttackerNodeConfig,
    BagReplayNodeConfig,
    GraphBuilderNodeConfig,
    LcdNodeConfig,
    MapBuilderNodeConfig,
    ReplayConfig,
)
from adversarial_lcd_ros.config.pipeline import (
    ANCHORS,
    MODES,
    RETRIES,
    TIERS,
    AttackConfig,
    BuilderConfig,
    LcdConfig,
    MessageLimits,
)

__all__ = [
    'ANCHORS',
    'BACK_ENDS',
    'MODES',
    'POSTERS',
    'RETRIES',
    'TIERS',
    'AttackConfig',
    'AttackerNodeConfig',
    'BagReplayNodeConfig',
    'BuilderConfig',
    'Config',
    'ConfigT',
    'GraphBuilderNodeConfig',
    'LabelConfig',
    'LcdConfig',
    'LcdNodeConfig',
    'MapBuilderNodeConfig',
    'MapConfig',
    'MessageLimits',
    'ReplayConfig',
    'names_in',
    'setting',
]
