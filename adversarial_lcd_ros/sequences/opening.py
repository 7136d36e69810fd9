# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Opening whatever a sequence was published as."""

from __future__ import annotations

from dataclasses import replace
import math
from pathlib import Path
import shlex

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.poses.pose_files import mounted
from adversarial_lcd_ros.poses.trajectory import PLACE_INDEX
from adversarial_lcd_ros.sequences import folders
from adversarial_lcd_ros.sequences.bag_truth import NO_TRUTH, TruthOptions
from adversarial_lcd_ros.sequences.bagfile import is_bag
from adversarial_lcd_ros.sequences.bags import bag_sequence
from adversarial_lcd_ros.sequences.detections import DETECTIONS_FILE
from adversarial_lcd_ros.sequences.image_files import (
    OTHER_PICTURES,
    PACKED,
    count_of,
    images_in,
    is_hidden,
)
from adversarial_lcd_ros.sequences.layouts import LAYOUTS, Options, find_layout
from adversarial_lcd_ros.sequences.sequence import Sequence
from adversarial_lcd_ros.sequences.video import is_video, video_sequence

_MAX_NAMED = 8
_LAYOUTS = ('a TUM RGB-D folder (rgb.txt), '
            + ', '.join(f'{layout.name} ({layout.sign})' for layout in LAYOUTS)
            + ', a folder of JPEG, PNG or WebP images, a folder of walks (subfolders of images), '
            'a 7-Scenes sequence (frame-000000.color.png), a folder of detections '
            '(detections.csv), a video, a ROS 1 bag (.bag) or a rosbag2 (folder, .mcap, .db3)')


def open_sequence(path: Path | str, *, topic: str | None = None,
                  ground_truth: Path | str | None = None,
                  rate_hz: float | None = None, camera: str | None = None,
                  truth: TruthOptions | None = None, stamps: str | None = None) -> Sequence:
    """
    Open a sequence, whatever it was published as.

    Parameters
    ----------
    path : Path or str
        TUM RGB-D folder, a recording in one of the ``LAYOUTS``, folder of images, folder of
        walks along one path, 7-Scenes sequence, folder of detections (detections.csv in place of
        rgb.txt; its frames have no pictures), video, ROS 1 bag or rosbag2.
    topic : str, optional
        Bags: the topic of the frames, where several hold camera images.
    ground_truth : Path or str, optional
        A file of poses (``frame_poses.read_poses``); for bags also a topic (``BagTruth``);
        'none': use none. By default what the source brings along.
    rate_hz : float, optional
        Sources without time stamps: frames per second, 30 unless given.
    camera : str, optional
        Folders: which camera, where a recording has several (``image_2``, ``cam1``).
    truth : TruthOptions, optional
        How poses become those of the camera; sources other than bags know only extrinsics.
    stamps : str, optional
        Bags: 'header' or 'log', where the stamps are from.

    Returns
    -------
    Sequence

    Raises
    ------
    SequenceError
        The source is missing, unknown, truncated, empty or out of order, or an option does not
        apply to it.

    """
    path = Path(path)
    if not path.exists():
        raise SequenceError(f'there is no sequence {path}')
    if rate_hz is not None and not (math.isfinite(rate_hz) and 0 < rate_hz <= 1e6):
        raise SequenceError(f'rate of {rate_hz} Hz: expected more than 0')
    if not (path / folders.TUM_IMAGES).is_file() and is_bag(path):
        _refuse(path, rate_hz=rate_hz, camera=camera)
        return bag_sequence(path, topic, ground_truth, truth, stamps)
    options = truth or TruthOptions()
    _refuse(path, stamps=stamps, fixed_frame=options.fixed_frame, body_frame=options.body_frame,
            camera_frame=options.camera_frame)
    found = _open(path, topic, Options(camera, ground_truth, rate_hz,
                                       has_extrinsics=options.extrinsics is not None))
    return _with_extrinsics(found, options)


