# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Folders as sequences: TUM RGB-D, 7-Scenes, images in order, walks, detections alone."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
import re

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.poses.frame_poses import image_poses, read_poses
from adversarial_lcd_ros.poses.pose_files import (
    check_pose_matrix,
    matrix_trajectory,
    read_matrices,
)
from adversarial_lcd_ros.poses.trajectory import PLACE_INDEX, Trajectory
from adversarial_lcd_ros.sequences.detections import DETECTIONS_FILE, read_detections
from adversarial_lcd_ros.sequences.frame import NO_PICTURE, Frame
from adversarial_lcd_ros.sequences.image_choice import camera_images, named_stamps
from adversarial_lcd_ros.sequences.image_files import (
    file_sequence,
    images_in,
    is_depth_image,
    is_hidden,
    read_image,
    ticks,
)
from adversarial_lcd_ros.sequences.layouts.tum import list_images
from adversarial_lcd_ros.sequences.sequence import Sequence

TUM_IMAGES, TUM_TRUTH = 'rgb.txt', 'groundtruth.txt'
# Longer than any gap that a detector or a label leaves between a frame and its loops.
WALK_GAP_S = 60.0
_SEVEN_SCENES_COLOUR = '.color.png'
# What several cameras, eyes, or pictures that are no camera's, are called.
_ONE_VIEW = re.compile(
    r'(image|img)s?[_-]?([0-9]{1,2}|left|right|l|r)|(cam|camera)s?([_-].*|[0-9].*|left|right)?|'
    r'(stereo|mono)[_-].*|(left|right)([_-]?(image|cam|camera|eye)s?)?|.*depth.*|'
    r'disp(arity)?.*|colou?r|rgb|infra.*|ir[0-9]?|fisheye[0-9]|masks?|semantics?|labels?|'
    r'segmentation|normals?|flow', re.IGNORECASE)


def walks_in(folder: Path) -> dict[Path, list[Path]]:
    """
    Return the images of each subfolder, if each subfolder of a folder holds some.

    Raises
    ------
    SequenceError
        The subfolders are named as the cameras of one recording, or depth, are, or their images
        by times that overlap.

    """
    walks = {path: images_in(path) for path in sorted(folder.iterdir())
             if path.is_dir() and not is_hidden(path)}
    if len(walks) < 2 or not any(walks.values()):
        return {}
    views = [path.name for path in walks if _ONE_VIEW.fullmatch(path.name)]
    views += [path.name for path, images in walks.items()
              if images and is_depth_image(images[0]) and path.name not in views]
    if not views and _are_simultaneous(list(walks.values())):
        views = [path.name for path in walks]
    if views:
        there = ', '.join(path.name for path, images in walks.items() if images)
        raise SequenceError(
            f'{folder} holds views of one recording ({", ".join(views)}), not walks: choose the '
            f'camera (--camera) among {there}')
    return walks if all(walks.values()) else {}


def _are_simultaneous(walks: list[list[Path]]) -> bool:
    """Tell whether any two walks, by the times that their images are named by, overlap."""
    spans = sorted((stamps[0], stamps[-1]) for images in walks if (stamps := named_stamps(images)))
    return any(later[0] <= earlier[1] for earlier, later in pairwise(spans))


def tum_folder(folder: Path, ground_truth: Path | None) -> Sequence:
    """
    Open a folder in the layout of the TUM RGB-D benchmark.

    Ground truth is groundtruth.txt, where it is there, unless another file is given.
    """
    stamps, paths = list_images(folder / TUM_IMAGES)
    if ground_truth is None and (folder / TUM_TRUTH).exists():
        ground_truth = folder / TUM_TRUTH
    trajectory = None if ground_truth is None else read_poses(ground_truth, stamps)
    return file_sequence(folder, paths, stamps, trajectory)


