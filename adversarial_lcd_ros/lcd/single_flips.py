# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""All single flips of a graph, and what scores them at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.flip_kernels import Moments
from adversarial_lcd_ros.lcd.views import Comparison, View


@dataclass(frozen=True)
class Flips:
    """
    Single flips of a graph: (k, 2) pairs, which of them are edges, and their lengths.

    ``changed`` holds the nodes whose edges differ from those of the graph before, if that was
    asked about the same pairs; else None.
    """

    view: View
    pairs: NDArray[np.int64]
    present: NDArray[np.bool_]
    length: NDArray[np.float32]
    moments: Moments
    changed: NDArray[np.int64] | None


class FlipChannel(Protocol):
    """One score of a target, averaged over each candidate's window."""

    def __init__(self, base: View, nodes: Comparison, average: NDArray[np.float64]) -> None:
        """
        Learn what flips leave alone.

        Parameters
        ----------
        base : View
            A graph with the nodes of those whose flips are scored.
        nodes : Comparison
            Its nodes beside r references.
        average : float64, (candidates, r)
            Weight of each reference in the window of each candidate.

        """
        ...

    def after(self, flips: Flips) -> NDArray[np.float64]:
        """Return the score after each single flip, shape (k, candidates)."""
        ...
