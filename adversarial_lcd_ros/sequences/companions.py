# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files beside the frames of a recording that go with them into a bag."""

from __future__ import annotations

from pathlib import Path

from adversarial_lcd_ros.errors import SequenceError

# What tells labels how much of a view another one sees (ground_truth/).
COVISIBILITY, DEPTH_ARCHIVE = 'covisibility.npz', 'depth.npz'
EVIDENCE = (COVISIBILITY, DEPTH_ARCHIVE)
_MAX_EVIDENCE_BYTES = 1 << 30
# Who made the pictures, and what one may do with them.
_TERMS = ('credits', 'license', 'licence')
_MAX_TERMS_BYTES = 1 << 20


def companions_of(source: Path) -> list[Path]:
    """
    Return what goes into a bag with the frames of a folder, or of a file, sorted.

    Credits and a licence of a folder; co-visibility and depth in it, or beside the file.

    Raises
    ------
    SequenceError
        One is a link out of its folder, no file, or too large.

    """
    folder = source if source.is_dir() else source.parent
    return [_checked(path, folder) for path in sorted(folder.iterdir())
            if path.name in EVIDENCE or (source.is_dir() and is_terms(path)
                                         and not path.is_dir())]


def is_terms(path: Path) -> bool:
    """Tell whether a file holds, by its name, credits or a licence."""
    return path.stem.lower() in _TERMS


def _checked(path: Path, folder: Path) -> Path:
    # A recording from elsewhere must not put a file of this machine into the bag.
    if not path.resolve().is_relative_to(folder.resolve()):
        raise SequenceError(f'{path} is a link out of its folder, to {path.resolve()}: it '
                            'would go into the bag; put the file itself there, or remove it')
    most = _MAX_EVIDENCE_BYTES if path.name in EVIDENCE else _MAX_TERMS_BYTES
    if not path.is_file() or path.stat().st_size > most:
        what = 'what labels are made of' if path.name in EVIDENCE else 'the terms of use'
        raise SequenceError(f'{path} is no file of at most {most} bytes: expected {what}, or '
                            'nothing of this name')
    return path
