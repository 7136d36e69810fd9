# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sequence, or a part of it, as users name it: ``PATH`` or ``PATH@FROM:TO``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
import re

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.sequences.companions import is_terms

_PART = re.compile(r'(?P<path>.+)@(?P<start>[0-9]*\.?[0-9]+):(?P<stop>[0-9]*\.?[0-9]+)')


@dataclass(frozen=True)
class SequencePart:
    """
    A sequence, or a block of it in time, as the user named it.

    Attributes
    ----------
    path : Path
        What ``open_sequence`` opens.
    start, stop : float
        From and to which fraction of the frames, 0 <= start < stop <= 1. Parts that share an
        end share no frame: one can be trained on, the other tested on.

    Raises
    ------
    SequenceError
        The fractions are no part.

    """

    path: Path
    start: float = 0.0
    stop: float = 1.0

    def __post_init__(self) -> None:
        """Check the part."""
        if not 0 <= self.start < self.stop <= 1:
            raise SequenceError(f'part {self.start:g}:{self.stop:g} of {self.path}: expected '
                                '0 <= FROM < TO <= 1, such as 0:0.5 for the first half')

    @classmethod
    def parse(cls, text: str) -> SequencePart:
        """
        Read ``PATH`` or ``PATH@FROM:TO``; a path that exists may hold an @ of its own.

        Raises
        ------
        SequenceError
            What follows the @ is no part.

        """
        if '@' not in text or Path(text).exists():
            return cls(Path(text))
        found = _PART.fullmatch(text)
        if not found:
            raise SequenceError(f'there is no sequence {text}; a part of one is asked for as '
                                'PATH@FROM:TO, such as PATH@0:0.5 for the first half')
        return cls(Path(found['path']), float(found['start']), float(found['stop']))

    def numbers(self, frame_count: int) -> range:
        """
        Return which of the frames of the sequence belong to the part.

        Raises
        ------
        SequenceError
            None does.

        """
        numbers = range(int(frame_count * self.start), int(frame_count * self.stop))
        if not numbers:
            raise SequenceError(f'part {self.start:g}:{self.stop:g} of {self.path}, which has '
                                f'{frame_count} frames, holds none: expected a larger part')
        return numbers


def terms_of(path: Path) -> tuple[str, ...]:
    """Return the names of the files with credits or a licence beside the frames, sorted."""
    folder = path if path.is_dir() else path.parent
    return tuple(sorted(file.name for file in folder.iterdir()
                        if file.is_file() and is_terms(file)))
