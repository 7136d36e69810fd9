"""Pictures of an evaluation, and how they are kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.results import PICTURES, read_json
from adversarial_lcd_ros.files import write_json

_INDEX = 'pictures.json'
_JPEG_QUALITY = 82

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
        (place / name).write_bytes(code.tobytes())
        index.append({'file': name, 'title': picture.title, 'caption': picture.caption})
    write_json(place / _INDEX, {'pictures': index})


def read_pictures(folder: Path) -> list[tuple[str, str, bytes]]:
    """Return title, caption and JPEG bytes of the pictures that ``write_pictures`` wrote."""
    place = folder / PICTURES
    if not place.is_dir():
        return []
    entries = read_json(place / _INDEX)['pictures']
    return [(entry['title'], entry['caption'], (place / Path(entry['file']).name).read_bytes())
            for entry in entries]
