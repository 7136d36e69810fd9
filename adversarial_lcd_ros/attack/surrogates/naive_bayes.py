# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gaussian naive Bayes (paper, Table 3)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from sklearn.naive_bayes import GaussianNB

from adversarial_lcd_ros.attack.surrogates.classifier import Classifier


class NaiveBayes(Classifier):
    """
    Two classes, flips that gain and flips that do not; their log odds rank.

    Probabilities would not do: with dozens of features taken as independent they are 0 or 1 to
    the last digit for nearly all flips, and ties would be left to the order of proposals.
    """

    name: ClassVar[str] = 'naive_bayes'
    title: ClassVar[str] = 'naive Bayes'
    rank: ClassVar[int] = 2
    dash: ClassVar[str] = '--'

    def _make(self, scaled: NDArray[np.float64]) -> GaussianNB:
        return GaussianNB(priors=[0.5, 0.5])

    def _score(self, scaled: NDArray[np.float64]) -> NDArray[np.float64]:
        joint: NDArray[np.float64] = self._model.predict_joint_log_proba(scaled)
        return joint[:, 1] - joint[:, 0]
