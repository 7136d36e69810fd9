# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the surrogates that classify have in common."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.preprocessing import StandardScaler

from adversarial_lcd_ros.attack.surrogates.base import Surrogate
from adversarial_lcd_ros.attack.surrogates.scaling import standardise

MIN_ROWS = 10


class Classifier(Surrogate):
    """
    Classifies whether a flip raises the attack loss; how surely it does ranks the flips.

    The paper leaves the label open; here it is the sign of the gain, and flips without any
    effect count as no gain. Features are standardised on the rows of each fit, classes weigh the
    same.
    """

    def fit(self, features: NDArray[np.float64], gain: NDArray[np.float64]) -> bool:
        """Learn; needs ten rows and both signs."""
        label = gain > 0
        if len(label) < MIN_ROWS or label.all() or not label.any():
            return False
        self._scaler = StandardScaler().fit(features)
        scaled = standardise(self._scaler, features)
        self._model = self._make(scaled)
        self._model.fit(scaled, label)
        return True

    def predict(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a score that grows with the certainty of a gain, shape (k,)."""
        return self._score(standardise(self._scaler, features))

    @abstractmethod
    def _make(self, scaled: NDArray[np.float64]) -> Any:
        """Return an untrained model for standardised features."""

    def _score(self, scaled: NDArray[np.float64]) -> NDArray[np.float64]:
        distance: NDArray[np.float64] = self._model.decision_function(scaled)
        return distance
