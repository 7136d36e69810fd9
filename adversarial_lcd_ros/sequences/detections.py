# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Detections in: the objects that somebody's detector found, as a CSV file."""

from __future__ import annotations

from collections.abc import Iterator
import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.files.text import read_text
from adversarial_lcd_ros.graph import SCENE_CLASS
from adversarial_lcd_ros.poses.trajectory import parse_stamp_ns

DETECTIONS_FILE = 'detections.csv'
COLUMNS = ('timestamp', 'class', 'x', 'y', 'w', 'h', 'score')
# What published files call the class.
_CLASS_COLUMNS = ('class', 'coco_class')
MAX_CLASS = SCENE_CLASS - 1
# Boxes may reach beyond an image, but not beyond float32.
_MAX_PX = 1e9


@dataclass(frozen=True, eq=False)
class DetectionTable:
    """
    Detections of many frames, in order of time.

    Attributes
    ----------
    stamp_ns : int64, (k,)
        Of the frame of each detection, ascending, nanoseconds.
    label : uint32, (k,)
        Class.
    box : float32, (k, 4)
        x, y of the upper left corner, width, height, pixels; may reach beyond the image.
    score : float32, (k,)
        Confidence, 0 to 1.

    """

    stamp_ns: NDArray[np.int64]
    label: NDArray[np.uint32]
    box: NDArray[np.float32]
    score: NDArray[np.float32]

    @property
    def frame_stamps_ns(self) -> NDArray[np.int64]:
        """The stamps of the frames that have detections, int64, strictly ascending."""
        return np.unique(self.stamp_ns)

    def rows_near(self, stamp_ns: int, tolerance_ns: int) -> slice:
        """Return the rows of the frame nearest to a stamp; none where none is near enough."""
        after = int(np.searchsorted(self.stamp_ns, stamp_ns))
        around = self.stamp_ns[max(after - 1, 0):after + 1]
        if not len(around):
            return slice(0, 0)
        nearest = int(around[np.abs(around - stamp_ns).argmin()])
        if abs(nearest - stamp_ns) > tolerance_ns:
            return slice(0, 0)
        return slice(int(np.searchsorted(self.stamp_ns, nearest)),
                     int(np.searchsorted(self.stamp_ns, nearest, 'right')))


def read_detections(path: Path) -> DetectionTable:
    """
    Read a CSV of one detection a line: ``timestamp,class,x,y,w,h,score``, with this header.

    The timestamp is in seconds and kept to the nanosecond; the class (or ``coco_class``) is a
    number; x and y are the upper left corner of the box, w and h its size, pixels. The order of
    the lines does not matter.

    Raises
    ------
    SequenceError
        The file is missing, is no such CSV, or a line is wrong; the line is named.

    """
    if path.is_dir():
        raise SequenceError(f'{path} is a folder: labels of YOLO are read with the pictures that '
                            'they belong to: adversarial-lcd build PICTURES BAG --detector csv '
                            f'--detections {path}')
    rows = list(_rows(path))
    if not rows:
        raise SequenceError(f'{path} holds no detection: expected lines of {",".join(COLUMNS)}')
    stamps = np.array([row[0] for row in rows], np.int64)
    values = np.array([row[2:] for row in rows], np.float64)
    order = np.argsort(stamps, kind='stable')
    return DetectionTable(
        stamps[order], np.array([row[1] for row in rows], np.uint32)[order],
        values[order, :4].astype(np.float32), values[order, 4].astype(np.float32))


def _rows(path: Path) -> Iterator[tuple[int, int, float, float, float, float, float]]:
    try:
        lines = csv.reader(read_text(path).splitlines(), strict=True)
        _check_header(path, next(lines, []))
        for fields in lines:
            if fields:  # no blank line
                yield _row(f'{path}, line {lines.line_num}', fields)
    except csv.Error as error:
        raise SequenceError(f'{path} cannot be read as CSV: {error}') from error


def _check_header(path: Path, header: list[str]) -> None:
    names = ['class' if name in _CLASS_COLUMNS else name for name in map(str.strip, header)]
    if names != list(COLUMNS):
        raise SequenceError(f'{path}, line 1: found {",".join(header) or "nothing"}; expected '
                            f'the header {",".join(COLUMNS)}')


def _row(where: str, fields: list[str]) -> tuple[int, int, float, float, float, float, float]:
    if len(fields) != len(COLUMNS):
        raise SequenceError(f'{where}: {len(fields)} fields; expected {len(COLUMNS)}: '
                            f'{",".join(COLUMNS)}')
    try:
        stamp_ns, label = parse_stamp_ns(fields[0]), int(fields[1])
        x, y, width, height, score = (float(text) for text in fields[2:])
    except ValueError as error:
        raise SequenceError(f'{where}: {error}') from None
    if not 0 <= label <= MAX_CLASS:
        raise SequenceError(f'{where}: class {label}; expected 0 to {MAX_CLASS}')
    if (not all(abs(value) <= _MAX_PX for value in (x, y, width, height))
            or min(width, height) <= 0):
        raise SequenceError(f'{where}: box {",".join(fields[2:6])}; expected finite numbers of at '
                            f'most {_MAX_PX:g}, and a width and height above 0')
    if not 0 <= score <= 1:
        raise SequenceError(f'{where}: score {fields[6]}; expected 0 to 1')
    return stamp_ns, label, x, y, width, height, score
