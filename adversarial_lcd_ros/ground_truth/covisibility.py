# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Exact co-visibility that was recorded, or rendered, beside a sequence."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import EvaluationError, FileError
from adversarial_lcd_ros.files.arrays import read_npz
from adversarial_lcd_ros.sequences.companions import COVISIBILITY

# Percents of views that share nothing are 0 over and over: deflate reaches its most.
_MAX_RATIO = 1100
# Stamps are written as float64 seconds, which hold 0.2 microseconds of today's time.
_SAME_STAMP_NS = 1_000_000


@dataclass(frozen=True, eq=False)
class Covisibility:
    """
    How much of every view every other one sees.

    Attributes
    ----------
    stamp_ns : int64, (n,)
        Of the frames, strictly ascending.
    percent : uint8, (n, n)
        Percent of the surface seen in frame i that frame j sees, too.

    """

    stamp_ns: NDArray[np.int64]
    percent: NDArray[np.uint8]

    def shares(self, stamp_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """
        Return the shares of some frames, 0 to 1, shape (m, m).

        Raises
        ------
        EvaluationError
            A frame is not among those of the file.

        """
        row = np.searchsorted(self.stamp_ns, stamp_ns - _SAME_STAMP_NS)
        row = np.minimum(row, len(self.stamp_ns) - 1)
        missing = np.abs(self.stamp_ns[row] - stamp_ns) > _SAME_STAMP_NS
        if missing.any():
            raise EvaluationError(
                f'{COVISIBILITY} knows nothing of {int(missing.sum())} of {len(stamp_ns)} frames, '
                f'the first at {stamp_ns[int(missing.argmax())]} ns: expected that of the same '
                'sequence; move it away, or choose another rule for labels')
        return self.percent[np.ix_(row, row)] / 100.0


def find_covisibility(source: Path) -> Path | None:
    """Return the covisibility.npz of a sequence: in its folder, or beside its file."""
    path = (source if source.is_dir() else source.parent) / COVISIBILITY
    return path if path.is_file() else None


def read_covisibility(path: Path) -> Covisibility:
    """
    Read a covisibility.npz: ``percent``, uint8 (n, n), and ``timestamp``, float64 (n,), seconds.

    Raises
    ------
    EvaluationError
        The file is damaged or holds something else.

    """
    try:
        arrays = read_npz(path, ('percent', 'timestamp'), ratio=_MAX_RATIO)
    except FileError as error:
        raise EvaluationError(f'{error}; expected percent and timestamp') from error
    percent, seconds = arrays['percent'], arrays['timestamp']
    count = len(np.atleast_1d(seconds))
    if (percent.dtype != np.uint8 or percent.shape != (count, count)
            or seconds.dtype != np.float64 or percent.max(initial=0) > 100):
        raise EvaluationError(
            f'{path} holds percent {percent.dtype}{percent.shape} and timestamp '
            f'{seconds.dtype}{seconds.shape}: expected uint8 (n, n), 0 to 100, and float64 (n,)')
    if not np.isfinite(seconds).all() or (np.diff(seconds) <= 0).any():
        raise EvaluationError(f'{path}: expected finite timestamps that ascend')
    return Covisibility(np.round(seconds * 1e9).astype(np.int64), percent)
