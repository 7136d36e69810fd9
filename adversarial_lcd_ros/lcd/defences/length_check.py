# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An edge recurs only if it is about as long in both frames."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.defences.base import Defence
from adversarial_lcd_ros.lcd.views import Comparison, View


class LengthCheck(Defence):
    """
    Between matched features: the longer length at most a factor of the shorter, and a slack.

    Lengths are from the positions of nodes, not those that edges carry. Matches by descriptor
    are now and then wrong, and lie anywhere in the frame: pairs of them are what an attacker
    joins to make two places alike. Between two views of a place lengths agree.
    """

    name: ClassVar[str] = 'length_check'

    def compare(self, nodes: Comparison) -> Comparison:
        """Return the comparison without edges that differ in length."""
        return nodes.with_credit(self._agree)

    def _agree(self, query: View, reference: View, pairs: NDArray[np.int64],
               edges: NDArray[np.int64]) -> NDArray[np.bool_]:
        here, there = query.graph.length_between(pairs), reference.graph.length_between(edges)
        longest = self.config.length_factor * np.minimum(here, there) + self.config.length_slack
        agree: NDArray[np.bool_] = np.maximum(here, there) <= longest
        return agree
