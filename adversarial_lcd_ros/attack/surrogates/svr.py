# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Support vector regression with an RBF kernel."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from sklearn.svm import SVR

from adversarial_lcd_ros.attack.surrogates.regressor import Regressor


class SupportVectorRegression(Regressor):
    """Predicts the gain; C = 1, a band of a tenth of a standard deviation."""

    name: ClassVar[str] = 'svr'
    title: ClassVar[str] = 'SVR'

    def _make(self, scaled: NDArray[np.float64]) -> SVR:
        return SVR(kernel='rbf', gamma=self._kernel.gamma(scaled))
