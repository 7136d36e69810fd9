"""The range of a score that few flips can lead to."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.views import Comparison, View

# Least and largest, (budget + 1, candidates) each.
Range = tuple[NDArray[np.float64], NDArray[np.float64]]


class Bound(Protocol):
    """Bounds one score of a target, averaged over each candidate's window."""

    def __init__(self, query: View, nodes: Comparison, average: NDArray[np.float64]) -> None:
        """
        Take a query with its own edges, its nodes beside references, and windows.

        Parameters
        ----------
        query : View
        nodes : Comparison
        average : float64, (candidates, r)
            Weight of each reference in the window of each candidate.

        """
        ...

    def after(self, budget: int) -> Range:
        """Return the least and the largest score after up to 0, 1, ... budget flips."""
        ...
