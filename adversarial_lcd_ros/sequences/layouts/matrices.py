# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Colour beside depth with matrices for poses: Replica (one file), ScanNet (one a frame)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.files.text import read_text, text_rows
from adversarial_lcd_ros.poses.pose_files import matrix_trajectory, read_matrices
from adversarial_lcd_ros.poses.trajectory import Trajectory
from adversarial_lcd_ros.sequences.image_files import (
    file_sequence,
    images_in,
    is_depth_image,
    ticks,
)
from adversarial_lcd_ros.sequences.layouts.base import Layout, Options
from adversarial_lcd_ros.sequences.sequence import Sequence

REPLICA, SCANNET = 'Replica', 'ScanNet'
_COLOUR = ('color', 'colour', 'rgb', 'results', 'images', 'image')
_TRAJECTORIES = ('traj.txt', 'traj_w_c.txt')
_POSES = ('pose', 'poses')
_INTRINSICS = ('intrinsic/intrinsic_color.txt', 'intrinsic_color.txt', 'intrinsics.txt')


def _colour_folder(folder: Path) -> Path | None:
    return next((path for name in _COLOUR if (path := folder / name).is_dir()), None)


def _root(path: Path) -> Path:
    return path.parent if path.name in _COLOUR else path


def _find_replica(path: Path) -> tuple[Path, str | None] | None:
    folder = _root(path)
    is_one = _colour_folder(folder) and any((folder / name).is_file() for name in _TRAJECTORIES)
    return (folder, None) if is_one else None


def _find_scannet(path: Path) -> tuple[Path, str | None] | None:
    folder = _root(path)
    is_one = _colour_folder(folder) and any(
        any((folder / name).glob('*.txt')) for name in _POSES)
    return (folder, None) if is_one else None


def _pictures(folder: Path) -> tuple[list[Path], tuple[str, ...]]:
    """Return the colour images of a recording, and what is to be said about the others."""
    colour = _colour_folder(folder)
    assert colour is not None  # or it had not been recognised
    images = images_in(colour)
    depth = {path for path in images
             if path.stem.lower().startswith('depth') or is_depth_image(path)}
    notes = (f'{colour}: {len(depth)} depth maps are not taken',) if depth else ()
    return [path for path in images if path not in depth], notes


def _open_replica(folder: Path, options: Options) -> Sequence:
    paths, notes = _pictures(folder)
    stamps = ticks(len(paths), options.rate_hz)

    def own() -> Trajectory:
        file = next(path for name in _TRAJECTORIES if (path := folder / name).is_file())
        poses = read_matrices(file)
        if len(poses) != len(paths):
            raise SequenceError(f'{file} has {len(poses)} poses for {len(paths)} colour images: '
                                'expected one for each')
        return matrix_trajectory(stamps, poses, file)

    return file_sequence(folder, paths, stamps, options.trajectory(stamps, own), notes=notes,
                         focal_length_px=_replica_focal_length(folder))


def _open_scannet(folder: Path, options: Options) -> Sequence:
    paths, notes = _pictures(folder)
    stamps = ticks(len(paths), options.rate_hz)

    def own() -> Trajectory:
        matrices = np.array([_pose(folder, path.stem) for path in paths]).reshape(-1, 4, 4)
        if not np.isfinite(matrices).all(axis=(1, 2)).any():
            raise SequenceError(f'{folder}: no image has a pose of its name (pose/0.txt of '
                                'color/0.jpg): expected 4 x 4 numbers, or --ground-truth none')
        return matrix_trajectory(stamps, matrices, folder)

    return file_sequence(folder, paths, stamps, options.trajectory(stamps, own), notes=notes,
                         focal_length_px=_scannet_focal_length(folder))


def _pose(folder: Path, stem: str) -> np.ndarray:
    for name in _POSES:
        if (path := folder / name / f'{stem}.txt').is_file():
            matrices = read_matrices(path)
            if len(matrices) != 1:
                raise SequenceError(f'{path}: {len(matrices)} poses; expected one')
            return np.asarray(matrices[0])
    return np.full((4, 4), np.nan)


def _scannet_focal_length(folder: Path) -> float | None:
    """Return the first number of the matrix of intrinsics, where there is one."""
    path = next((path for name in _INTRINSICS if (path := folder / name).is_file()), None)
    if path is None:
        return None
    for where, fields in text_rows(path, 'fx ...'):
        try:
            return float(fields[0])
        except ValueError as error:
            raise SequenceError(f'{where}: {error}') from None
    return None


def _replica_focal_length(folder: Path) -> float | None:
    """Return fx of cam_params.json, which lies beside the rooms."""
    path = folder.resolve().parent / 'cam_params.json'
    if not path.is_file():
        return None
    try:
        return float(json.loads(read_text(path))['camera']['fx'])
    except (ValueError, KeyError, TypeError) as error:
        raise SequenceError(f'{path}: expected a "camera" with "fx" ({error!r})') from None


LAYOUTS = (Layout(REPLICA, 'traj.txt beside results/', _find_replica, _open_replica, False),
           Layout(SCANNET, 'color/ beside pose/', _find_scannet, _open_scannet, False))
