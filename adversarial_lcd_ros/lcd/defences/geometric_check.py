# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A loop stands only if the features of both frames agree on one camera motion."""

from __future__ import annotations

from typing import ClassVar

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.defences.base import Defence
from adversarial_lcd_ros.lcd.geometry import find_inliers


class GeometricCheck(Defence):
    """
    Matches that fit one fundamental matrix, over the least number asked for.

    Where ``geometric_hull`` is set, their convex hull also has to cover that share of both
    frames: one poster in two places is in one corner of them.
    """

    name: ClassVar[str] = 'geometric_check'

    def support(self, query: MultiTierGraph, match: MultiTierGraph) -> float:
        """Return the share of the inliers that are needed, or of the hull if that is less."""
        found = find_inliers(query, match, self.config.geometric_threshold_px)
        enough = found.count / self.config.geometric_inliers
        if not self.config.geometric_hull:
            return enough
        return min(enough, found.cover / self.config.geometric_hull)
