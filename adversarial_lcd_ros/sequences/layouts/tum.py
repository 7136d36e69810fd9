# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Folders in the layout of the TUM RGB-D benchmark, as those of Bonn are."""

from __future__ import annotations

from pathlib import Path

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.files.text import text_rows
from adversarial_lcd_ros.poses.trajectory import parse_stamp_ns


def list_images(path: Path) -> tuple[list[int], list[Path]]:
    """Return the stamps and files in a list of images: ``timestamp filename``, in seconds."""
    stamps, paths = [], []
    for where, (stamp, name) in text_rows(path, 'timestamp filename'):
        try:
            stamps.append(parse_stamp_ns(stamp))
        except ValueError as error:
            raise SequenceError(f'{where}: {error}') from None
        paths.append(path.parent / name)
        if not paths[-1].is_file():
            raise SequenceError(f'{where}: there is no image {paths[-1]}')
    return stamps, paths
