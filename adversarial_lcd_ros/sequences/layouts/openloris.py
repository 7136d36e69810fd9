# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Packages of OpenLORIS-Scene: several cameras on a robot whose base was tracked."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.poses.pose_files import check_pose_matrix, read_tum
from adversarial_lcd_ros.poses.trajectory import Trajectory
from adversarial_lcd_ros.sequences.image_files import file_sequence
from adversarial_lcd_ros.sequences.layouts.base import Layout, Options, choose_camera
from adversarial_lcd_ros.sequences.layouts.tum import list_images
from adversarial_lcd_ros.sequences.sequence import Sequence

NAME = 'OpenLORIS'
# Camera to the frame that its calibration is under.
_FRAMES = {'color': 'd400_color_optical_frame', 'fisheye1': 't265_fisheye1_optical_frame',
           'fisheye2': 't265_fisheye2_optical_frame'}
_BASE = 'base_link'
_TRUTH, _MOUNTS, _SENSORS = 'groundtruth.txt', 'trans_matrix.yaml', 'sensors.yaml'
_MAX_LINKS = 16


def _find(path: Path) -> tuple[Path, str | None] | None:
    folder, camera = (path.parent, path.name) if path.name in _FRAMES else (path, None)
    return (folder, camera) if _cameras(folder) else None


def _cameras(folder: Path) -> list[str]:
    return [name for name in _FRAMES
            if (folder / f'{name}.txt').is_file() and (folder / name).is_dir()]


def _open(folder: Path, options: Options) -> Sequence:
    camera, notes = choose_camera(folder, NAME, _cameras(folder), options.camera)
    stamps, paths = list_images(folder / f'{camera}.txt')
    trajectory = options.trajectory(stamps, lambda: _base_poses(folder),
                                    lambda: _mount(folder, _FRAMES[camera]))
    return file_sequence(folder, paths, stamps, trajectory, notes=notes,
                         focal_length_px=_focal_length(folder / _SENSORS, _FRAMES[camera]))


def _base_poses(folder: Path) -> Trajectory | None:
    return read_tum(folder / _TRUTH) if (folder / _TRUTH).is_file() else None


def _mount(folder: Path, frame: str) -> NDArray[np.float64]:
    """Return the camera's pose on the base: the product of the links up to it."""
    path = folder / _MOUNTS
    if not path.is_file():
        raise SequenceError(
            f'{folder / _TRUTH} has poses of {_BASE}, and no {_MOUNTS} beside it says where the '
            "camera sits: add it, or give --extrinsics (identity, if they are the camera's)")
    links = {}
    storage = _storage(path)  # nodes do not keep it alive
    entries = storage.getNode('trans_matrix')
    for node in (entries.at(number) for number in range(entries.size())):
        links[node.getNode('child_frame').string()] = (
            node.getNode('parent_frame').string(), node.getNode('matrix').mat())
    mount: NDArray[np.float64] = np.eye(4)
    here = frame
    for _ in range(_MAX_LINKS):
        if here == _BASE:
            return mount
        if here not in links or links[here][1] is None:
            break
        parent, matrix = links[here]
        mount = check_pose_matrix(np.asarray(matrix, np.float64), f'{path}, {here}') @ mount
        here = parent
    raise SequenceError(f'{path}: no chain from {_BASE} to {frame}; it has '
                        f'{", ".join(sorted(links)) or "no links"}')


def _focal_length(path: Path, frame: str) -> float | None:
    if not path.is_file():
        return None
    storage = _storage(path)
    numbers = storage.getNode(frame).getNode('intrinsics').mat()
    return None if numbers is None else float(numbers.ravel()[0])


def _storage(path: Path) -> cv2.FileStorage:
    """Open a file in OpenCV's YAML, which no YAML library reads."""
    try:
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    except cv2.error as error:
        raise SequenceError(f'{path} cannot be read: {error.err}') from error
    if not storage.isOpened():
        raise SequenceError(f'{path} cannot be read as YAML of OpenCV')
    return storage


LAYOUT = Layout(NAME, 'color.txt beside color/', _find, _open)
