"""Folders as sequences: TUM RGB-D, 7-Scenes, images in order, walks, detections alone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import FileError, SequenceError
from adversarial_lcd_ros.files.reading import MIB, read_bytes
from adversarial_lcd_ros.sequences.detections import DETECTIONS_FILE, read_detections
from adversarial_lcd_ros.sequences.frame import NO_PICTURE, Frame, open_compressed
from adversarial_lcd_ros.sequences.frame_poses import image_poses, read_poses
from adversarial_lcd_ros.sequences.pose_files import (
    check_pose_matrix,
    matrix_trajectory,
    read_matrices,
)
from adversarial_lcd_ros.sequences.sequence import Sequence
from adversarial_lcd_ros.sequences.text_files import text_rows
from adversarial_lcd_ros.sequences.trajectory import (
    PLACE_INDEX,
    Trajectory,
    parse_stamp_ns,
)

TUM_IMAGES, TUM_TRUTH = 'rgb.txt', 'groundtruth.txt'
DEFAULT_RATE_HZ = 30.0
# Longer than any gap that a detector or a label leaves between a frame and its loops.
WALK_GAP_S = 60.0
_SUFFIXES = ('.jpg', '.jpeg', '.png')
_SEVEN_SCENES_COLOUR = '.color.png'
MAX_PICTURE_BYTES = 128 * MIB


def images_in(folder: Path) -> list[Path]:
    """Return the JPEG and PNG files of a folder; numbers in names count as numbers."""
    paths = [path for path in folder.iterdir() if path.suffix.lower() in _SUFFIXES]
    return sorted(paths, key=lambda path: [
        (int(part), '') if part.isdigit() else (-1, part)
        for part in re.split(r'([0-9]+)', path.name)])


def walks_in(folder: Path) -> dict[Path, list[Path]]:
    """Return the images of each subfolder, if each subfolder of a folder holds some."""
    walks = {path: images_in(path) for path in sorted(folder.iterdir()) if path.is_dir()}
    return walks if len(walks) > 1 and all(walks.values()) else {}


def tum_folder(folder: Path, ground_truth: Path | None) -> Sequence:
    """
    Open a folder in the layout of the TUM RGB-D benchmark.

    Ground truth is groundtruth.txt, where it is there, unless another file is given.
    """
    stamps, paths = [], []
    for where, (stamp, name) in text_rows(folder / TUM_IMAGES, 'timestamp filename'):
        try:
            stamps.append(parse_stamp_ns(stamp))
        except ValueError as error:
            raise SequenceError(f'{where}: {error}') from None
        paths.append(folder / name)
        if not paths[-1].is_file():
            raise SequenceError(f'{where}: there is no image {paths[-1]}')
    if ground_truth is None and (folder / TUM_TRUTH).exists():
        ground_truth = folder / TUM_TRUTH
    trajectory = None if ground_truth is None else read_poses(ground_truth, stamps)
    return _sequence(folder, paths, stamps, trajectory)


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
    sample = _open(samples[0], 0, None)
    if ground_truth is None and (folder / TUM_TRUTH).exists():
        ground_truth = folder / TUM_TRUTH
    trajectory = None if ground_truth is None else read_poses(ground_truth, stamps)

    def read(wanted: range) -> Iterator[Frame]:
        for number in wanted:
            yield Frame(int(stamps[number]), b'', NO_PICTURE, sample.width, sample.height)

    return Sequence(folder.resolve().name, folder, stamps, (sample.width, sample.height),
                    trajectory, read, folder / DETECTIONS_FILE)


def image_folder(folder: Path, ground_truth: Path | None, rate_hz: float | None) -> Sequence:
    """
    Open a folder of images in order of their names.

    Where there is ground truth, ``image_poses`` tells which pose is that of which image.
    """
    paths = images_in(folder)
    ticks = _ticks(len(paths), rate_hz)
    if ground_truth is None:
        return _sequence(folder, paths, ticks, None)
    return _sequence(folder, paths, *image_poses(ground_truth, ticks, rate_hz is not None))


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
    ticks = _ticks(count, rate_hz)
    period_ns = int(ticks[-1]) + round(WALK_GAP_S * 1e9)
    stamps = np.concatenate([ticks + walk * period_ns for walk in range(len(walks))])
    position = np.zeros((len(stamps), 3))
    position[:, 0] = np.tile(np.arange(count), len(walks))
    upright = np.tile([0.0, 0.0, 0.0, 1.0], (len(stamps), 1))
    paths = [path for images in walks.values() for path in images]
    return _sequence(folder, paths, stamps, Trajectory(stamps, position, upright, PLACE_INDEX))


def is_seven_scenes(folder: Path) -> bool:
    """Tell whether a folder is a sequence of the 7-Scenes data set (frame-000000.color.png)."""
    return any(folder.glob(f'frame-*{_SEVEN_SCENES_COLOUR}'))


def seven_scenes(folder: Path, rate_hz: float | None) -> Sequence:
    """Open a sequence of 7-Scenes: a 4 x 4 camera-to-world matrix beside each colour image."""
    paths = sorted(folder.glob(f'frame-*{_SEVEN_SCENES_COLOUR}'))
    poses = np.stack([_pose_matrix(
        path.with_name(path.name.replace(_SEVEN_SCENES_COLOUR, '.pose.txt'))) for path in paths])
    stamps = _ticks(len(paths), rate_hz)
    return _sequence(folder, paths, stamps, matrix_trajectory(stamps, poses))


def _pose_matrix(path: Path) -> NDArray[np.float64]:
    matrices = read_matrices(path)
    return check_pose_matrix(matrices[0] if len(matrices) == 1 else matrices, str(path))


def _ticks(count: int, rate_hz: float | None) -> NDArray[np.int64]:
    rate = DEFAULT_RATE_HZ if rate_hz is None else rate_hz
    ticks: NDArray[np.int64] = np.round(np.arange(count) * (1e9 / rate)).astype(np.int64)
    return ticks


def _sequence(folder: Path, paths: list[Path], stamps: list[int] | NDArray[np.int64],
              trajectory: Trajectory | None) -> Sequence:
    if not paths:
        raise SequenceError(f'{folder} holds no camera frame')
    first = _open(paths[0], 0, None)
    size = first.width, first.height
    stamps_ns = np.asarray(stamps, np.int64)

    def read(wanted: range) -> Iterator[Frame]:
        for number in wanted:
            yield _open(paths[number], int(stamps_ns[number]), size)

    return Sequence(folder.resolve().name, folder, stamps_ns, size, trajectory, read)


def _open(path: Path, stamp_ns: int, size: tuple[int, int] | None) -> Frame:
    try:
        data = read_bytes(path, MAX_PICTURE_BYTES)
    except FileError as error:
        raise SequenceError(f'image {error}') from error
    return open_compressed(stamp_ns, data, f'image {path}', size)
