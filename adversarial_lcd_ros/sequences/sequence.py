"""A sequence: frames in order of time, and ground truth where there is any."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.sequences.frame import Frame
from adversarial_lcd_ros.sequences.trajectory import TOLERANCE_NS, Trajectory


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
        Returns an iterator of all frames; use ``frames``.

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
    read: Callable[[], Iterator[Frame]]

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

    def frames(self) -> Iterator[Frame]:
        """
        Yield the frames in order.

        Raises
        ------
        SequenceError
            A frame is missing or truncated, or the source has changed since it was opened.

        """
        count = 0
        for frame in self.read():
            if count >= self.frame_count or frame.stamp_ns != self.stamps_ns[count]:
                raise SequenceError(f'{self.source} has changed since it was opened')
            count += 1
            yield frame
        if count != self.frame_count:
            raise SequenceError(f'{self.source} is truncated: {count} of {self.frame_count} '
                                'frames could be read')


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