def _open(path: Path, topic: str | None, options: Options) -> Sequence:
    """Open a source that is no bag."""
    camera, ground_truth, rate_hz = options.camera, options.ground_truth, options.rate_hz
    if path.is_dir() and (path / folders.TUM_IMAGES).is_file():
        _refuse(path, topic=topic, rate_hz=rate_hz, camera=camera)
        return _without_truth(folders.tum_folder(path, _file(ground_truth)), ground_truth)
    _refuse(path, topic=topic)
    if is_video(path):
        _refuse(path, camera=camera)
        return video_sequence(path, options)
    if not path.is_dir():
        raise SequenceError(_no_sequence(path))
    found = find_layout(path)
    if found is not None:
        layout, folder, named = found
        if layout.has_stamps:
            _refuse(path, rate_hz=rate_hz)
        return layout.open(folder, replace(options, camera=camera or named))
    return _image_folder(path, ground_truth, rate_hz, camera)


def _no_sequence(path: Path) -> str:
    if path.suffix == '.active':
        return (f'{path} is a bag of ROS 1 whose recording was not ended: mend it with '
                f'"rosbag reindex {shlex.quote(str(path))}", and take .active off')
    return f'{path} is no sequence: expected {_LAYOUTS}; unpack an archive first'


def _image_folder(path: Path, ground_truth: Path | str | None, rate_hz: float | None,
                  camera: str | None) -> Sequence:
    if folders.is_seven_scenes(path):
        _refuse(path, ground_truth=_file(ground_truth), camera=camera)
        return _without_truth(folders.seven_scenes(path, rate_hz), ground_truth)
    if camera is not None and (path / camera).is_dir():
        path, camera = path / camera, None
    beside = path / folders.TUM_TRUTH
    if images_in(path):
        poses = beside if ground_truth is None and beside.is_file() else _file(ground_truth)
        return folders.image_folder(path, poses, rate_hz, camera)
    _refuse(path, camera=camera)
    if (path / DETECTIONS_FILE).is_file():
        _refuse(path, rate_hz=rate_hz)
        return _without_truth(folders.detections_folder(path, _file(ground_truth)), ground_truth)
    if beside.is_file():
        raise SequenceError(
            f'{path} has a {folders.TUM_TRUTH} but no {folders.TUM_IMAGES}, which lists the '
            'images and their stamps: get the sequence again, or open its folder of images')
    walks = folders.walks_in(path)
    if walks:
        _refuse(path, ground_truth=_file(ground_truth))
        return _without_truth(folders.walk_folders(path, walks, rate_hz), ground_truth)
    inside = _recordings_in(path)
    if inside:
        raise SequenceError(f'{path} holds recordings, not one: name one of {", ".join(inside)}')
    others = count_of(path, OTHER_PICTURES + PACKED)
    there = f' but {others} (convert pictures to PNG, unpack archives)' if others else ''
    raise SequenceError(f'{path} holds no sequence{there}: expected {_LAYOUTS}')


def _recordings_in(path: Path) -> list[str]:
    """Return the recordings one or two folders further down, some of them."""
    inside = [child for pattern in ('*', '*/*') for child in sorted(path.glob(pattern))
              if not any(is_hidden(Path(part)) for part in child.relative_to(path).parts)]
    return [str(child) for child in inside
            if is_video(child) or is_bag(child) or (child.is_dir() and (
                (child / folders.TUM_IMAGES).is_file() or find_layout(child) is not None
                or folders.is_seven_scenes(child)))][:_MAX_NAMED]


def _file(ground_truth: Path | str | None) -> Path | None:
    return None if ground_truth in (None, NO_TRUTH) else Path(str(ground_truth))


def _without_truth(sequence: Sequence, ground_truth: Path | str | None) -> Sequence:
    if ground_truth != NO_TRUTH:
        return sequence
    return replace(sequence, trajectory=None)


def _with_extrinsics(sequence: Sequence, options: TruthOptions) -> Sequence:
    """Return the sequence with the poses of the camera, where the source has those of a body."""
    poses = sequence.trajectory
    if options.extrinsics is None:
        return sequence
    if poses is None or poses.frame_id == PLACE_INDEX:
        raise SequenceError(f'extrinsics given, but {sequence.source} has no poses in metres: '
                            'leave them out')
    return replace(sequence, trajectory=mounted(poses, options.extrinsics))


def _refuse(path: Path, **options: object) -> None:
    given = [name for name, value in options.items() if value is not None]
    if given:
        raise SequenceError(f'{" and ".join(given)} given, but {path} brings its own: leave it '
                            'out')
