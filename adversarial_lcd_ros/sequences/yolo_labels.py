# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Detections in: a folder of labels as YOLO writes them, one text per picture."""

from __future__ import annotations

from collections.abc import Iterator
import csv
import math
from pathlib import Path

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.files.text import text_rows
from adversarial_lcd_ros.sequences.detections import COLUMNS, MAX_CLASS
from adversarial_lcd_ros.sequences.image_choice import named_stamps
from adversarial_lcd_ros.sequences.image_files import is_hidden
from adversarial_lcd_ros.sequences.sequence import Sequence

# Beside the labels there may be the names of the classes.
_NO_LABELS = ('classes.txt', 'labels.txt', 'notes.txt', 'readme.txt')
_FIELDS = 'class cx cy w h [confidence]'
# Boxes may reach beyond the picture, by as much as it is large.
_REACH = (-1.0, 2.0)


def convert_labels(folder: Path, sequence: Sequence, path: Path) -> int:
    """
    Write the labels of YOLO for a sequence as the CSV that ``read_detections`` reads.

    A text of lines ``class cx cy w h [confidence]``, in shares of the picture, belongs to the
    picture of its name; without a confidence it is 1. Pictures without a text have no objects.

    Parameters
    ----------
    folder : Path
        Of the texts, or with a folder ``labels`` that holds them.
    sequence : Sequence
        Whose frames were looked at.
    path : Path
        CSV to write.

    Returns
    -------
    int
        Detections written.

    Raises
    ------
    SequenceError
        There are no labels, a line is none, or the names are not those of the frames.

    """
    folder = folder / 'labels' if (folder / 'labels').is_dir() else folder
    files = [file for file in sorted(folder.glob('*.txt'))
             if not is_hidden(file) and file.name.lower() not in _NO_LABELS]
    if not files:
        raise SequenceError(f'{folder} holds no labels: expected a text per picture, with lines '
                            f'of {_FIELDS}')
    stamps = _stamps(folder, files, sequence)
    rows = [(stamps[file], *row) for file in files for row in _rows(file, sequence.image_size)]
    with path.open('w', encoding='utf-8', newline='') as stream:
        writer = csv.writer(stream)
        writer.writerow(COLUMNS)
        writer.writerows((f'{stamp // 10**9}.{stamp % 10**9:09d}', *row) for stamp, *row in rows)
    return len(rows)


def _stamps(folder: Path, files: list[Path], sequence: Sequence) -> dict[Path, int]:
    """Return the stamp of the frame that each text belongs to, by names."""
    known = dict(zip(sequence.frame_names, sequence.stamps_ns.tolist(), strict=False))
    if all(file.stem in known for file in files):
        return {file: known[file.stem] for file in files}
    named = named_stamps(files)
    frames = set(sequence.stamps_ns.tolist())
    if named is not None and frames.issuperset(named):
        return dict(zip(files, named, strict=True))
    odd = next((file.name for file in files if file.stem not in known), files[0].name)
    example = (f'such as {sequence.frame_names[0]}.txt' if sequence.frame_names else
               'and a bag does not know them: name the folder of the pictures as the source')
    raise SequenceError(f'{folder}: {odd} is named like none of the {sequence.frame_count} frames '
                        f'of {sequence.source}; labels of YOLO have the names of the pictures, '
                        f'{example}')


def _rows(file: Path, size: tuple[int, int],
          ) -> Iterator[tuple[int, float, float, float, float, float]]:
    """Yield class, x, y, w, h in pixels, and score."""
    width, height = size
    for where, fields in text_rows(file, 'class cx cy w h ...'):
        if len(fields) > 6:
            raise SequenceError(f'{where}: {len(fields)} fields; expected {_FIELDS}: outlines and '
                                'key points are not boxes')
        try:
            label = int(fields[0])
            cx, cy, w, h, score = (float(text) for text in (*fields[1:], '1')[:5])
        except ValueError as error:
            raise SequenceError(f'{where}: {error}') from None
        if not 0 <= label <= MAX_CLASS:
            raise SequenceError(f'{where}: class {label}; expected 0 to {MAX_CLASS}')
        shares = (cx, cy, w, h)
        if (not all(map(math.isfinite, (*shares, score))) or min(w, h) <= 0
                or not all(_REACH[0] <= share <= _REACH[1] for share in shares)
                or not 0 <= score <= 1):
            raise SequenceError(f'{where}: {" ".join(fields[1:])}; expected cx cy w h in shares '
                                'of the picture, 0 to 1, and a confidence')
        yield (label, (cx - w / 2) * width, (cy - h / 2) * height, w * width, h * height, score)
