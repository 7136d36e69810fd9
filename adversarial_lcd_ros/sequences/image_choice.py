# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which files of a folder are the frames of one camera, and when they were taken."""

from __future__ import annotations

from collections import defaultdict
from decimal import Decimal
from pathlib import Path
import re

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.sequences.image_files import (
    OTHER_PICTURES,
    count_of,
    images_in,
    is_depth_image,
)

# cam0_00012.png: the first number is the camera's.
_CAMERA_NUMBER = re.compile(r'([a-z]+_?[0-9])(?=[_-])')
_SECONDS = re.compile(r'[0-9]{9,10}\.[0-9]+')
# Nanoseconds in a unit of names that are whole numbers: ns, us, ms.
_UNITS_NS = (1, 1_000, 1_000_000)
# From 2001 until the stamps of ROS end, seconds.
_FIRST_S, _LAST_S = 10**9, 2**31


def camera_images(folder: Path, camera: str | None) -> tuple[list[Path], tuple[str, ...]]:
    """
    Return the images of one camera in a folder, and what is to be said about the others.

    Depth maps (PNG of 16 bits without colour) are left out beside pictures. Names that differ
    in more than a number, and have the same numbers, are several views of one moment.

    Parameters
    ----------
    folder : Path
    camera : str or None
        How the names of the images start.

    Raises
    ------
    SequenceError
        There are only depth maps, no name starts so, or there are several views.

    """
    images = images_in(folder)
    depth = {path for path in images if is_depth_image(path)}
    pictures = [path for path in images if path not in depth]
    if not pictures:
        raise SequenceError(
            f'{folder} holds {len(depth)} PNG of 16 bits without colour, as depth maps are: name '
            'the folder of the camera, or convert them to 8 bits')
    others = count_of(folder, OTHER_PICTURES)
    notes = (*((f'{folder}: {len(depth)} depth maps are not taken',) if depth else ()),
             *((f'{folder}: {others} are not taken: convert them to PNG',) if others else ()))
    views = _views(pictures)
    if camera is not None:
        pictures = [path for path in pictures if path.name.startswith(camera)]
        if not pictures:
            raise SequenceError(f'{folder} has no images {camera}*: it has '
                                f'{", ".join(sorted(views))}')
        return pictures, notes
    numbers = [tuple(view) for view in views.values() if len(view) > 1]
    if len(set(numbers)) < len(numbers):
        raise SequenceError(
            f'{folder} holds several views of the same moments ({", ".join(sorted(views))}): '
            'choose one by how its names start (--camera)')
    return pictures, notes


def _views(pictures: list[Path]) -> dict[str, list[str]]:
    """Return the numbers in the names of images, by what else is in their names."""
    views = defaultdict(list)
    for path in pictures:
        name = path.name.lower()
        match = _CAMERA_NUMBER.match(name)
        start = match.group() if match else ''
        rest = name[len(start):]
        views[start + re.sub(r'[0-9]+', '#', rest)].append(re.sub(r'[^0-9]+', ' ', rest).strip())
    return dict(views)


def named_stamps(paths: list[Path]) -> list[int] | None:
    """Return the times since 1970 that images are named by, nanoseconds; None if they are not."""
    stamps = [_named_stamp(path.stem) for path in paths]
    known = [stamp for stamp in stamps if stamp is not None]
    return known if len(known) == len(paths) > 1 else None


def _named_stamp(name: str) -> int | None:
    if _SECONDS.fullmatch(name):
        return int(Decimal(name) * 10**9)
    if not (name.isascii() and name.isdecimal()):
        return None
    number = int(name)
    return next((number * unit for unit in _UNITS_NS
                 if _FIRST_S <= number * unit // 10**9 < _LAST_S), None)
