# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Searches by name (registry.py). A new one is one small file and one line in the table."""

from __future__ import annotations

from adversarial_lcd_ros.attack.search import Search
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.registry import SEARCHES

__all__ = ['SEARCHES', 'Search', 'make_search']


def make_search(config: AttackConfig) -> Search:
    """Return the search of an attack; raises ConfigError."""
    search: Search = SEARCHES.find(config.search)(config)
    return search
