# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The frames of cells, ``frame_results`` of their rows: as arrays, counted, and resampled."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation import intervals
from adversarial_lcd_ros.evaluation.outcomes import FRAME_KINDS, UNTOLD_MATCH, right
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE

_KINDS = dict(zip(FRAME_KINDS, (POSITIVE, NEGATIVE, 0, 0, 0, 0), strict=True))
_BOOTSTRAP_SEED = 0


def frame_right(row: Row, which: str) -> NDArray[np.bool_]:
    """Return which decisions of a cell were right, (n,); ``which`` is 'clean' or 'attacked'."""
    return np.array([_is_right(frame[which], row) for frame in row['frame_results']], bool)


def frame_untold(row: Row) -> NDArray[np.bool_]:
    """Return which frames are in no figure: a match, clean or attacked, cannot be told, (n,)."""
    return np.array([UNTOLD_MATCH in (frame['clean'], frame['attacked'])
                     for frame in row['frame_results']], bool)


def frame_kinds(row: Row) -> NDArray[np.int8]:
    """Return what ground truth says of each frame, +1, -1 or 0, (n,); raises EvaluationError."""
    kinds = [_KINDS.get(frame['kind'], frame['kind']) for frame in row['frame_results']]
    strange = [kind for kind in kinds if kind not in (POSITIVE, NEGATIVE, 0)]
    if strange:
        raise EvaluationError(f'{row["sequence"]}: a frame of kind {strange[0]!r}: expected one '
                              f'of {", ".join(FRAME_KINDS)}')
    return np.array(kinds, np.int8)


def right_before(rows: Sequence[Row]) -> tuple[float, float]:
    """Return how many loops, and new places, were rightly decided before; means over the rows."""
    counts = [[int((frame_right(row, 'clean') & (frame_kinds(row) == kind)).sum()) for row in rows]
              for kind in (POSITIVE, NEGATIVE)]
    return float(np.mean(counts[0])), float(np.mean(counts[1]))


def different_frames(rows: Sequence[Row]) -> dict[str, int]:
    """Count the frames of each kind, repeats once."""
    # By pairs a frame may be the query of a loop with one seed and of another place with the next.
    counts = Counter(kind for _, kind in {
        (frame['stamp'], int(kind)) for row in rows
        for frame, kind in zip(row['frame_results'], frame_kinds(row), strict=True)})
    return {'different_positives': counts[POSITIVE], 'different_negatives': counts[NEGATIVE]}


def decline_ci95(rows: Sequence[Row]) -> tuple[float, float] | None:
    """Return the 95 % interval of the decline, points; None if a kind of frame is missing."""
    # Repeats may score different frames: sizes and sums are kept for each frame of any.
    stamps = np.unique([frame['stamp'] for row in rows for frame in row['frame_results']])
    if len(stamps) < 2:
        return None
    size, total = np.zeros((2, 2, len(stamps)), np.int64)
    for row in rows:
        place = np.searchsorted(stamps, [frame['stamp'] for frame in row['frame_results']])
        if len(np.unique(place)) < len(place):
            raise EvaluationError(f'{row["sequence"]}, seed {row["seed"]}: two frames have one '
                                  'stamp')
        lost = frame_right(row, 'clean').astype(np.int64) - frame_right(row, 'attacked')
        for index, kind in enumerate((POSITIVE, NEGATIVE)):
            member = (frame_kinds(row) == kind) & ~frame_untold(row)
            size[index, place] += member
            total[index, place] += np.where(member, lost, 0)
    interval = intervals.class_mean_interval(
        size, total, intervals.block_frames(stamps.astype(np.int64)), _BOOTSTRAP_SEED)
    return None if interval is None else (100.0 * interval[0], 100.0 * interval[1])


def _is_right(value: Any, row: Row) -> bool:
    if isinstance(value, str) and value in ('TP', 'TN', 'FP', 'FN', 'WM', UNTOLD_MATCH, ''):
        return bool(right(np.array(value)))
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    raise EvaluationError(f'{row["sequence"]}: the decision on a frame is {value!r}: expected an '
                          'outcome such as TP, or true and false')
