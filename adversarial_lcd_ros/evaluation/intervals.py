# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How sure a figure is: intervals that respect that neighbouring frames are near copies.

Frames of a video are not independent, so the bootstrap resamples blocks of consecutive frames:
the circular block bootstrap of Politis and Romano (1992), percentile intervals. Both runs are
taken over the same blocks, so the interval of a decline is that of the paired difference.
Independent repeats, such as draws or sequences, have Student's interval of their mean.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE

BLOCK_S = 2.0
REPLICATES = 4000
LEVEL = 0.95
Interval = tuple[float, float]


def block_frames(stamp_ns: NDArray[np.int64], block_s: float = BLOCK_S) -> int:
    """
    Return the number of frames in a block of ``block_s`` seconds, at least 1.

    Raises
    ------
    EvaluationError
        There are fewer than two frames.

    """
    if len(stamp_ns) < 2:
        raise EvaluationError(f'{len(stamp_ns)} frames: an interval needs at least 2')
    period_s = float(np.median(np.diff(stamp_ns))) * 1e-9
    return min(max(1, round(block_s / period_s)), len(stamp_ns))


def balanced_accuracy_interval(kind: NDArray[np.int8], right: NDArray[np.bool_], block: int,
                               seed: int, replicates: int = REPLICATES,
                               level: float = LEVEL) -> Interval | None:
    """
    Return the interval of the balanced accuracy, 0 to 1; None if a class is empty.

    Parameters
    ----------
    kind : int8, (n,)
        +1, -1, or 0 (not scored) of every frame, in time order without gaps.
    right : bool, (n,)
        The decision was right.
    block : int
        Consecutive frames that are resampled together.
    seed, replicates, level
        Of the bootstrap.

    """
    return _interval(kind, right.astype(np.int64), block, seed, replicates, level)


def decline_interval(kind: NDArray[np.int8], right_before: NDArray[np.bool_],
                     right_after: NDArray[np.bool_], block: int, seed: int,
                     replicates: int = REPLICATES, level: float = LEVEL) -> Interval | None:
    """
    Return the interval of the decline in balanced accuracy, percentage points.

    Parameters are those of ``balanced_accuracy_interval``; None if a class is empty.

    """
    lost = right_before.astype(np.int64) - right_after.astype(np.int64)
    interval = _interval(kind, lost, block, seed, replicates, level)
    return None if interval is None else (100.0 * interval[0], 100.0 * interval[1])


def class_mean_interval(size: NDArray[np.int64], total: NDArray[np.int64], block: int, seed: int,
                        replicates: int = REPLICATES, level: float = LEVEL) -> Interval | None:
    """
    Return the interval of the mean over two classes of the mean value in each.

    Parameters
    ----------
    size, total : int64, (2, n)
        How many values of each class a frame has (several where runs are repeated, none where
        it is not scored), and their sum.
    block, seed, replicates, level
        As for ``balanced_accuracy_interval``; None if a class is empty.

    """
    count = size.shape[1]
    if not 1 <= block <= count:
        raise EvaluationError(f'blocks of {block} frames in {count}: expected 1 to {count}')
    if not np.all(size.sum(axis=1)):
        return None
    start = np.random.default_rng(seed).integers(
        count, size=(replicates, -(-count // block)), dtype=np.int32)
    means = []
    for sizes, totals in zip(size, total, strict=True):
        drawn = _block_sums(sizes, block)[start].sum(axis=1)
        value = _block_sums(totals, block)[start].sum(axis=1)
        means.append(np.divide(value, drawn, out=np.full(replicates, np.nan), where=drawn > 0))
    # A replicate that missed a class altogether has no balanced accuracy.
    estimate = (means[0] + means[1]) / 2
    tail = (1.0 - level) / 2
    low, high = np.nanquantile(estimate, [tail, 1.0 - tail])
    return float(low), float(high)


def _interval(kind: NDArray[np.int8], value: NDArray[np.int64], block: int, seed: int,
              replicates: int, level: float) -> Interval | None:
    member = np.stack([kind == POSITIVE, kind == NEGATIVE])
    return class_mean_interval(member.astype(np.int64), np.where(member, value, 0), block, seed,
                               replicates, level)


def _block_sums(value: NDArray[np.int64], block: int) -> NDArray[np.int64]:
    # Sum of each circular block, by its first frame.
    running = np.concatenate([[0], np.cumsum(np.concatenate([value, value[:block - 1]]))])
    sums: NDArray[np.int64] = running[block:] - running[:len(value)]
    return sums


def mean_interval(values: NDArray[np.float64], level: float = LEVEL) -> Interval | None:
    """Return Student's interval of the mean of independent values; None for fewer than two."""
    count = len(values)
    if count < 2:
        return None
    mean, spread = float(values.mean()), float(values.std(ddof=1))
    half = float(stats.t.ppf((1.0 + level) / 2, count - 1)) * spread / math.sqrt(count)
    return mean - half, mean + half
