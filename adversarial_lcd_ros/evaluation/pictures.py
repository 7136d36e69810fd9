"""Pictures of an evaluation: which frames are worth one, and how they are kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import json
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.replay.records import QueryRecord
from adversarial_lcd_ros.evaluation.results import PICTURES, read_json

_INDEX = 'pictures.json'
_JPEG_QUALITY = 82
_EFFECTS = {
    'suppressed': 'The loop was found before the attack and is not found any more.',
    'diverted': 'The loop is now declared with a frame that shows too little of the same view.',
    'invented': 'Under attack a loop is declared where there is none.',
    'regained': "Only under attack the loop is found, against the attacker's purpose.",
    'withdrawn': 'The attack made a false alarm disappear.'}
_OUTCOMES = {
    'TP': ('held', 'The loop is found, attack or not.'),
    'TN': ('held', 'Rightly silent, attack or not.'),
    'FN': ('missed', 'The loop is missed, attack or not.'),
    'WM': ('wrong match', 'The loop is declared with a wrong frame, attack or not.'),
    'FP': ('false alarm', 'A loop is declared where there is none, attack or not.'),
    '': ('not scored', 'Ground truth cannot tell whether there is a loop.')}
# The most telling first.
_ORDER = ('suppressed', 'invented', 'diverted', 'TP', 'TN', 'regained', 'withdrawn', 'FN', 'WM',
          'FP', '')


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


def choose_records(run: Sequence[QueryRecord], count: int = 6) -> list[QueryRecord]:
    """
    Return the attacked frames most worth a picture, in time order.

    Kinds of effect take turns, the most telling first; within a kind the frames with the most
    flipped edges first, not within a twentieth of the sequence of one already chosen, as long
    as there are such. Only frames with a match are chosen, and fewer if there are fewer.

    Parameters
    ----------
    run : sequence of QueryRecord
        The records of one attack.
    count : int
        Number of pictures.

    """
    apart = len(run) // 20
    waiting = {kind: sorted((record for record in run
                             if (record.effect or record.outcome) == kind
                             and record.match_frame is not None),
                            key=lambda record: (-(record.edits or 0), record.frame))
               for kind in _ORDER}
    chosen: list[QueryRecord] = []
    while len(chosen) < count and any(waiting.values()):
        for records in waiting.values():
            if records and len(chosen) < count:
                taken = [other.frame for other in chosen]
                far = [record for record in records
                       if all(abs(record.frame - frame) > apart for frame in taken)]
                record = (far or records)[0]
                records.remove(record)
                chosen.append(record)
    return sorted(chosen, key=lambda record: record.frame)


def describe(record: QueryRecord, clean: QueryRecord) -> tuple[str, str]:
    """Return title and caption of the picture of an attacked frame."""
    what, text = ((record.effect, _EFFECTS[record.effect]) if record.effect
                  else _OUTCOMES[record.outcome])
    title = f'Frame {record.frame}: {what}'
    caption = (f'{text} Probability {clean.probability:.2f} clean, {record.probability:.2f} '
               f'attacked; {record.edits or 0} edges flipped of {record.edit_budget or 0} '
               f'allowed, {record.queries or 0} queries.')
    return title, caption


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
    (place / _INDEX).write_text(json.dumps({'pictures': index}, indent=2) + '\n',
                                encoding='utf-8')


def read_pictures(folder: Path) -> list[tuple[str, str, bytes]]:
    """Return title, caption and JPEG bytes of the pictures that ``write_pictures`` wrote."""
    place = folder / PICTURES
    if not place.is_dir():
        return []
    entries = read_json(place / _INDEX)['pictures']
    return [(entry['title'], entry['caption'], (place / Path(entry['file']).name).read_bytes())
            for entry in entries]
