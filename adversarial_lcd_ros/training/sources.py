"""The sequences that a training may see, or the parts of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
import re

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LabelConfig
from adversarial_lcd_ros.errors import EvaluationError, SequenceError
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE, label_frames
from adversarial_lcd_ros.sequences import Frame, Trajectory, open_sequence
from adversarial_lcd_ros.sequences import Sequence as FrameSequence

_PART = re.compile(r'(?P<path>.+)@(?P<start>[0-9]*\.?[0-9]+):(?P<stop>[0-9]*\.?[0-9]+)')
# What the files are called that say what one may do with the pictures.
_TERMS = ('credits', 'license', 'licence')


@dataclass(frozen=True)
class TrainingSource:
    """
    A sequence, or a block of it in time, as the user named it.

    Attributes
    ----------
    path : Path
        What ``open_sequence`` opens.
    start, stop : float
        From and to which fraction of the frames, 0 <= start < stop <= 1. Parts that share an
        end share no frame: one can be trained on, the other tested on.
    licence : str
        Licence of the pictures, for the model card; '' where it is not given.

    Raises
    ------
    SequenceError
        The fractions are no part.

    """

    path: Path
    start: float = 0.0
    stop: float = 1.0
    licence: str = ''

    def __post_init__(self) -> None:
        """Check the part."""
        if not 0 <= self.start < self.stop <= 1:
            raise SequenceError(f'part {self.start:g}:{self.stop:g} of {self.path}: expected '
                                '0 <= FROM < TO <= 1, such as 0:0.5 for the first half')

    @classmethod
    def parse(cls, text: str) -> TrainingSource:
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


@dataclass(frozen=True, eq=False)
class TrainingFrames:
    """
    The frames of a source and their ground truth, opened and checked.

    Attributes
    ----------
    source : TrainingSource
    sequence : adversarial_lcd_ros.sequences.Sequence
        The whole of it.
    trajectory : Trajectory
        Its ground truth.
    numbers : range
        The frames to train on.
    terms : tuple of str
        Names of the files with credits or a licence beside the frames.

    """

    source: TrainingSource
    sequence: FrameSequence
    trajectory: Trajectory
    numbers: range
    terms: tuple[str, ...]

    @property
    def name(self) -> str:
        """Return the sequence, and which of its frames, in words."""
        if len(self.numbers) == self.sequence.frame_count:
            return self.sequence.name
        return (f'{self.sequence.name}, frames {self.numbers[0]} to {self.numbers[-1]} of '
                f'{self.sequence.frame_count}')

    @property
    def licence(self) -> str:
        """Return the licence that was given, or where one is found, or that none is known."""
        if self.source.licence:
            return self.source.licence
        return f'see {", ".join(self.terms)} of the sequence' if self.terms else 'not stated'

    @property
    def stamps_ns(self) -> NDArray[np.int64]:
        """Return the stamps of the frames to train on, int64 (n,), nanoseconds."""
        stamps: NDArray[np.int64] = self.sequence.stamps_ns[
            self.numbers.start:self.numbers.stop]
        return stamps

    def frames(self, stride: int = 1) -> Iterator[Frame]:
        """Yield the frames to train on, or every so many-th of them."""
        return self.sequence.frames(self.numbers.start, self.numbers.stop, stride)

    def check_labels(self, labels: LabelConfig) -> None:
        """
        See from the ground truth alone that there is something to learn.

        Raises
        ------
        EvaluationError
            There are no loops, or no different places.

        """
        found = label_frames(self.trajectory, self.stamps_ns, self.sequence.image_size, labels)
        loops, others = (int((np.tril(found.relation, -1) == kind).sum())
                         for kind in (POSITIVE, NEGATIVE))
        if not loops or not others:
            raise EvaluationError(
                f'{self.name}: {len(self.numbers)} frames with {loops} pairs that are loops and '
                f'{others} of different places: expected both to train on; take a longer part, '
                f'or set labels (min_gap_s is {labels.min_gap_s:g} s)')


def open_source(source: TrainingSource) -> TrainingFrames:
    """
    Open a sequence to train on.

    Raises
    ------
    SequenceError
        It cannot be opened, has no ground truth, or its part has no frame.

    """
    sequence = open_sequence(source.path)
    if sequence.trajectory is None:
        raise SequenceError(f'{source.path} has no ground truth: training needs it to know the '
                            'loops; put a groundtruth.txt beside the frames, or import the '
                            'sequence with --ground-truth')
    return TrainingFrames(source, sequence, sequence.trajectory,
                          source.numbers(sequence.frame_count), terms_of(source.path))


def with_licences(sources: list[TrainingSource], licences: list[str]) -> list[TrainingSource]:
    """
    Return the sources, each with its licence in the order given.

    Raises
    ------
    SequenceError
        There are licences, but not one for each source.

    """
    if not licences:
        return sources
    if len(licences) != len(sources):
        raise SequenceError(f'{len(licences)} licences for {len(sources)} sequences: expected '
                            'one for each, in their order, or none')
    return [replace(source, licence=licence)
            for source, licence in zip(sources, licences, strict=True)]


def terms_of(path: Path) -> tuple[str, ...]:
    """Return the names of the files with credits or a licence beside the frames, sorted."""
    folder = path if path.is_dir() else path.parent
    return tuple(sorted(file.name for file in folder.iterdir()
                        if file.is_file() and file.stem.lower() in _TERMS))
