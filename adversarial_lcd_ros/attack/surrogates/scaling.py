# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Standardising features as often as a surrogate is asked."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sklearn.preprocessing import StandardScaler


def standardise(scaler: StandardScaler, features: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ``scaler.transform(features)`` without its checks, which take half a millisecond."""
    scaled: NDArray[np.float64] = (features - scaler.mean_) / scaler.scale_
    return scaled
