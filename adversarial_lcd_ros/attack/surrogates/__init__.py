# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Surrogates by name (registry.py). A new one is one small file and one line in the table."""

from __future__ import annotations

from adversarial_lcd_ros.attack.surrogates.base import Surrogate
from adversarial_lcd_ros.attack.surrogates.kernel import Kernel
from adversarial_lcd_ros.registry import NONE, SURROGATES

__all__ = ['SURROGATES', 'Kernel', 'Surrogate', 'make_surrogate']


def make_surrogate(name: str, kernel: Kernel | None = None) -> Surrogate | None:
    """Return the surrogate of that name, None for "none"; raises ConfigError."""
    if name == NONE:
        return None
    surrogate: Surrogate = SURROGATES.find(name)(kernel or Kernel())
    return surrogate
