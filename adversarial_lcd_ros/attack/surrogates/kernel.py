# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The width of a kernel: gamma as the paper writes it, or as scikit-learn scales it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SMALLEST_VARIANCE = 1e-12


@dataclass(frozen=True)
class Kernel:
    """
    Which gamma a kernel on standardised features gets.

    Attributes
    ----------
    rule : str
        paper: 1 / (2 sigma^2) of Eq. (8). scale: 1 / (d Var), scikit-learn's 'scale', d the
        number of features and Var the variance over all of their entries.
    sigma : float
        Rule paper: sigma; 0: the root of the features' summed variance, which is what squared
        distances grow with. Unless some features are constant that is sqrt(d), and this gamma is
        half of 'scale'.

    """

    rule: str = 'paper'
    sigma: float = 0.0

    def gamma(self, features: NDArray[np.float64]) -> float:
        """Return gamma for standardised training features, shape (k, d)."""
        if self.rule == 'scale':
            width = features.shape[1] * float(features.var())
        else:
            width = 2 * (self.sigma * self.sigma or float(features.var(axis=0).sum()))
        return float(1 / max(width, SMALLEST_VARIANCE))
