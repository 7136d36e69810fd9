# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What came of a frame: every scored one has one outcome.

``TP``: a loop is there and a right match was declared. ``FN``: a loop is there and nothing was
declared. ``WM``, wrong match: a loop is there but the declared match is another place. ``FP``: no
loop is there but one was declared. ``TN``: rightly silent. A wrong match is a missed loop (it
counts among the false negatives) and also a false alarm (it counts against precision). ``UM``,
untold match: one was declared with a match of which nobody can say whether it is right; the frame
is in no figure of that run.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE

Outcomes = NDArray[np.str_]
# What ground truth says of a frame, in words; only the first two are scored.
FRAME_KINDS = ('positive', 'negative', 'scale', 'between', 'no_candidate', 'no_ground_truth')
# The outcome of a frame whose declared match cannot be told.
UNTOLD_MATCH = 'UM'
# What an attack did to a frame, by its outcomes before and after.
EFFECTS = {('TP', 'FN'): 'suppressed', ('TP', 'WM'): 'diverted', ('TN', 'FP'): 'invented',
           ('FN', 'TP'): 'regained', ('WM', 'TP'): 'regained', ('FP', 'TN'): 'withdrawn'}


def outcomes(kind: NDArray[np.int8], is_loop: NDArray[np.bool_],
             match_correct: NDArray[np.bool_],
             match_told: NDArray[np.bool_] | None = None) -> Outcomes:
    """
    Return the outcome of every frame, shape (n,): TP, FN, WM, FP, TN, UM, or '' if not scored.

    Parameters
    ----------
    kind : int8, (n,)
        +1 a loop is there, -1 there is none, 0 not scored.
    is_loop : bool, (n,)
        The detector declared a loop.
    match_correct : bool, (n,)
        The match it named, declared or not, is right.
    match_told : bool, (n,), optional
        Whether that can be said at all; without, it can of every match.

    """
    told = np.ones(len(kind), bool) if match_told is None else np.asarray(match_told, bool)
    check_lengths(kind=kind, is_loop=is_loop, match_correct=match_correct, match_told=told)
    positive, negative = kind == POSITIVE, kind == NEGATIVE
    declared, right = np.asarray(is_loop, bool), np.asarray(match_correct, bool)
    return np.select(
        [(positive | negative) & declared & ~told, positive & declared & right,
         positive & declared, positive, negative & declared, negative],
        [UNTOLD_MATCH, 'TP', 'WM', 'FN', 'FP', 'TN'], '')


def told_kind(kind: NDArray[np.int8], *outcome: Outcomes) -> NDArray[np.int8]:
    """Return the kind of every frame, 0 also where a run's match cannot be told."""
    untold = np.logical_or.reduce([found == UNTOLD_MATCH for found in outcome])
    return np.where(untold, 0, kind).astype(np.int8)


def right(outcome: Outcomes) -> NDArray[np.bool_]:
    """Tell which outcomes are right decisions."""
    return np.isin(outcome, ('TP', 'TN'))


def check_lengths(**arrays: NDArray[Any]) -> None:
    """Raise EvaluationError unless all arrays are of the same length."""
    if len({len(array) for array in arrays.values()}) > 1:
        found = ', '.join(f'{name} {len(array)}' for name, array in arrays.items())
        raise EvaluationError(f'one value a frame is expected of each, found {found}')
