"""SVM with an RBF kernel, the paper's surrogate (Sec. 3.5, Eq. 8)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from sklearn.svm import SVC

from adversarial_lcd_ros.attack.surrogates.classifier import Classifier


class SvmRbf(Classifier):
    """The distance from the boundary ranks; C = 1."""

    name: ClassVar[str] = 'svm_rbf'

    def _make(self, scaled: NDArray[np.float64]) -> SVC:
        return SVC(kernel='rbf', gamma=self._kernel.gamma(scaled), class_weight='balanced')
