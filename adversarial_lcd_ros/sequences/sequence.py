# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sequence: frames in order of time, and ground truth where there is any."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.files.text import printable
from adversarial_lcd_ros.poses.trajectory import TOLERANCE_NS, Trajectory
from adversarial_lcd_ros.sequences.frame import Frame

# Called with how many of how many frames, or other steps, are done.
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Coverage:
    """
    How much of a sequence has ground truth; as a text, what every import ends with.

    Attributes
    ----------
    frames, posed_frames : int
        All, and those with a pose near them.
    posed_s : float
        From the first to the last of these, seconds.
    path_m : float
        Length of the path between, metres; NaN for places by index.
    truth : str
        Where the poses are from, or why there are none.

    """

    frames: int
    posed_frames: int
    posed_s: float
    path_m: float
    truth: str

    def __str__(self) -> str:
        """Return it in words."""
        if not self.posed_frames:
            return f'no ground truth: {printable(self.truth) or "the source has none"}'
        path = 'places by index' if math.isnan(self.path_m) else f'a path of {self.path_m:.2f} m'
        return (f'{self.posed_frames} of {self.frames} frames have a pose, over '
                f'{self.posed_s:.1f} s and {path}'
                + (f'; ground truth: {printable(self.truth)}' if self.truth else ''))


@dataclass(frozen=True, eq=False)
class Sequence:
    """
    A sequence that was opened and whose index was checked; frames are read when asked for.

    Attributes
    ----------
    name : str
        From the folder or file name.
    source : Path
    stamps_ns : int64, (n,)
        Of the frames, strictly ascending, nanoseconds.
    image_size : (int, int)
        Width and height of the first frame, pixels.
    trajectory : Trajectory or None
        Ground truth; None where the source has none.
    read : callable
        Returns an iterator of the frames of these numbers; use ``frames``.
    detections : Path or None
        Where the frames have no pictures: the file of what was detected in them.
    focal_length_px : float or None
        Of the camera, pixels, where the recording says it.
    frame_names : tuple of str
        Of the files of the frames, without their suffixes, where frames are files.
    notes : tuple of str
        What was chosen or left out on opening, a line each.
    truth : str
        In words: where the ground truth is from, or why there is none.

    Raises
    ------
    SequenceError
        There is no frame, frames are out of order, or none has ground truth near it.

    """

    name: str
    source: Path
    stamps_ns: NDArray[np.int64]
    image_size: tuple[int, int]
    trajectory: Trajectory | None
    read: Callable[[range], Iterator[Frame]]
    detections: Path | None = None
    focal_length_px: float | None = None
    frame_names: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    truth: str = ''

    def __post_init__(self) -> None:
        """Check the order of the frames, and that the ground truth is theirs."""
        object.__setattr__(self, 'stamps_ns', check_order(self.stamps_ns, self.source))
        if self.trajectory is not None and not self.trajectory.is_near(self.stamps_ns).any():
            truth_ns = self.trajectory.stamp_ns
            raise SequenceError(
                f'{self.source}: no frame ({self.stamps_ns[0]} to {self.stamps_ns[-1]} ns) has a '
                f'ground truth pose ({truth_ns[0]} to {truth_ns[-1]} ns) within '
                f'{TOLERANCE_NS / 1e9:g} s; is it the ground truth of this sequence?')

    @property
    def frame_count(self) -> int:
        """Number of frames."""
        return len(self.stamps_ns)

    @property
    def coverage(self) -> Coverage:
        """Which of the frames have ground truth."""
        if self.trajectory is None:
            return Coverage(self.frame_count, 0, 0.0, 0.0, self.truth)
        # At least one has: a sequence without is refused.
        posed = self.stamps_ns[self.trajectory.is_near(self.stamps_ns)]
        return Coverage(self.frame_count, len(posed), float(posed[-1] - posed[0]) / 1e9,
                        self.trajectory.at(posed).length_m, self.truth)

    def frames(self, start: int = 0, stop: int | None = None, stride: int = 1,
               ) -> Iterator[Frame]:
        """
        Yield the frames in order, all of them or those that a slice would choose.

        What is left out is not decoded, and from folders not read.

        Parameters
        ----------
        start, stop, stride : int
            First frame, the one after the last (None: to the end), and every how many frames
            one is taken. Not negative; a stop beyond the end is the end.

        Raises
        ------
        SequenceError
            A frame is missing or truncated, the source has changed since it was opened, or no
            such slice can be taken.

        """
        if start < 0 or stride < 1 or (stop is not None and stop < 0):
            raise SequenceError(f'frames from {start} to {stop}, every {stride}: expected a '
                                'start and a stop of 0 or more, and a stride of 1 or more')
        wanted = range(self.frame_count)[start:stop:stride]
        count = 0
        for number, frame in zip(wanted, self.read(wanted), strict=False):
            if frame.stamp_ns != self.stamps_ns[number]:
                raise SequenceError(f'{self.source} has changed since it was opened')
            count += 1
            yield frame
        if count != len(wanted):
            raise SequenceError(f'{self.source} is truncated: {count} of {len(wanted)} frames '
                                'could be read')


def check_order(stamps_ns: list[int] | NDArray[np.int64], source: Path) -> NDArray[np.int64]:
    """Return the stamps as an array; raise SequenceError if none or out of order."""
    stamps = np.array(stamps_ns, np.int64)
    stamps.setflags(write=False)
    if not len(stamps):
        raise SequenceError(f'{source} holds no camera frame')
    late = np.flatnonzero(np.diff(stamps) <= 0)
    if len(late):
        at = int(late[0]) + 1
        raise SequenceError(
            f'{source}: frame {at}, at {stamps[at]} ns, does not follow the one before it, at '
            f'{stamps[at - 1]} ns; frames must be in order of time')
    return stamps
