"""What every surrogate has in common."""

from __future__ import annotations

from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray


class Surrogate(Protocol):
    """Predicts which of several perturbed graphs has the largest attack loss."""

    name: ClassVar[str]

    def fit(self, features: NDArray[np.float64], gain: NDArray[np.float64]) -> bool:
        """
        Learn from queried graphs.

        Parameters
        ----------
        features : float64, (k, d)
            phi of each perturbed graph.
        gain : float64, (k,)
            Its attack loss, less that of the graph before the flip.

        Returns
        -------
        bool
            False where the data do not suffice to learn from.

        """
        ...

    def predict(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a score for each row of (k, d) features, larger for a larger loss, (k,)."""
        ...
