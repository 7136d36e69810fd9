# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses of a file, whatever its form, brought to the frames of a sequence."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.files.text import text_rows
from adversarial_lcd_ros.poses.pose_files import (
    check_pose_matrix,
    matrix_trajectory,
    read_euroc,
    read_kitti,
    read_matrices,
    read_tum,
)
from adversarial_lcd_ros.poses.trajectory import TOLERANCE_NS, Trajectory

_TUM, _KITTI, _MATRICES = 8, 12, (4, 16)
_FORMS = ('TUM (timestamp tx ty tz qx qy qz qw), EuRoC (timestamp,x,y,z,qw,qx,qy,qz), KITTI (12 '
          'numbers a line), 4 x 4 matrices')
_NS = 1_000_000_000
# A single pose at 0 is no numbering.
_FEWEST = 2


def read_poses(path: Path, stamps_ns: ArrayLike) -> Trajectory:
    """
    Read a file of poses in the form of TUM, EuRoC or KITTI, or of 4 x 4 matrices.

    Forms without stamps, and stamps that are the numbers of frames (0, 1, 2, ...), take those
    of the frames.

    Parameters
    ----------
    path : Path
    stamps_ns : int, (n,)
        Of the frames, nanoseconds, strictly ascending.

    Raises
    ------
    SequenceError
        The file is missing, has another form or is damaged, or its poses are not those of the
        frames: too few or too many, or by numbers of which it is not clear where they start.

    """
    stamps = np.asarray(stamps_ns, np.int64)
    poses = _read(path)
    if isinstance(poses, Trajectory):
        return by_number(poses, stamps, path)
    if len(poses) != len(stamps):
        raise SequenceError(f'{path} has {len(poses)} poses without stamps, for {len(stamps)} '
                            'frames: expected one a frame')
    return matrix_trajectory(stamps, poses, path)


def image_poses(path: Path, ticks_ns: NDArray[np.int64],
                has_rate: bool) -> tuple[NDArray[np.int64], Trajectory]:
    """
    Return the stamps of images that have none, and their poses.

    Pose i of as many belongs to image i and stamps it, unless it has no stamp either. Else the
    first image is taken with the first pose, the others at the rate.

    Parameters
    ----------
    path : Path
        As for ``read_poses``.
    ticks_ns : int64, (n,)
        Stamps of the images at their rate, from 0.
    has_rate : bool
        The rate was given.

    Raises
    ------
    SequenceError
        As ``read_poses``; or a rate contradicts the stamps of one pose an image, or none is
        given where the poses are more or fewer than the images.

    """
    poses = _read(path)
    if not isinstance(poses, Trajectory) or _first_number(poses, ticks_ns) is not None:
        return ticks_ns, read_poses(path, ticks_ns)
    if len(poses) != len(ticks_ns):
        if not has_rate:
            raise SequenceError(f'{len(ticks_ns)} images, but {path} has {len(poses)} poses: '
                                'expected one pose per image, or the rate of the images in Hz, '
                                'or "none"')
        return ticks_ns + poses.stamp_ns[0], poses
    if has_rate and not _same_time(poses.stamp_ns - poses.stamp_ns[0], ticks_ns):
        seconds = (poses.stamp_ns[-1] - poses.stamp_ns[0]) / _NS
        raise SequenceError(
            f'{path} has one pose per image, over {seconds:g} s, but at the rate given the '
            f'images take {ticks_ns[-1] / _NS:g} s: leave the rate out, the poses stamp the '
            'images')
    return poses.stamp_ns, poses


