# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The range of a score that few flips can lead to."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd import bound_kernels
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


def shared_out(change: NDArray[np.float64], share: NDArray[np.float64],
               node: NDArray[np.int64], levels: NDArray[np.int64], flips: int
               ) -> NDArray[np.float64]:
    """
    Return how far scores can move if flips are shared out best, shape (flips + 1, candidates).

    Parameters
    ----------
    change : float64, (k, l)
        How far each match can move by so many flips at its node, at least 0.
    share : float64, (candidates, k)
        What it counts.
    node : int64, (k,)
        Ascending.
    levels : int64, (l,)
        Numbers of flips, ascending; between two the larger one's bound holds, and none has more
        flips than the last.
    flips : int

    """
    price = np.r_[1, levels[:-1] + 1]
    known, first = np.unique(node, return_index=True)
    moved = np.zeros((flips + 1, len(share)))
    for candidate, weight in enumerate(share):
        worth = (np.add.reduceat(change * weight[:, None], first) if len(known)
                 else np.zeros((0, len(levels))))
        most = np.zeros(flips + 1)
        for row in worth:
            most = bound_kernels.spent(most, price, row)
        moved[:, candidate] = most
    return moved
