# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of poses as benchmarks publish them: TUM, EuRoC, KITTI, and 4 x 4 matrices."""

from __future__ import annotations

import math
from pathlib import Path
import re

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.files.text import text_rows
from adversarial_lcd_ros.poses.trajectory import NORM_TOLERANCE, Trajectory, parse_stamp_ns

_MAX_NS = 2**63 - 1
_NANOSECONDS = re.compile('[0-9]{1,19}')
_ORTHOGONAL_TOLERANCE = 0.01


def read_tum(path: Path) -> Trajectory:
    """
    Read poses in TUM's form: ``timestamp tx ty tz qx qy qz qw`` (seconds, metres).

    Motion capture writes some stamps twice (rounded to 0.1 ms): the first pose is kept.

    Raises
    ------
    SequenceError
        The file is missing or empty, or a line is malformed, not finite, or out of order.

    """
    rows = _PoseRows(path, 'timestamp tx ty tz qx qy qz qw')
    for where, fields in text_rows(path, rows.columns):
        try:
            stamp_ns, values = parse_stamp_ns(fields[0]), [float(text) for text in fields[1:]]
        except ValueError as error:
            raise SequenceError(f'{where}: {error}') from None
        rows.add(where, stamp_ns, values)
    return rows.trajectory()


def read_euroc(path: Path) -> Trajectory:
    """
    Read poses in EuRoC's form: CSV of ``timestamp [ns], x, y, z, qw, qx, qy, qz, ...``.

    Columns behind these (velocity, biases) are left alone. The poses are those of whatever was
    tracked: in EuRoC and TUM-VI of the body, not of a camera (see ``mounted``).

    Raises
    ------
    SequenceError
        As ``read_tum``.

    """
    rows = _PoseRows(path, 'timestamp,x,y,z,qw,qx,qy,qz')
    for where, fields in text_rows(path, 'timestamp x y z qw qx qy qz ...', ','):
        try:
            x, y, z, qw, *imaginary = map(float, fields[1:8])
        except ValueError as error:
            raise SequenceError(f'{where}: {error}') from None
        if not _NANOSECONDS.fullmatch(fields[0]) or int(fields[0]) > _MAX_NS:
            raise SequenceError(f'{where}: {fields[0]} is no time stamp in nanoseconds; poses '
                                f'between commas are read as EuRoC writes them, {rows.columns}, '
                                'and those of TUM between blanks')
        stamp_ns = int(fields[0])
        rows.add(where, stamp_ns, [x, y, z, *imaginary, qw])
    return rows.trajectory()


def read_kitti(path: Path) -> NDArray[np.float64]:
    """
    Read poses in KITTI's form, float64 (n, 4, 4): the upper three rows of a matrix a line.

    Raises
    ------
    SequenceError
        The file is missing or empty, or a line is malformed or no pose.

    """
    poses = []
    for where, fields in text_rows(path, ' '.join(['m'] * 12)):
        upper = _numbers(where, fields).reshape(3, 4)
        poses.append(check_pose_matrix(np.vstack([upper, [0, 0, 0, 1]]), where))
    return _stack(path, poses, '12 numbers a line')


def read_matrices(path: Path) -> NDArray[np.float64]:
    """
    Read 4 x 4 matrices, float64 (n, 4, 4): 16 numbers a line, or four lines of four.

    A matrix of which any number is not finite stands for a frame without a pose, as in ScanNet:
    it is returned as it is.

    Raises
    ------
    SequenceError
        The file is missing or empty, or a matrix is malformed or no pose.

    """
    rows: list[NDArray[np.float64]] = []
    first = ''
    for where, fields in text_rows(path, 'm m m m ...'):
        first = first or where
        if len(fields) not in (4, 16):
            raise SequenceError(f'{where}: {len(fields)} numbers; expected a row of 4, or a '
                                'matrix of 16')
        rows.extend(_numbers(where, fields).reshape(-1, 4))
    if not rows or len(rows) % 4:
        raise SequenceError(f'{path}: expected 4 rows of 4 numbers a pose, found {len(rows)} '
                            'rows')
    matrices = np.reshape(rows, (-1, 4, 4))
    for number, matrix in enumerate(matrices):
        if np.isfinite(matrix).all():
            check_pose_matrix(matrix, f'{path}, pose {number}')
    return matrices


