# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Image files as the frames of a sequence."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
import re

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import FileError, SequenceError
from adversarial_lcd_ros.files.reading import MIB, read_bytes
from adversarial_lcd_ros.poses.trajectory import Trajectory
from adversarial_lcd_ros.sequences.frame import Frame, is_depth_file, open_compressed
from adversarial_lcd_ros.sequences.sequence import Sequence

DEFAULT_RATE_HZ = 30.0
_SUFFIXES = ('.jpg', '.jpeg', '.png', '.webp')
# What is not read, though somebody may take it for a sequence, or a part of one.
OTHER_PICTURES = ('.avif', '.bmp', '.exr', '.gif', '.heic', '.jp2', '.pbm', '.pgm', '.ppm', '.tif',
                  '.tiff')
PACKED = ('.7z', '.bz2', '.gz', '.rar', '.tar', '.tgz', '.xz', '.zip', '.zst', '.zstd')
_HEADER_BYTES = 32
MAX_PICTURE_BYTES = 128 * MIB


def is_hidden(path: Path) -> bool:
    """Tell whether a file or folder is not for people: .DS_Store, ._name, __MACOSX."""
    return path.name.startswith('.') or path.name == '__MACOSX'


def images_in(folder: Path) -> list[Path]:
    """Return the JPEG, PNG and WebP files of a folder; numbers in names count as numbers."""
    paths = [path for path in folder.iterdir()
             if path.suffix.lower() in _SUFFIXES and not is_hidden(path)]
    return sorted(paths, key=lambda path: [
        (int(part), '') if part.isdigit() else (-1, part)
        for part in re.split(r'([0-9]+)', path.name)])


def count_of(folder: Path, suffixes: tuple[str, ...]) -> str:
    """Return how many files of some kinds are in a folder, in words; '' if there is none."""
    kinds = Counter(path.suffix.lower() for path in folder.iterdir() if not is_hidden(path))
    return ', '.join(f'{kinds[suffix]} {suffix}' for suffix in suffixes if kinds[suffix])


def is_depth_image(path: Path) -> bool:
    """Tell whether a file is a PNG of 16 bits a pixel without colour."""
    # Whoever reads a pipe or a folder refuses it; opening a pipe may wait for ever.
    if path.suffix.lower() != '.png' or not path.is_file():
        return False
    try:
        with path.open('rb') as file:
            return is_depth_file(file.read(_HEADER_BYTES))
    except OSError as error:
        raise SequenceError(f'image {path} cannot be read: {error}') from error


def ticks(count: int, rate_hz: float | None) -> NDArray[np.int64]:
    """Return the stamps of frames at a rate, from 0, nanoseconds."""
    rate = DEFAULT_RATE_HZ if rate_hz is None else rate_hz
    stamps: NDArray[np.int64] = np.round(np.arange(count) * (1e9 / rate)).astype(np.int64)
    return stamps


def file_sequence(folder: Path, paths: list[Path], stamps: list[int] | NDArray[np.int64],
                  trajectory: Trajectory | None, *, focal_length_px: float | None = None,
                  notes: tuple[str, ...] = ()) -> Sequence:
    """Return image files as a sequence; they are read when their frames are asked for."""
    if not paths:
        raise SequenceError(f'{folder} holds no camera frame')
    first = read_image(paths[0], 0, None)
    size = first.width, first.height
    stamps_ns = np.asarray(stamps, np.int64)

    def read(wanted: range) -> Iterator[Frame]:
        for number in wanted:
            yield read_image(paths[number], int(stamps_ns[number]), size)

    return Sequence(folder.resolve().name, folder, stamps_ns, size, trajectory, read,
                    focal_length_px=focal_length_px,
                    frame_names=tuple(path.stem for path in paths), notes=notes)


def read_image(path: Path, stamp_ns: int, size: tuple[int, int] | None) -> Frame:
    """
    Return the frame in an image file; see ``open_compressed``.

    Raises
    ------
    SequenceError
        The file cannot be read, is truncated, or is a depth map.

    """
    try:
        data = read_bytes(path, MAX_PICTURE_BYTES)
    except FileError as error:
        raise SequenceError(f'image {error}') from error
    if is_depth_file(data):
        raise SequenceError(f'image {path} has 16 bits a pixel and no colour, as depth maps '
                            'have: name the folder of the camera, or convert it to 8 bits')
    return open_compressed(stamp_ns, data, f'image {path}', size)
