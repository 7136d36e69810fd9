# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Linear SVM (paper, Table 3)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from sklearn.svm import SVC

from adversarial_lcd_ros.attack.surrogates.classifier import Classifier


class SvmLinear(Classifier):
    """The distance from the boundary ranks; C = 1. A linear kernel has no gamma."""

    name: ClassVar[str] = 'svm_linear'
    title: ClassVar[str] = 'SVM-linear'
    rank: ClassVar[int] = 0
    dash: ClassVar[str] = ':'

    def _make(self, scaled: NDArray[np.float64]) -> SVC:
        return SVC(kernel='linear', class_weight='balanced')