def by_number(poses: Trajectory, stamps_ns: NDArray[np.int64],
              source: Path | str) -> Trajectory:
    """
    Return poses whose stamps are the numbers of frames with the stamps of these frames.

    Others are returned as they are; raises SequenceError where it is not clear whether the
    first frame has the number 0 or 1.
    """
    first = _first_number(poses, stamps_ns)
    if first is None:
        return poses
    numbers = poses.stamp_ns // _NS
    if first < 0:
        raise SequenceError(
            f'the stamps of {source} are the numbers {numbers[0]} to {numbers[-1]} of '
            f'{len(stamps_ns)} frames, but nobody can tell whether these count from 0 or from 1: '
            'give the stamps in seconds, or a pose for the first or the last frame')
    return Trajectory(stamps_ns[numbers - first], poses.position, poses.quaternion,
                      poses.frame_id)


def parse_extrinsics(words: Sequence[str]) -> NDArray[np.float64]:
    """
    Return where a camera is mounted, float64 (4, 4), from a command line.

    Parameters
    ----------
    words : sequence of str
        tx ty tz qx qy qz qw (metres), a file with a 4 x 4 matrix, or 'identity'.

    Raises
    ------
    SequenceError
        They are none of these.

    """
    if list(words) == ['identity']:
        return np.eye(4)
    if len(words) == 1:
        matrices = read_matrices(Path(words[0]))
        if len(matrices) != 1:
            raise SequenceError(f'{words[0]} has {len(matrices)} matrices: expected one')
        return check_pose_matrix(matrices[0], words[0])
    try:
        values = [float(word) for word in words]
        # The checks of a pose: seven finite numbers, a unit quaternion.
        pose = Trajectory(np.zeros(1, np.int64), np.array([values[:3]]), np.array([values[3:]]))
    except (ValueError, SequenceError) as error:
        raise SequenceError(f'extrinsics {" ".join(words)}: {error}; expected tx ty tz qx qy qz '
                            'qw, a file with a 4 x 4 matrix, or "identity"') from None
    mount = np.eye(4)
    mount[:3, :3] = Rotation.from_quat(pose.quaternion[0].copy()).as_matrix()
    mount[:3, 3] = pose.position[0]
    return mount


def _first_number(poses: Trajectory, stamps_ns: NDArray[np.int64]) -> int | None:
    """Return the number of the first frame, -1 if unclear; None: the stamps are times."""
    count, last = len(stamps_ns), int(poses.stamp_ns[-1]) // _NS
    if (len(poses) < _FEWEST or (poses.stamp_ns % _NS).any() or last > count
            or _same_time(poses.stamp_ns, stamps_ns)):
        return None
    if len(poses) < count and _within(poses.stamp_ns, stamps_ns):
        # A pose a second, on a clock that started with the frames.
        return None
    if poses.stamp_ns[0] == 0:
        return 0 if last < count else None
    return 1 if last == count else -1


def _within(inner_ns: NDArray[np.int64], outer_ns: NDArray[np.int64]) -> bool:
    return bool(inner_ns[0] >= outer_ns[0] - TOLERANCE_NS
                and inner_ns[-1] <= outer_ns[-1] + TOLERANCE_NS)


def _same_time(first_ns: NDArray[np.int64], second_ns: NDArray[np.int64]) -> bool:
    """Tell whether pose i is that of frame i: off by less than half the time between two."""
    if len(first_ns) != len(second_ns):
        return False
    period_ns = np.diff(second_ns).min() if len(second_ns) > 1 else 2 * TOLERANCE_NS
    return bool(np.abs(first_ns - second_ns).max() < max(period_ns / 2, 1))


def _read(path: Path) -> Trajectory | NDArray[np.float64]:
    """Return poses with stamps, or float64 (n, 4, 4) without."""
    where, fields = next(text_rows(path, 'value ...'), ('', []))
    if not fields:
        raise SequenceError(f'{path} holds no pose: expected {_FORMS}')
    if ',' in ''.join(fields):
        return read_euroc(path)
    if len(fields) == _KITTI:
        return read_kitti(path)
    if len(fields) in _MATRICES:
        return read_matrices(path)
    if len(fields) != _TUM:
        raise SequenceError(f'{where}: {len(fields)} fields; expected {_FORMS}')
    return read_tum(path)
