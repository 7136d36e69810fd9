# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Defences of the detector by name (registry.py). A new one is one small file and one line."""

from __future__ import annotations

from adversarial_lcd_ros.config import LcdConfig, names_in
from adversarial_lcd_ros.lcd.defences.base import Defence
from adversarial_lcd_ros.registry import DEFENCES, NONE

__all__ = ['DEFENCES', 'Defence', 'defence_names', 'make_defences']


def make_defences(config: LcdConfig) -> list[Defence]:
    """Return the defences of a detector, in the order of its settings; raises ConfigError."""
    return [DEFENCES.find(name)(config) for name in defence_names(config)]


def defence_names(config: LcdConfig) -> list[str]:
    """Return the names of the defences of a detector, in the order of its settings."""
    names = [name for name in names_in(config.defences) if name != NONE]
    if config.geometric_check:
        names.append('geometric_check')
    return list(dict.fromkeys(names))
