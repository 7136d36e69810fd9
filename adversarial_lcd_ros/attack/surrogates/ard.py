# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bayesian linear regression with automatic relevance determination, as in GRABNEL."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr
from sklearn.linear_model import ARDRegression

from adversarial_lcd_ros.attack.surrogates.regressor import Regressor
from adversarial_lcd_ros.attack.surrogates.scaling import standardise

ITERATIONS = 50


class RelevanceDetermination(Regressor):
    """
    A linear gain, each feature with a prior precision of its own; its posterior mean ranks.

    GRABNEL (Wan et al., 2021) maximises the expected improvement instead, over graphs that
    differ in many flips (searches/grabnel.py). Its cost is cubic in the features: seconds a fit
    node by node.
    """

    name: ClassVar[str] = 'ard'
    title: ClassVar[str] = 'Bayesian ARD'

    def _make(self, scaled: NDArray[np.float64]) -> ARDRegression:
        return ARDRegression(max_iter=ITERATIONS)

    def expected_improvement(self, features: NDArray[np.float64], best: float
                             ) -> NDArray[np.float64]:
        """
        Return by how much each graph is expected to exceed the best one, if it does, (k,).

        Parameters
        ----------
        features : float64, (k, d)
        best : float
            Largest value so far, in the unit of those learned.

        Returns
        -------
        float64, (k,)
            E[max(y - best, 0)] under the posterior (Jones et al., 1998), in standard deviations
            of the values learned.

        """
        mean, spread = self._model.predict(standardise(self._scaler, features), return_std=True)
        ahead = mean - (best - self._mean) / self._deviation
        ratio = ahead / spread
        density = np.exp(-ratio * ratio / 2) / np.sqrt(2 * np.pi)
        found: NDArray[np.float64] = ahead * ndtr(ratio) + spread * density
        return found
