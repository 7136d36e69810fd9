# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Any sequence to a bag that every node, and every ROS 2 tool, can replay."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
import heapq
from pathlib import Path
from typing import Any

import numpy as np

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.messages.codec import typestore
from adversarial_lcd_ros.poses.trajectory import Trajectory
from adversarial_lcd_ros.sequences.bag_truth import TruthOptions
from adversarial_lcd_ros.sequences.bagfile import CAMERA_INFO, COMPRESSED_IMAGE, POSE, BagWriter
from adversarial_lcd_ros.sequences.cdr import header
from adversarial_lcd_ros.sequences.companions import companions_of
from adversarial_lcd_ros.sequences.frame import JPEG, PNG, Frame
from adversarial_lcd_ros.sequences.opening import open_sequence
from adversarial_lcd_ros.sequences.sequence import Coverage, Progress, Sequence

IMAGE_TOPIC, GROUND_TRUTH_TOPIC = '/image/compressed', '/ground_truth'
CAMERA_INFO_TOPIC = '/camera_info'
CAMERA_FRAME = 'camera'
# Poses from so long before the first frame to so long after the last one are kept.
_MARGIN_NS = 100_000_000


@dataclass(frozen=True)
class ImportSummary:
    """What an import has written."""

    path: Path
    name: str
    frames: int
    poses: int
    image_size: tuple[int, int]
    duration_s: float
    size_bytes: int
    coverage: Coverage
    notes: tuple[str, ...] = ()


def import_sequence(source: Path | str, destination: Path | str, *,
                    progress: Progress | None = None, overwrite: bool = False,
                    topic: str | None = None, ground_truth: Path | str | None = None,
                    rate_hz: float | None = None, camera: str | None = None, raw_as: str = JPEG,
                    truth: TruthOptions | None = None,
                    stamps: str | None = None) -> ImportSummary:
    """
    Write a sequence as a rosbag2 in MCAP.

    Frames become sensor_msgs/CompressedImage on /image/compressed: JPEG and PNG files with
    their bytes untouched, raw images as JPEG of quality 95 or as PNG. Every frame is decoded
    once, as a check. Ground truth becomes geometry_msgs/PoseStamped on /ground_truth, a focal
    length that the recording tells one sensor_msgs/CameraInfo on /camera_info. Credits and
    licence files of a source folder, and what tells labels what its views share, go with the
    pictures. With one release of rosbags, the same source always gives the same bytes.

    Parameters
    ----------
    source, topic, ground_truth, rate_hz, camera, truth, stamps
        See ``open_sequence``.
    destination : Path or str
        Folder of the bag; it appears when it is complete, or not at all.
    progress : callable, optional
        Called with (frames done, frames in all).
    overwrite : bool
        Replace a bag that is there.
    raw_as : str
        What raw images become: 'jpeg', or 'png', which is several times larger and exact.

    Raises
    ------
    SequenceError
        The source is missing, truncated, empty or out of order, a frame cannot be decoded or
        is of another size, or the destination exists.

    """
    if raw_as not in (JPEG, PNG):
        raise SequenceError(f'raw images as {raw_as!r}: expected {JPEG!r} or {PNG!r}')
    source = Path(source)
    if not source.exists():
        raise SequenceError(f'there is no sequence {source}')
    beside = companions_of(source)
    with BagWriter(Path(destination), overwrite=overwrite) as bag:
        sequence = open_sequence(source, topic=topic, ground_truth=ground_truth, rate_hz=rate_hz,
                                 camera=camera, truth=truth, stamps=stamps)
        poses = list(pose_messages(sequence.trajectory, int(sequence.stamps_ns[0]),
                                   int(sequence.stamps_ns[-1])))
        frames = _counted(sequence.frames(), sequence.frame_count, raw_as, progress)
        # At the same time, the image comes last: the key sorts by nothing else.
        for message_topic, message_type, stamp_ns, cdr in heapq.merge(
                camera_messages(sequence), poses, map(image_message, frames),
                key=lambda row: row[2]):
            bag.write(message_topic, message_type, stamp_ns, cdr)
        for file in beside:
            bag.attach(file)
    return _summary(Path(destination), sequence, len(poses))


