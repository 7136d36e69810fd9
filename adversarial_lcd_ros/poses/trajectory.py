# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ground truth: where the camera was, and when."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal, InvalidOperation

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation, Slerp

from adversarial_lcd_ros.errors import SequenceError

WORLD, PLACE_INDEX = 'world', 'place_index'
TOLERANCE_NS = 50_000_000
# Ground truth in text has four digits or more; beyond this it is no unit quaternion.
NORM_TOLERANCE = 0.01
# Stamps are int64 nanoseconds.
_MAX_SECONDS = 2**33


@dataclass(frozen=True, eq=False)
class Trajectory:
    """
    Camera poses, ascending in time, at least one.

    Attributes
    ----------
    stamp_ns : int64, (k,)
        Nanoseconds, strictly ascending.
    position : float64, (k, 3)
        Metres; under 'place_index' the index of the place is x.
    quaternion : float64, (k, 4)
        Camera optical frame to world, x y z w.
    frame_id : str
        'world' (or what the source calls it), or 'place_index'.

    Raises
    ------
    SequenceError
        Wrong shapes, values that are not finite, no unit quaternions, stamps out of order.

    """

    stamp_ns: NDArray[np.int64]
    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    frame_id: str = WORLD

    def __post_init__(self) -> None:
        """Copy the arrays, check them and make them read-only."""
        for name, dtype in (('stamp_ns', np.int64), ('position', float), ('quaternion', float)):
            array = np.array(getattr(self, name), dtype)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        count = len(self.stamp_ns)
        if not count:
            raise SequenceError('ground truth without a pose: expected at least one')
        shapes = self.stamp_ns.shape, self.position.shape, self.quaternion.shape
        if shapes != ((count,), (count, 3), (count, 4)):
            raise SequenceError(f'poses of shapes {shapes}: expected (k,), (k, 3), (k, 4)')
        self._check_values()

    def _check_values(self) -> None:
        finite = np.isfinite(self.position).all(axis=1) & np.isfinite(self.quaternion).all(axis=1)
        if not finite.all():
            raise SequenceError(f'pose {int(np.argmin(finite))} of the ground truth holds NaN or '
                                'infinity: leave out what was not measured')
        norm = np.linalg.norm(self.quaternion, axis=1)
        worst = int(np.argmax(np.abs(norm - 1)))
        if abs(norm[worst] - 1) > NORM_TOLERANCE:
            raise SequenceError(f'pose {worst} of the ground truth has a quaternion of norm '
                                f'{norm[worst]:.4g}: expected 1, in the order x y z w')
        late = np.flatnonzero(np.diff(self.stamp_ns) <= 0)
        if len(late):
            at = int(late[0]) + 1
            raise SequenceError(
                f'pose {at} of the ground truth, at {self.stamp_ns[at]} ns, does not follow the '
                f'one before it, at {self.stamp_ns[at - 1]} ns: poses must ascend in time')

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def is_near(self, stamps_ns: ArrayLike, tolerance_ns: int = TOLERANCE_NS,
                ) -> NDArray[np.bool_]:
        """Tell for each stamp whether a pose is within the tolerance, bool (n,)."""
        stamps = np.asarray(stamps_ns, np.int64)
        near: NDArray[np.bool_] = np.abs(
            self.stamp_ns[nearest_in_time(self.stamp_ns, stamps)] - stamps) <= tolerance_ns
        return near

    def at(self, stamps_ns: ArrayLike, tolerance_ns: int = TOLERANCE_NS) -> Trajectory:
        """
        Return one pose per stamp, with these stamps.

        Between two poses that are both within the tolerance it is interpolated (positions
        linearly, rotations along the shortest arc); else, and for a place index always, it is
        the nearest one.

        Parameters
        ----------
        stamps_ns : int, (n,)
            Nanoseconds, strictly ascending.
        tolerance_ns : int
            Largest distance to the nearest pose, nanoseconds.

        Raises
        ------
        SequenceError
            A stamp has no pose within the tolerance, or the stamps do not ascend.

        """
        stamps = np.asarray(stamps_ns, np.int64)
        row = nearest_in_time(self.stamp_ns, stamps)
        offset = np.abs(self.stamp_ns[row] - stamps)
        if (offset > tolerance_ns).any():
            at = int(np.argmax(offset > tolerance_ns))
            raise SequenceError(
                f'no ground truth within {tolerance_ns / 1e9:g} s of {stamps[at]} ns: the nearest '
                f'pose is {offset[at] / 1e9:.3f} s away')
        position, quaternion = self.position[row].copy(), self.quaternion[row].copy()
        if self.frame_id != PLACE_INDEX and len(self) > 1:
            self._interpolate(stamps, tolerance_ns, position, quaternion)
        return Trajectory(stamps, position, quaternion, self.frame_id)

    def between(self, first_ns: int, last_ns: int) -> Trajectory:
        """Return the poses from one stamp to another, both included; raises SequenceError."""
        kept = (self.stamp_ns >= first_ns) & (self.stamp_ns <= last_ns)
        return Trajectory(self.stamp_ns[kept], self.position[kept], self.quaternion[kept],
                          self.frame_id)

    @property
    def length_m(self) -> float:
        """Length of the path from pose to pose, metres; NaN for a place index."""
        if self.frame_id == PLACE_INDEX:
            return float('nan')
        return float(np.linalg.norm(np.diff(self.position, axis=0), axis=1).sum())

    def _interpolate(self, stamps: NDArray[np.int64], tolerance_ns: int,
                     position: NDArray[np.float64], quaternion: NDArray[np.float64]) -> None:
        after = np.clip(np.searchsorted(self.stamp_ns, stamps), 1, len(self) - 1)
        early, late = stamps - self.stamp_ns[after - 1], self.stamp_ns[after] - stamps
        inside = (early > 0) & (late > 0) & (np.maximum(early, late) <= tolerance_ns)
        if not inside.any():
            return
        after = after[inside]
        share = (early[inside] / (early[inside] + late[inside]))[:, None]
        position[inside] = self.position[after - 1] * (1 - share) + self.position[after] * share
        # Seconds from the start: float64 holds nanoseconds of the day, not those since 1970.
        seconds = (self.stamp_ns - self.stamp_ns[0]) / 1e9
        wanted = np.clip((stamps[inside] - self.stamp_ns[0]) / 1e9, seconds[0], seconds[-1])
        quaternion[inside] = Slerp(seconds, Rotation.from_quat(self.quaternion))(wanted).as_quat()


def nearest_in_time(known_ns: NDArray[np.int64], wanted_ns: NDArray[np.int64]
                    ) -> NDArray[np.int64]:
    """
    Return which of some ascending stamps is nearest to each wanted one; of two the earlier.

    Parameters
    ----------
    known_ns : int64, (k,)
        Ascending, at least one.
    wanted_ns : int64, (n,)

    Returns
    -------
    int64, (n,)
        Indices of ``known_ns``.

    """
    after = np.minimum(np.searchsorted(known_ns, wanted_ns), len(known_ns) - 1)
    before = np.maximum(after - 1, 0)
    earlier = np.abs(wanted_ns - known_ns[before]) <= np.abs(known_ns[after] - wanted_ns)
    return np.where(earlier, before, after)


def parse_stamp_ns(text: str) -> int:
    """Return the nanoseconds in a decimal number of seconds, exactly; raises ValueError."""
    try:
        seconds = Decimal(text)
    except InvalidOperation:
        raise ValueError(f'{text!r} is no number of seconds') from None
    if not (seconds.is_finite() and 0 <= seconds < _MAX_SECONDS):
        raise ValueError(f'{text!r} is no time stamp in seconds')
    return int(seconds * 1_000_000_000)
