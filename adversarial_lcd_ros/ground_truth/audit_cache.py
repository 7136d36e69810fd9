# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What an audit counted, kept on disk under a digest of everything that it was made of."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from zipfile import BadZipFile

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import EvaluationError, FileError
from adversarial_lcd_ros.files.digests import digest_of_parts
from adversarial_lcd_ros.files.writing import replacing
from adversarial_lcd_ros.ground_truth.audit import Sightings
from adversarial_lcd_ros.ground_truth.focal import Focal
from adversarial_lcd_ros.paths import cache_folder

if TYPE_CHECKING:
    from adversarial_lcd_ros.sequences import Trajectory

_HERE = Path(__file__).resolve().parent
# What counts, and what is counted; not what labels make of it.
_CODE = (*(_HERE / f'{name}.py' for name in ('audit', 'focal', 'motion_depth', 'view_features')),
         *(_HERE.parent / 'compiled' / f'{name}.py' for name in ('sightings', 'hamming')),
         _HERE.parent / 'vision' / 'features.py')


@dataclass(frozen=True, eq=False)
class Audit:
    """Counts of every pair of views, and the focal length that they were made with."""

    sightings: Sightings
    focal: Focal


def cache_key(source: Path, rows: Trajectory, candidates: NDArray[np.int64],
              located: NDArray[np.bool_], first: bytes, focal: Focal) -> str:
    """
    Return a digest of all that an audit is made of, hexadecimal.

    The source, stamps and poses of the frames, which of them are compared, the first picture as
    recorded, the code, and the libraries below it.
    """
    arrays = (rows.stamp_ns, rows.position, rows.quaternion, candidates, located)
    versions = f'{source.resolve()} {focal} {np.__version__} {cv2.__version__}'.encode()
    return digest_of_parts((versions, first, *(array.tobytes() for array in arrays),
                            *(path.read_bytes() for path in _CODE)))


def load(key: str) -> Audit | None:
    """Return what was kept under a key; None if nothing was, or it is damaged."""
    try:
        with np.load(_path(key), allow_pickle=False) as arrays:
            return Audit(Sightings(arrays['count'].astype(np.int32), arrays['features'],
                                   arrays['covered']),
                         Focal(float(arrays['focal']), str(arrays['focal_from'])))
    except (OSError, EOFError, KeyError, ValueError, BadZipFile):
        return None


def save(key: str, audit: Audit) -> None:
    """
    Keep an audit under its key; the file appears when it is complete, or not at all.

    Raises
    ------
    EvaluationError
        The place cannot be written.

    """
    path = _path(key)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as stream:
            np.savez_compressed(stream, count=audit.sightings.count.astype(np.uint16),
                                features=audit.sightings.features,
                                covered=audit.sightings.covered,
                                focal=audit.focal.share, focal_from=audit.focal.source)
    except (OSError, FileError) as error:
        raise EvaluationError(f'labels cannot be kept in {path.parent} ({error}): set '
                              'ADVERSARIAL_LCD_CACHE to another folder') from error


def _path(key: str) -> Path:
    return cache_folder() / 'labels' / f'{key}.npz'