def check_pose_matrix(matrix: NDArray[np.float64], what: str) -> NDArray[np.float64]:
    """Return a matrix, float64 (4, 4), if it is a rotation and a shift; raise SequenceError."""
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise SequenceError(f'{what}: expected 4 rows of 4 finite numbers')
    turn = matrix[:3, :3]
    if (np.abs(turn @ turn.T - np.eye(3)).max() > _ORTHOGONAL_TOLERANCE
            or np.linalg.det(turn) < 0):
        raise SequenceError(f'{what}: the first 3 x 3 numbers are no rotation')
    if np.abs(matrix[3] - [0, 0, 0, 1]).max() > _ORTHOGONAL_TOLERANCE:
        raise SequenceError(f'{what}: the last row is no 0 0 0 1')
    return matrix


def matrix_trajectory(stamps_ns: ArrayLike, matrices: NDArray[np.float64],
                      source: Path) -> Trajectory:
    """
    Return poses given as matrices, float64 (n, 4, 4), with a stamp each.

    Where tracking was lost a matrix is not finite: that frame has no pose. Raises SequenceError
    where none has one.
    """
    known = np.isfinite(matrices).all(axis=(1, 2))
    if not known.any():
        raise SequenceError(f'{source}: none of {len(matrices)} poses is of finite numbers')
    matrices = matrices[known]
    return Trajectory(np.asarray(stamps_ns, np.int64)[known], matrices[:, :3, 3],
                      Rotation.from_matrix(matrices[:, :3, :3]).as_quat())


def mounted(body: Trajectory, mount: NDArray[np.float64]) -> Trajectory:
    """
    Return the poses of a camera that is mounted on a body.

    Parameters
    ----------
    body : Trajectory
        Body to world.
    mount : float64, (4, 4)
        Camera to body: T_BS of EuRoC's sensor.yaml.

    """
    turn = Rotation.from_quat(body.quaternion.copy())
    return Trajectory(body.stamp_ns, body.position + turn.apply(mount[:3, 3]),
                      (turn * Rotation.from_matrix(mount[:3, :3])).as_quat(), body.frame_id)


class _PoseRows:
    """Collects poses in order of time, and names the line that is wrong."""

    def __init__(self, path: Path, columns: str) -> None:
        self.columns = columns
        self._path = path
        self._stamps: list[int] = []
        self._poses: list[list[float]] = []

    def add(self, where: str, stamp_ns: int, values: list[float]) -> None:
        """Add x y z qx qy qz qw; of a stamp written twice the first pose is kept."""
        if not all(map(math.isfinite, values)):
            raise SequenceError(f'{where}: the pose holds NaN or infinity; leave out what was '
                                'not measured')
        norm = math.hypot(*values[3:])
        if abs(norm - 1) > NORM_TOLERANCE:
            raise SequenceError(f'{where}: quaternion of norm {norm:.4g}: expected 1, in the '
                                f'order {self.columns}')
        if self._stamps and stamp_ns < self._stamps[-1]:
            raise SequenceError(f'{where}: {stamp_ns / 1e9:.9g} s is earlier than the line before '
                                'it; sort the file by time')
        if not self._stamps or stamp_ns > self._stamps[-1]:
            self._stamps.append(stamp_ns)
            self._poses.append(values)

    def trajectory(self) -> Trajectory:
        if not self._stamps:
            raise SequenceError(f'{self._path} holds no pose: expected {self.columns}')
        array = np.asarray(self._poses)
        return Trajectory(np.asarray(self._stamps), array[:, :3], array[:, 3:])


def _numbers(where: str, fields: list[str]) -> NDArray[np.float64]:
    try:
        return np.array([float(text) for text in fields])
    except ValueError as error:
        raise SequenceError(f'{where}: {error}') from None


def _stack(path: Path, poses: list[NDArray[np.float64]], expected: str) -> NDArray[np.float64]:
    if not poses:
        raise SequenceError(f'{path} holds no pose: expected {expected}')
    return np.stack(poses)
