# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Depth images beside a sequence: depth.npz, or those of the TUM RGB-D benchmark."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.shared_surface import shared_surface
from adversarial_lcd_ros.errors import EvaluationError, FileError, SequenceError
from adversarial_lcd_ros.files.arrays import read_npz
from adversarial_lcd_ros.files.text import text_rows
from adversarial_lcd_ros.poses.trajectory import nearest_in_time, parse_stamp_ns
from adversarial_lcd_ros.sequences.companions import DEPTH_ARCHIVE

DEPTH_LIST = 'depth.txt'
# Depth of a wall is one number over and over: deflate reaches its most.
_MAX_RATIO = 1100
# Rays over the frame; more cost time and tell no more.
ROWS, COLUMNS = 48, 64
TUM_UNITS_A_METRE = 5000.0
# A frame and its depth image were taken at the same time if no further apart than this.
TOLERANCE_NS = 20_000_000


@dataclass(frozen=True, eq=False)
class DepthImages:
    """
    Depth images in order of time.

    Attributes
    ----------
    stamp_ns : int64, (n,)
        Strictly ascending.
    depth_m : float32, (n, rows, columns)
        Along the optical axis, metres; 0: unknown.

    """

    stamp_ns: NDArray[np.int64]
    depth_m: NDArray[np.float32]

    def at(self, stamp_ns: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return the depth images nearest in time to some frames; all 0 where none is near."""
        row = nearest_in_time(self.stamp_ns, stamp_ns)
        depth: NDArray[np.float32] = self.depth_m[row].copy()
        depth[np.abs(self.stamp_ns[row] - stamp_ns) > TOLERANCE_NS] = 0
        return depth


def find_depth(source: Path) -> DepthImages | None:
    """
    Return the depth images of a sequence; None if there are none.

    Raises
    ------
    EvaluationError
        They cannot be read.

    """
    folder = source if source.is_dir() else source.parent
    if (folder / DEPTH_ARCHIVE).is_file():
        return read_archive(folder / DEPTH_ARCHIVE)
    if (folder / DEPTH_LIST).is_file():
        return read_tum(folder)
    return None


def read_archive(path: Path) -> DepthImages:
    """
    Read a depth.npz: ``depth_mm``, uint16 (n, rows, columns), and ``timestamp``, seconds.

    Raises
    ------
    EvaluationError
        The file is damaged or holds something else.

    """
    try:
        arrays = read_npz(path, ('depth_mm', 'timestamp'), ratio=_MAX_RATIO)
    except FileError as error:
        raise EvaluationError(f'{error}; expected depth_mm and timestamp') from error
    depth, seconds = arrays['depth_mm'], arrays['timestamp']
    if (depth.dtype != np.uint16 or depth.ndim != 3 or seconds.dtype != np.float64
            or seconds.shape != depth.shape[:1] or not len(seconds)):
        raise EvaluationError(f'{path} holds depth_mm {depth.dtype}{depth.shape} and timestamp '
                              f'{seconds.dtype}{seconds.shape}: expected uint16 (n, rows, '
                              'columns) and float64 (n,)')
    if not np.isfinite(seconds).all() or (np.diff(seconds) <= 0).any():
        raise EvaluationError(f'{path}: expected finite timestamps that ascend')
    return DepthImages(np.round(seconds * 1e9).astype(np.int64),
                       (depth / 1000.0).astype(np.float32))


def read_tum(folder: Path) -> DepthImages:
    """
    Read the depth images of a folder of the TUM RGB-D benchmark (depth.txt), thinned out.

    Raises
    ------
    EvaluationError
        The list is empty or out of order, or an image is missing or no 16-bit grey one.

    """
    stamps, images = [], []
    try:
        for _, (stamp, name) in text_rows(folder / DEPTH_LIST, 'timestamp filename'):
            stamps.append(parse_stamp_ns(stamp))
            images.append(_thinned(folder / name))
    except (SequenceError, ValueError) as error:
        raise EvaluationError(f'{folder / DEPTH_LIST}: {error}') from error
    stamp_ns = np.array(stamps, np.int64)
    if not len(stamps) or (np.diff(stamp_ns) <= 0).any():
        raise EvaluationError(f'{folder / DEPTH_LIST}: expected depth images in order of time')
    return DepthImages(stamp_ns, np.stack(images))


def _thinned(path: Path) -> NDArray[np.float32]:
    pixels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if pixels is None or pixels.dtype != np.uint16 or pixels.ndim != 2:
        raise EvaluationError(f'{path}: expected a 16-bit grey depth image')
    # Single pixels, not means: a mean over an edge is a depth that nothing has.
    small = cv2.resize(pixels, (COLUMNS, ROWS), interpolation=cv2.INTER_NEAREST)
    return np.asarray(small / TUM_UNITS_A_METRE, np.float32)


def shares_of(images: DepthImages, stamp_ns: NDArray[np.int64], turn: NDArray[np.float64],
              centre: NDArray[np.float64], focal_length: float) -> NDArray[np.float64]:
    """
    Return the share of the surface in every view that every other one sees, (n, n), 0 to 1.

    Parameters
    ----------
    images : DepthImages
    stamp_ns : int64, (n,)
        Frames.
    turn, centre : float64, (n, 3, 3) and (n, 3)
        Camera to world; camera centres, metres.
    focal_length : float
        Over the image width.

    Returns
    -------
    float64, (n, n)
        NaN where the depth of either view is unknown.

    """
    depth = images.at(stamp_ns)
    share: NDArray[np.float64] = shared_surface(
        depth, turn, centre, focal_length * depth.shape[2]).astype(np.float64)
    unknown = ~(depth > 0).any(axis=(1, 2))
    share[:, unknown] = np.nan
    return share
