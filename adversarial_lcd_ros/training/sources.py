# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The sequences that a training may see, or the parts of them.

Fractions of a sequence are blocks in time (``PATH@0:0.5``), never random frames: neighbouring
frames are near copies.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LabelConfig
from adversarial_lcd_ros.errors import EvaluationError, SequenceError
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE, label_frames
from adversarial_lcd_ros.sequences import Frame, Trajectory, open_sequence
from adversarial_lcd_ros.sequences import Sequence as FrameSequence
from adversarial_lcd_ros.sequences.part import SequencePart, terms_of


@dataclass(frozen=True, eq=False)
class TrainingFrames:
    """
    The frames of a source and their ground truth, opened and checked.

    Attributes
    ----------
    source : SequencePart
    sequence : adversarial_lcd_ros.sequences.Sequence
        The whole of it.
    trajectory : Trajectory
        Its ground truth.
    numbers : range
        The frames to train on.
    terms : tuple of str
        Names of the files with credits or a licence beside the frames.
    stated_licence : str
        What the user says of the licence of the pictures; '' for nothing.

    """

    source: SequencePart
    sequence: FrameSequence
    trajectory: Trajectory
    numbers: range
    terms: tuple[str, ...]
    stated_licence: str = ''

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
        if self.stated_licence:
            return self.stated_licence
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


def open_source(source: SequencePart, licence: str = '') -> TrainingFrames:
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
                          source.numbers(sequence.frame_count), terms_of(source.path), licence)


def one_licence_each(sources: Sequence[SequencePart], licences: Sequence[str]) -> list[str]:
    """
    Return the licence of each source in their order, '' where none is given.

    Raises
    ------
    SequenceError
        There are licences, but not one for each source.

    """
    if licences and len(licences) != len(sources):
        raise SequenceError(f'{len(licences)} licences for {len(sources)} sequences: expected '
                            'one for each, in their order, or none')
    return list(licences) or [''] * len(sources)
