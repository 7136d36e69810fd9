# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""SVM with a polynomial kernel (paper, Table 3)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from sklearn.svm import SVC

from adversarial_lcd_ros.attack.surrogates.classifier import Classifier

DEGREE = 3


class SvmPoly(Classifier):
    """
    The distance from the boundary ranks; (gamma u.v + 1)^3, C = 1.

    The paper gives no degree. Without the 1, scikit-learn's default, the kernel would be odd.
    """

    name: ClassVar[str] = 'svm_poly'
    title: ClassVar[str] = 'SVM-polynomial'
    rank: ClassVar[int] = 1
    dash: ClassVar[str] = '-.'

    def _make(self, scaled: NDArray[np.float64]) -> SVC:
        return SVC(kernel='poly', degree=DEGREE, coef0=1.0, gamma=self._kernel.gamma(scaled),
                   class_weight='balanced')
