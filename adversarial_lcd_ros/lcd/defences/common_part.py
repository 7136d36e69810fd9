# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A loop stands only if enough matches of what could match: rooms that look alike contradict."""

from __future__ import annotations

from typing import ClassVar

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.common_part import share_in_common
from adversarial_lcd_ros.lcd.defences.base import Defence


class CommonPart(Defence):
    """Share of the features in the common part of two views that match in place."""

    name: ClassVar[str] = 'common_part'

    def support(self, query: MultiTierGraph, match: MultiTierGraph) -> float:
        """Return the share over the least that is asked for."""
        return share_in_common(query, match) / self.config.common_share
