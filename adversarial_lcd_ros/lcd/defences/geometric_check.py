"""A loop stands only if the features of both frames agree on one camera motion."""

from __future__ import annotations

from typing import ClassVar

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.defences.base import Defence
from adversarial_lcd_ros.lcd.geometry import count_inliers


class GeometricCheck(Defence):
    """Matches that fit one fundamental matrix, over the least number asked for."""

    name: ClassVar[str] = 'geometric_check'

    def support(self, query: MultiTierGraph, match: MultiTierGraph) -> float:
        """Return the share of the inliers that are needed."""
        return (count_inliers(query, match, self.config.geometric_threshold_px)
                / self.config.geometric_inliers)
