# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings in the layout of EuRoC MAV and TUM-VI: cameras on a body whose poses are known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
import yaml

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.files.text import read_text, text_rows
from adversarial_lcd_ros.poses.pose_files import check_pose_matrix, read_euroc
from adversarial_lcd_ros.poses.trajectory import Trajectory
from adversarial_lcd_ros.sequences.image_files import file_sequence
from adversarial_lcd_ros.sequences.layouts.base import Layout, Options, choose_camera
from adversarial_lcd_ros.sequences.sequence import Sequence

NAME = 'EuRoC, TUM-VI'
_LIST, _PICTURES, _SENSOR = 'data.csv', 'data', 'sensor.yaml'
# Poses of the body; vicon0 tracks its markers, and leica0 has no rotation.
_TRUTH = ('state_groundtruth_estimate0', 'mocap0')


def _find(path: Path) -> tuple[Path, str | None] | None:
    for folder in (path, path / 'mav0'):
        if _cameras(folder):
            return folder, None
    if path.name == _PICTURES:
        path = path.parent
    if path.name.startswith('cam') and (path / _LIST).is_file():
        return path.parent, path.name
    return None


def _cameras(folder: Path) -> list[str]:
    return sorted(path.parent.name for path in folder.glob(f'cam*/{_LIST}'))


def _open(folder: Path, options: Options) -> Sequence:
    camera, notes = choose_camera(folder, NAME, _cameras(folder), options.camera)
    stamps, paths = [], []
    for where, (stamp, name) in text_rows(folder / camera / _LIST, 'timestamp filename', ','):
        if not stamp.isdecimal():
            raise SequenceError(f'{where}: {stamp!r} is no time stamp in nanoseconds')
        stamps.append(int(stamp))
        paths.append(folder / camera / _PICTURES / name)
        if not paths[-1].is_file():
            raise SequenceError(f'{where}: there is no image {paths[-1]}')
    sensor = _sensor(folder / camera / _SENSOR)
    trajectory = options.trajectory(stamps, lambda: _body_poses(folder),
                                    lambda: _mount(folder, camera, sensor))
    recording = folder.resolve()
    return file_sequence(recording.parent if recording.name == 'mav0' else folder, paths, stamps,
                         trajectory, notes=notes,
                         focal_length_px=_focal_length(sensor))


def _sensor(path: Path) -> dict[str, Any]:
    if not path.is_file():
        return {}
    # OpenCV writes a first line that is no YAML.
    text = '\n'.join(line for line in read_text(path).splitlines() if not line.startswith('%'))
    try:
        found = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise SequenceError(f'{path} cannot be read as YAML: {str(error).splitlines()[0]}'
                            ) from error
    return found if isinstance(found, dict) else {}


def _body_poses(folder: Path) -> Trajectory | None:
    truth = _truth(folder)
    return None if truth is None else read_euroc(truth)


def _truth(folder: Path) -> Path | None:
    return next((path for name in _TRUTH if (path := folder / name / _LIST).is_file()), None)


def _mount(folder: Path, camera: str, sensor: dict[str, Any]) -> NDArray[np.float64]:
    path, entry = folder / camera / _SENSOR, sensor.get('T_BS')
    numbers = entry.get('data') if isinstance(entry, dict) else entry
    try:
        mount = np.array(numbers, np.float64).reshape(4, 4)
    except (TypeError, ValueError):
        raise SequenceError(
            f'EuRoC: {_truth(folder)} has poses of the body, and {path} no T_BS (16 numbers: '
            'camera to body): add it, or give it with --extrinsics, or --ground-truth none'
        ) from None
    return check_pose_matrix(mount, f'{path}, T_BS')


def _focal_length(sensor: dict[str, Any]) -> float | None:
    numbers = sensor.get('intrinsics')
    if isinstance(numbers, list) and len(numbers) >= 4 and isinstance(numbers[0], int | float):
        return float(numbers[0])
    return None


LAYOUT = Layout(NAME, 'mav0/cam0/data.csv', _find, _open)
