# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the surrogates that predict the gain itself have in common."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.preprocessing import StandardScaler

from adversarial_lcd_ros.attack.surrogates.base import Surrogate
from adversarial_lcd_ros.attack.surrogates.scaling import standardise

MIN_ROWS = 10


class Regressor(Surrogate):
    """
    Predicts the gain in attack loss.

    Features and gains are standardised on the rows of each fit: a flip gains a thousandth of a
    logit where one counts, and penalties and insensitive bands are made for a spread of one.
    """

    def fit(self, features: NDArray[np.float64], gain: NDArray[np.float64]) -> bool:
        """Learn; needs ten rows whose gains are not all the same."""
        if len(gain) < MIN_ROWS or np.ptp(gain) == 0:
            return False
        self._scaler = StandardScaler().fit(features)
        scaled = standardise(self._scaler, features)
        self._model = self._make(scaled)
        self._mean, self._deviation = float(gain.mean()), float(gain.std())
        self._model.fit(scaled, (gain - self._mean) / self._deviation)
        return True

    def predict(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the gain in standard deviations from that of the training rows, shape (k,)."""
        gain: NDArray[np.float64] = self._model.predict(standardise(self._scaler, features))
        return gain

    @abstractmethod
    def _make(self, scaled: NDArray[np.float64]) -> Any:
        """Return an untrained model for standardised features."""
