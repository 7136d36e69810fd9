# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of an evaluation, and how they are kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.results import PICTURES, read_json
from adversarial_lcd_ros.files.reading import MIB, read_bytes
from adversarial_lcd_ros.files.writing import write_bytes, write_json

# The picture of why an attack works on one target and not on another, and its text.
WHY, WHY_NARROW, WHY_TEXT = 'why.jpg', 'why_narrow.jpg', 'why.json'
_INDEX = 'pictures.json'
_JPEG_QUALITY = 82
_MAX_JPEG_BYTES = 16 * MIB


@dataclass(frozen=True, eq=False)
class Picture:
    """
    A picture of the report.

    Attributes
    ----------
    title, caption : str
        Plain text.
    image : uint8, (h, w, 3)
        BGR.

    """

    title: str
    caption: str
    image: NDArray[np.uint8]


def write_pictures(folder: Path, pictures: Sequence[Picture]) -> None:
    """
    Write pictures as JPEG, and their texts, under ``folder/pictures``.

    Raises
    ------
    EvaluationError
        An image is not uint8 BGR.

    """
    place = folder / PICTURES
    place.mkdir(exist_ok=True)
    index = []
    for number, picture in enumerate(pictures, start=1):
        if picture.image.dtype != np.uint8 or picture.image.ndim != 3:
            raise EvaluationError(f'picture {picture.title!r} is {picture.image.dtype}'
                                  f'{picture.image.shape}: expected uint8 (h, w, 3)')
        name = f'{number:02d}.jpg'
        _, code = cv2.imencode('.jpg', picture.image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        write_bytes(place / name, code.tobytes())
        index.append({'file': name, 'title': picture.title, 'caption': picture.caption})
    write_json(place / _INDEX, {'pictures': index})


def read_pictures(folder: Path) -> list[tuple[str, str, bytes]]:
    """
    Return title, caption and JPEG bytes of the pictures that ``write_pictures`` wrote.

    Raises
    ------
    EvaluationError, FileError
        The folder is damaged.

    """
    place = folder / PICTURES
    if not place.is_dir():
        return []
    index = read_json(place / _INDEX)
    try:
        return [(str(entry['title']), str(entry['caption']),
                 read_bytes(place / Path(entry['file']).name, _MAX_JPEG_BYTES))
                for entry in index['pictures']]
    except (KeyError, TypeError) as error:
        raise EvaluationError(f'{place / _INDEX} is no list of pictures: {error!r}; make the '
                              'results anew') from error


def read_why(folder: Path) -> dict[str, Any] | None:
    """
    Return caption, sentences, wide and narrow (JPEG) of the picture of why.

    None if the run has drawn none.

    Raises
    ------
    EvaluationError, FileError
        The folder is damaged.

    """
    place = folder / PICTURES
    if not (place / WHY_TEXT).is_file():
        return None
    text = read_json(place / WHY_TEXT)
    if not isinstance(text.get('caption'), str) or not isinstance(text.get('sentences'), list):
        raise EvaluationError(f'{place / WHY_TEXT} lacks caption or sentences: run the evaluation '
                              'again')
    return {'caption': text['caption'], 'sentences': [str(line) for line in text['sentences']],
            'wide': read_bytes(place / WHY, _MAX_JPEG_BYTES),
            'narrow': read_bytes(place / WHY_NARROW, _MAX_JPEG_BYTES)}