def _summary(path: Path, sequence: Sequence, poses: int) -> ImportSummary:
    stamps = sequence.stamps_ns
    return ImportSummary(
        path, sequence.name, sequence.frame_count, poses, sequence.image_size,
        float(stamps[-1] - stamps[0]) / 1e9, sum(file.stat().st_size for file in path.iterdir()),
        sequence.coverage, sequence.notes)


def _counted(frames: Iterator[Frame], total: int, raw_as: str,
             progress: Progress | None) -> Iterator[Frame]:
    for done, frame in enumerate(frames, 1):
        frame.image()
        yield frame.compressed(raw_as)
        if progress is not None:
            progress(done, total)


def image_message(frame: Frame, topic: str = IMAGE_TOPIC) -> tuple[str, str, int, bytes]:
    """Return a frame that is compressed as a message: (topic, type, stamp, CDR)."""
    types: Any = typestore().types
    message = types[COMPRESSED_IMAGE](
        header=header(frame.stamp_ns, CAMERA_FRAME), format=frame.encoding,
        data=np.frombuffer(frame.data, np.uint8))
    return (topic, COMPRESSED_IMAGE, frame.stamp_ns,
            bytes(typestore().serialize_cdr(message, COMPRESSED_IMAGE)))


def camera_messages(sequence: Sequence) -> Iterator[tuple[str, str, int, bytes]]:
    """Yield what is known of the camera, with the first frame: (topic, type, stamp, CDR)."""
    if sequence.focal_length_px is None:
        return
    (width, height), focal = sequence.image_size, float(sequence.focal_length_px)
    matrix = [focal, 0.0, width / 2, 0.0, focal, height / 2, 0.0, 0.0, 1.0]
    types: Any = typestore().types
    stamp_ns = int(sequence.stamps_ns[0])
    message = types[CAMERA_INFO](
        header=header(stamp_ns, CAMERA_FRAME), height=height, width=width, distortion_model='',
        d=np.zeros(0), k=np.array(matrix), r=np.eye(3).ravel(),
        p=np.insert(np.array(matrix), (3, 6, 9), 0.0), binning_x=0, binning_y=0,
        roi=types['sensor_msgs/msg/RegionOfInterest'](
            x_offset=0, y_offset=0, height=0, width=0, do_rectify=False))
    yield (CAMERA_INFO_TOPIC, CAMERA_INFO, stamp_ns,
           bytes(typestore().serialize_cdr(message, CAMERA_INFO)))


def pose_messages(trajectory: Trajectory | None, first_ns: int,
                  last_ns: int) -> Iterator[tuple[str, str, int, bytes]]:
    """
    Yield the ground truth of the frames between two stamps: (topic, type, stamp, CDR).

    Raises
    ------
    SequenceError
        There is ground truth, but none of that time.

    """
    if trajectory is None:
        return
    trajectory = trajectory.between(first_ns - _MARGIN_NS, last_ns + _MARGIN_NS)
    types: Any = typestore().types
    point, quaternion, pose = (types[f'geometry_msgs/msg/{name}']
                               for name in ('Point', 'Quaternion', 'Pose'))
    for stamp_ns, place, turn in zip(trajectory.stamp_ns.tolist(), trajectory.position.tolist(),
                                     trajectory.quaternion.tolist(), strict=True):
        message = types[POSE](header=header(stamp_ns, trajectory.frame_id), pose=pose(
            position=point(*place), orientation=quaternion(*turn)))
        yield (GROUND_TRUTH_TOPIC, POSE, stamp_ns,
               bytes(typestore().serialize_cdr(message, POSE)))
