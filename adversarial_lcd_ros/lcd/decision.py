"""
Scores of a target -> calibrated probability, by logistic regression kept as JSON.

On square roots of the scores: these are shares with a long tail, and their roots are nearer to
what a logistic decision expects.
"""

from __future__ import annotations

from dataclasses import dataclass, field
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adversarial_lcd_ros.errors import FileError, ModelError
from adversarial_lcd_ros.files.reading import read_json
from adversarial_lcd_ros.files.writing import write_json

FORMAT = 'adversarial_lcd_ros/decision/1'
# Scores are shares: beyond this a decision is a step, and sums leave the range of numbers.
_MAX_WEIGHT = 1e9
_MAX_BYTES = 1 << 20


@dataclass(frozen=True)
class Decision:
    """
    A logistic decision on the square roots of a target's scores.

    Attributes
    ----------
    target : str
        Name of the target that the scores come from.
    channels : tuple of str
        Names of the scores.
    weights : tuple of float
        One for each channel.
    bias : float
    card : dict
        How it was trained: sequences, licences, sizes, figures.

    """

    target: str
    channels: tuple[str, ...]
    weights: tuple[float, ...]
    bias: float
    card: dict[str, Any] = field(default_factory=dict)

    def logit(self, scores: ArrayLike) -> NDArray[np.float64]:
        """
        Return the log odds of a loop closure.

        Parameters
        ----------
        scores : float, (..., channels)
            At least 0.

        Returns
        -------
        float, (...)

        """
        roots = np.sqrt(np.maximum(np.asarray(scores, np.float64), 0))
        logit: NDArray[np.float64] = self.bias + roots @ np.asarray(self.weights)
        return logit

    def save(self, path: Path) -> None:
        """Write the decision and its card as JSON."""
        text = {'format': FORMAT, 'target': self.target, 'channels': list(self.channels),
                'weights': list(self.weights), 'bias': self.bias, 'card': self.card}
        write_json(path, text)

    @classmethod
    def load(cls, path: Path, target: str, channels: tuple[str, ...]) -> Decision:
        """
        Read a decision and check that it belongs to the target.

        Raises
        ------
        ModelError
            The file is missing, damaged, or trained for another target.

        """
        try:
            text = read_json(path, _MAX_BYTES)
            decision = cls(str(text['target']), tuple(text['channels']),
                           tuple(float(weight) for weight in text['weights']),
                           float(text['bias']), dict(text.get('card', {})))
            kind = text['format']
        except (FileError, ValueError, TypeError, KeyError, OverflowError) as error:
            detail = error if isinstance(error, FileError) else repr(error)
            raise ModelError(f'{path} is no trained decision: {detail}; train one with '
                             '"adversarial-lcd train"') from error
        if kind != FORMAT:
            raise ModelError(f'{path} has format {kind!r}: expected {FORMAT!r}')
        if decision.target != target or decision.channels != channels:
            raise ModelError(f'{path} was trained for target {decision.target} '
                             f'{decision.channels}: expected {target} {channels}')
        if len(decision.weights) != len(channels) or not all(
                abs(value) <= _MAX_WEIGHT for value in (*decision.weights, decision.bias)):
            raise ModelError(f'{path}: expected {len(channels)} finite weights and a bias, from '
                             f'-{_MAX_WEIGHT:g} to {_MAX_WEIGHT:g}, found {decision.weights} and '
                             f'{decision.bias}')
        return decision


def probability(logit: float) -> float:
    """Return 1 / (1 + exp(-logit)) without overflow."""
    if logit >= 0:
        return 1 / (1 + math.exp(-logit))
    odds = math.exp(logit)
    return odds / (1 + odds)
