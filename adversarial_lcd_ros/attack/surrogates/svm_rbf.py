"""SVM with an RBF kernel, the paper's surrogate (Sec. 3.5)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

MIN_ROWS = 10


class SvmRbf:
    """
    Classifies whether a flip raises the attack loss; the distance from the boundary ranks.

    gamma = 1 / (2 sigma^2) as in Eq. (8), sigma the standard deviation of the training features.
    Each is first scaled to unit deviation, so sigma^2 is their number d unless some are constant:
    the squared distance of two rows sums over d of them. The paper leaves the label open; here it
    is the sign of the gain, and flips without any effect count as no gain.
    """

    name: ClassVar[str] = 'svm_rbf'

    def __init__(self, cost: float = 1.0) -> None:
        self._cost = cost

    def fit(self, features: NDArray[np.float64], gain: NDArray[np.float64]) -> bool:
        """Learn; needs ten rows and both signs."""
        label = gain > 0
        if len(label) < MIN_ROWS or label.all() or not label.any():
            return False
        self._scaler = StandardScaler().fit(features)
        scaled = self._scaler.transform(features)
        variance = float(scaled.var(axis=0).sum())
        self._model = SVC(C=self._cost, kernel='rbf', gamma=1 / (2 * max(variance, 1e-12)),
                          class_weight='balanced')
        self._model.fit(scaled, label)
        return True

    def predict(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the signed distance from the decision boundary, shape (k,)."""
        score: NDArray[np.float64] = self._model.decision_function(
            self._scaler.transform(features))
        return score