def detections_folder(folder: Path, ground_truth: Path | None) -> Sequence:
    """
    Open a folder that has detections.csv instead of pictures.

    Its frames are those with detections; a frame in which nothing was found is not known to it.
    The size of the images is that of a picture in rgb/. Ground truth as in TUM's layout.
    """
    stamps = read_detections(folder / DETECTIONS_FILE).frame_stamps_ns
    samples = images_in(folder / 'rgb') if (folder / 'rgb').is_dir() else []
    if not samples:
        raise SequenceError(f'{folder} has {DETECTIONS_FILE}, but neither {TUM_IMAGES} nor a '
                            'picture in rgb/: put at least one there, to tell the image size')
    sample = read_image(samples[0], 0, None)
    if ground_truth is None and (folder / TUM_TRUTH).exists():
        ground_truth = folder / TUM_TRUTH
    trajectory = None if ground_truth is None else read_poses(ground_truth, stamps)

    def read(wanted: range) -> Iterator[Frame]:
        for number in wanted:
            yield Frame(int(stamps[number]), b'', NO_PICTURE, sample.width, sample.height)

    return Sequence(folder.resolve().name, folder, stamps, (sample.width, sample.height),
                    trajectory, read, folder / DETECTIONS_FILE)


def image_folder(folder: Path, ground_truth: Path | None, rate_hz: float | None,
                 camera: str | None = None) -> Sequence:
    """
    Open a folder of images in order of their names.

    Where all names are times since 1970, these are the stamps. Else, where there is ground truth,
    ``image_poses`` tells which pose is that of which image.
    """
    paths, notes = camera_images(folder, camera)
    named = named_stamps(paths) if rate_hz is None else None
    if named is not None:
        trajectory = None if ground_truth is None else read_poses(ground_truth, named)
        notes += (f'{folder}: stamps are those that the images are named by',)
        return file_sequence(folder, paths, named, trajectory, notes=notes)
    stamps = ticks(len(paths), rate_hz)
    if ground_truth is None:
        return file_sequence(folder, paths, stamps, None, notes=notes)
    return file_sequence(folder, paths, *image_poses(ground_truth, stamps, rate_hz is not None),
                         notes=notes)


def walk_folders(folder: Path, walks: dict[Path, list[Path]],
                 rate_hz: float | None) -> Sequence:
    """
    Open the walks along one path in the subfolders of a folder, one after the other.

    Image i of each walk shows place i: the ground truth is by index, not in metres.
    """
    counts = {path.name: len(images) for path, images in walks.items()}
    if len(set(counts.values())) != 1:
        raise SequenceError(
            f'the walks in {folder} have {", ".join(f"{n} ({k})" for k, n in counts.items())} '
            'images: ground truth by index needs as many in each; import one walk by its own '
            'folder')
    count = next(iter(counts.values()))
    once = ticks(count, rate_hz)
    period_ns = int(once[-1]) + round(WALK_GAP_S * 1e9)
    stamps = np.concatenate([once + walk * period_ns for walk in range(len(walks))])
    position = np.zeros((len(stamps), 3))
    position[:, 0] = np.tile(np.arange(count), len(walks))
    upright = np.tile([0.0, 0.0, 0.0, 1.0], (len(stamps), 1))
    paths = [path for images in walks.values() for path in images]
    return file_sequence(folder, paths, stamps, Trajectory(stamps, position, upright, PLACE_INDEX))


def is_seven_scenes(folder: Path) -> bool:
    """Tell whether a folder is a sequence of the 7-Scenes data set (frame-000000.color.png)."""
    return any(folder.glob(f'frame-*{_SEVEN_SCENES_COLOUR}'))


def seven_scenes(folder: Path, rate_hz: float | None) -> Sequence:
    """Open a sequence of 7-Scenes: a 4 x 4 camera-to-world matrix beside each colour image."""
    paths = sorted(folder.glob(f'frame-*{_SEVEN_SCENES_COLOUR}'))
    poses = np.stack([_pose_matrix(
        path.with_name(path.name.replace(_SEVEN_SCENES_COLOUR, '.pose.txt'))) for path in paths])
    stamps = ticks(len(paths), rate_hz)
    return file_sequence(folder, paths, stamps, matrix_trajectory(stamps, poses, folder))


def _pose_matrix(path: Path) -> NDArray[np.float64]:
    matrices = read_matrices(path)
    return check_pose_matrix(matrices[0] if len(matrices) == 1 else matrices, str(path))
