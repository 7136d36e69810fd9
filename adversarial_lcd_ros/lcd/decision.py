# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Scores of a target -> calibrated probability, by logistic regression kept as JSON.

On square roots of the scores: these are shares with a long tail, and their roots are nearer to
what a logistic decision expects.

Where classes lie far apart in training, the fit does not tell where between them the line should
be drawn. So a decision carries operating points: the log odds that training loops reached as a
detector meets them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adversarial_lcd_ros.errors import FileError, ModelError
from adversarial_lcd_ros.files.reading import read_json
from adversarial_lcd_ros.files.writing import write_json

FORMAT = 'adversarial_lcd_ros/decision/2'
# Percent of the training loops kept at each operating point.
KEPT_PERCENT = tuple(range(50, 101))
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
    operating_points : tuple of float
        Log odds down to which 50, 51, ... 100 percent of the training loops are kept, falling;
        none: only the fit is known.
    card : dict
        How it was trained: sequences, licences, sizes, figures.

    """

    target: str
    channels: tuple[str, ...]
    weights: tuple[float, ...]
    bias: float
    operating_points: tuple[float, ...] = ()
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

    def keeping(self, share: float) -> Decision:
        """
        Return the decision with log odds 0 where it keeps a share of the training loops.

        The line is only raised: where the fit has loops and others equally likely is its least,
        since among the loops of a weak target are some that nothing speaks for. A decision without
        operating points stays as it was fitted.

        Parameters
        ----------
        share : float
            From 0.5 to 1.

        """
        if not self.operating_points:
            return self
        point = max(float(np.interp(100 * share, KEPT_PERCENT, self.operating_points)), 0.0)
        return replace(self, bias=self.bias - point,
                       operating_points=tuple(odds - point for odds in self.operating_points))

    def save(self, path: Path) -> None:
        """Write the decision and its card as JSON."""
        text = {'format': FORMAT, 'target': self.target, 'channels': list(self.channels),
                'weights': list(self.weights), 'bias': self.bias,
                'operating_points': list(self.operating_points), 'card': self.card}
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
                           float(text['bias']),
                           tuple(float(odds) for odds in text.get('operating_points', ())),
                           dict(text.get('card', {})))
            kind = text['format']
        except (FileError, ValueError, TypeError, KeyError, OverflowError) as error:
            detail = error if isinstance(error, FileError) else repr(error)
            raise ModelError(f'{path} is no trained decision: {detail}; train one with '
                             '"adversarial-lcd train"') from error
        if kind != FORMAT:
            raise ModelError(f'{path} has format {kind!r}: expected {FORMAT!r}; train it '
                             'anew with "adversarial-lcd train"')
        if decision.target != target or decision.channels != channels:
            raise ModelError(f'{path} was trained for target {decision.target} '
                             f'{decision.channels}: expected {target} {channels}')
        if len(decision.weights) != len(channels) or not all(
                abs(value) <= _MAX_WEIGHT for value in (*decision.weights, decision.bias)):
            raise ModelError(f'{path}: expected {len(channels)} finite weights and a bias, from '
                             f'-{_MAX_WEIGHT:g} to {_MAX_WEIGHT:g}, found {decision.weights} and '
                             f'{decision.bias}')
        points = decision.operating_points
        if points and (len(points) != len(KEPT_PERCENT) or not all(
                -_MAX_WEIGHT <= below <= above <= _MAX_WEIGHT
                for above, below in pairwise(points))):
            raise ModelError(f'{path}: expected {len(KEPT_PERCENT)} operating points that fall, '
                             f'within {_MAX_WEIGHT:g} of 0, found {points}')
        return decision


def probability(logit: float) -> float:
    """Return 1 / (1 + exp(-logit)) without overflow."""
    if logit >= 0:
        return 1 / (1 + math.exp(-logit))
    odds = math.exp(logit)
    return odds / (1 + odds)
