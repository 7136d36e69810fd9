# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What every surrogate has in common."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.surrogates.kernel import Kernel
from adversarial_lcd_ros.shown import Shown


class Surrogate(Shown, ABC):
    """
    Predicts which of several perturbed graphs has the largest attack loss.

    One of your own is a subclass. Those with a kernel take its width from the one given.
    """

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel

    @abstractmethod
    def fit(self, features: NDArray[np.float64], gain: NDArray[np.float64]) -> bool:
        """
        Learn from queried graphs.

        Parameters
        ----------
        features : float64, (k, d)
            phi of each perturbed graph.
        gain : float64, (k,)
            Its attack loss, less that of the graph before the flip.

        Returns
        -------
        bool
            False where the data do not suffice to learn from.

        """

    @abstractmethod
    def predict(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a score for each row of (k, d) features, larger for a larger loss, (k,)."""
