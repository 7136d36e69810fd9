# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Choices of flips by name (registry.py). A new one is one small file and one line there."""

from __future__ import annotations

from adversarial_lcd_ros.attack.perturbations.base import Allowed, Perturbation
from adversarial_lcd_ros.registry import PERTURBATIONS

__all__ = ['PERTURBATIONS', 'Allowed', 'Perturbation', 'make_perturbation']


def make_perturbation(name: str) -> Perturbation:
    """Return the perturbation of that name; raises ConfigError."""
    perturbation: Perturbation = PERTURBATIONS.find(name)()
    return perturbation
