# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sequences of the KITTI odometry benchmark."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.files.text import text_rows
from adversarial_lcd_ros.poses.pose_files import matrix_trajectory, read_kitti
from adversarial_lcd_ros.poses.trajectory import Trajectory, parse_stamp_ns
from adversarial_lcd_ros.sequences.image_files import file_sequence, images_in
from adversarial_lcd_ros.sequences.layouts.base import Layout, Options, choose_camera
from adversarial_lcd_ros.sequences.sequence import Sequence

NAME = 'KITTI odometry'
_TIMES, _CALIBRATION = 'times.txt', 'calib.txt'
# Left grey (whose poses are known), left colour, then the right eyes.
_CAMERAS = ('image_0', 'image_2', 'image_1', 'image_3')


def _find(path: Path) -> tuple[Path, str | None] | None:
    folder, camera = (path.parent, path.name) if path.name in _CAMERAS else (path, None)
    if _cameras(folder) and any((folder / name).is_file() for name in (_TIMES, _CALIBRATION)):
        return folder, camera
    return None


def _cameras(folder: Path) -> list[str]:
    return [name for name in _CAMERAS if (folder / name).is_dir()]


def _open(folder: Path, options: Options) -> Sequence:
    camera, notes = choose_camera(folder, NAME, _cameras(folder), options.camera)
    paths, stamps = images_in(folder / camera), _stamps(folder / _TIMES)
    if len(paths) != len(stamps):
        raise SequenceError(f'{folder / camera} holds {len(paths)} images, {folder / _TIMES} '
                            f'{len(stamps)} times: expected one for each')
    projection = _projection(folder / _CALIBRATION, camera[-1])
    trajectory = options.trajectory(stamps, lambda: _poses(folder, stamps),
                                    lambda: _mount(folder, camera, projection))
    return file_sequence(folder, paths, stamps, trajectory, notes=notes, focal_length_px=None
                         if projection is None else float(projection[0, 0]))


def _stamps(path: Path) -> list[int]:
    stamps = []
    for where, (text,) in text_rows(path, 'seconds'):
        try:
            stamps.append(parse_stamp_ns(text))
        except ValueError as error:
            raise SequenceError(f'{where}: {error}') from None
    return stamps


def _projection(path: Path, number: str) -> NDArray[np.float64] | None:
    """Return P0 to P3 of a calibration, float64 (3, 4): from the axes of camera 0 to pixels."""
    if not path.is_file():
        return None
    for where, (name, *fields) in text_rows(path, 'name ...'):
        if name == f'P{number}:':
            try:
                return np.array([float(text) for text in fields]).reshape(3, 4)
            except ValueError as error:
                raise SequenceError(f'{where}: {error}') from None
    return None


def _poses(folder: Path, stamps: list[int]) -> Trajectory | None:
    path = _truth(folder)
    if not path.is_file():
        return None
    poses = read_kitti(path)
    if len(poses) != len(stamps):
        raise SequenceError(f'{path} has {len(poses)} poses for {len(stamps)} frames: expected '
                            'one for each')
    return matrix_trajectory(stamps, poses, path)


def _truth(folder: Path) -> Path:
    return folder.resolve().parent.parent / 'poses' / f'{folder.resolve().name}.txt'


def _mount(folder: Path, camera: str,
           projection: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Return the pose of a camera on the axes of image_0, float64 (4, 4)."""
    mount = np.eye(4)
    if camera == _CAMERAS[0]:
        return mount
    if projection is None:
        raise SequenceError(f'{_truth(folder)} has poses of image_0, and {folder / _CALIBRATION} '
                            f'no P{camera[-1]} to tell where {camera} sits: add it, or give '
                            '--extrinsics or --ground-truth none')
    # P = K [1 | t]: the camera's centre is at -t on the axes of camera 0.
    mount[:3, 3] = -np.linalg.solve(projection[:, :3], projection[:, 3])
    return mount


LAYOUT = Layout(NAME, 'times.txt beside image_0', _find, _open)
