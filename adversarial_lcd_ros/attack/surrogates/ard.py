"""Bayesian linear regression with automatic relevance determination, as in GRABNEL."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import ARDRegression

from adversarial_lcd_ros.attack.surrogates.regressor import Regressor

ITERATIONS = 50


class RelevanceDetermination(Regressor):
    """
    A linear gain, each feature with a prior precision of its own; its posterior mean ranks.

    GRABNEL (Wan et al., 2021) maximises the expected improvement instead, over graphs that
    differ in many flips. Its cost is cubic in the features: seconds a fit node by node.
    """

    name: ClassVar[str] = 'ard'
    title: ClassVar[str] = 'Bayesian ARD'

    def _make(self, scaled: NDArray[np.float64]) -> ARDRegression:
        return ARDRegression(max_iter=ITERATIONS)
