"""Sequences that are bags: of ROS 1 and ROS 2, raw or compressed images on any topic."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.sequences.bagfile import COMPRESSED_IMAGE, IMAGE, POSE, BagFile
from adversarial_lcd_ros.sequences.frame import RAW_CHANNELS, Frame, open_compressed
from adversarial_lcd_ros.sequences.pose_files import read_tum
from adversarial_lcd_ros.sequences.sequence import Sequence, check_order
from adversarial_lcd_ros.sequences.trajectory import Trajectory
from adversarial_lcd_ros.sequences.transforms import tf_trajectory

TRUTH_TOPIC = '/ground_truth'
NO_TRUTH = 'none'
# image_transport puts depth into CompressedImage, too.
_DEPTH = 'compresseddepth'


def bag_sequence(path: Path, topic: str | None, ground_truth: Path | str | None) -> Sequence:
    """
    Open a bag as a sequence.

    Parameters
    ----------
    path : Path
    topic : str or None
        Of the frames; None: the only one that holds camera images (depth does not count).
    ground_truth : Path, str or None
        A file in TUM's form, a topic of the bag (geometry_msgs/PoseStamped), or 'none'. None:
        a groundtruth.txt beside a single-file bag, else the poses in the bag, else its /tf.

    """
    with BagFile(path) as bag:
        chosen = topic if topic is not None else _find_topic(bag)
        _check_topic(bag, chosen)
        stamps = check_order([bag.stamp_ns(wire) for _, _, wire in bag.messages([chosen])], path)
        first = next(iter(bag.messages([chosen])))[2]
        message = bag.decode(chosen, first)
        size = _size(message, _what(path, chosen, 0))
        trajectory = _trajectory(bag, ground_truth, message.header.frame_id)

    def read(wanted: range) -> Iterator[Frame]:
        with BagFile(path) as source:
            messages = islice(source.messages([chosen]), wanted.start, wanted.stop, wanted.step)
            for number, (_, _, wire) in zip(wanted, messages, strict=False):
                yield _frame(source.decode(chosen, wire), _what(path, chosen, number), size)

    return Sequence(path.resolve().stem, path, stamps, size, trajectory, read)


def bag_trajectory(path: Path, camera_frame: str = '') -> Trajectory | None:
    """
    Return the ground truth of a bag, with or without images; None where it has none.

    Parameters
    ----------
    path : Path
    camera_frame : str
        The camera's frame on /tf, where that is all there is.

    """
    with BagFile(path) as bag:
        return _trajectory(bag, None, camera_frame)


def _what(path: Path, topic: str, number: int) -> str:
    return f'{path}: frame {number} on {topic}'


def _find_topic(bag: BagFile) -> str:
    topics = [topic for topic in bag.of_type(IMAGE, COMPRESSED_IMAGE) if _is_camera(bag, topic)]
    if len(topics) == 1:
        return topics[0]
    if topics:
        raise SequenceError(f'bag {bag.path} has camera images on {", ".join(topics)}: name the '
                            'topic to use')
    there = ', '.join(f'{topic} ({kind})' for topic, kind in sorted(bag.topics.items()))
    raise SequenceError(f'bag {bag.path} has no camera images (sensor_msgs/Image in '
                        f'{", ".join(RAW_CHANNELS)}, or CompressedImage); it has '
                        f'{there or "no topics"}')


def _is_camera(bag: BagFile, topic: str) -> bool:
    message = bag.decode(topic, next(iter(bag.messages([topic])))[2])
    if bag.topics[topic] == IMAGE:
        return message.encoding in RAW_CHANNELS
    return _DEPTH not in message.format.lower()


def _check_topic(bag: BagFile, topic: str) -> None:
    if bag.topics.get(topic) not in (IMAGE, COMPRESSED_IMAGE):
        there = ', '.join(bag.of_type(IMAGE, COMPRESSED_IMAGE)) or 'none'
        raise SequenceError(f'bag {bag.path} has no images on {topic!r}; topics with images: '
                            f'{there}')
    if not bag.counts[topic]:
        raise SequenceError(f'bag {bag.path} holds no camera frame: {topic} is empty')


def _size(message: Any, what: str) -> tuple[int, int]:
    frame = _frame(message, what, None)
    return frame.width, frame.height


def _frame(message: Any, what: str, size: tuple[int, int] | None) -> Frame:
    stamp = message.header.stamp
    stamp_ns = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
    if hasattr(message, 'format'):
        return open_compressed(stamp_ns, bytes(message.data), what, size)
    width, height, step = int(message.width), int(message.height), int(message.step)
    channels = RAW_CHANNELS.get(message.encoding)
    if channels is None:
        raise SequenceError(f'{what} has encoding {message.encoding!r}: expected '
                            f'{", ".join(RAW_CHANNELS)}')
    if (size or (width, height)) != (width, height):
        raise SequenceError(f'{what} is {width} x {height} pixels, the first one {size}: a '
                            'sequence has one image size')
    if not width * height or step < width * channels or len(message.data) < step * height:
        raise SequenceError(f'{what} is truncated: {len(message.data)} bytes for {width} x '
                            f'{height} pixels of {message.encoding} in rows of {step}')
    rows = np.frombuffer(message.data, np.uint8, step * height).reshape(height, step)
    return Frame(stamp_ns, rows[:, :width * channels].tobytes(), message.encoding, width, height)


def _trajectory(bag: BagFile, ground_truth: Path | str | None,
                camera_frame: str) -> Trajectory | None:
    if ground_truth == NO_TRUTH:
        return None
    if ground_truth is not None:
        if str(ground_truth) in bag.of_type(POSE):
            return _poses(bag, str(ground_truth))
        return read_tum(Path(ground_truth))
    beside = bag.path.parent / 'groundtruth.txt'
    if bag.path.is_file() and beside.exists():
        return read_tum(beside)
    topics = bag.of_type(POSE)
    if TRUTH_TOPIC in topics:
        topics = [TRUTH_TOPIC]
    if len(topics) > 1:
        raise SequenceError(f'bag {bag.path} has poses on {", ".join(topics)}: name the topic of '
                            f'the ground truth, a file, or "{NO_TRUTH}"')
    return _poses(bag, topics[0]) if topics else tf_trajectory(bag, camera_frame)


def _poses(bag: BagFile, topic: str) -> Trajectory:
    messages = [bag.decode(topic, wire) for _, _, wire in bag.messages([topic])]
    frames = sorted({message.header.frame_id for message in messages})
    if len(frames) != 1:
        raise SequenceError(f'bag {bag.path}: the poses on {topic} are in several frames: '
                            f'{", ".join(frames)}')
    stamps = [int(m.header.stamp.sec) * 1_000_000_000 + int(m.header.stamp.nanosec)
              for m in messages]
    places = [(m.pose.position.x, m.pose.position.y, m.pose.position.z) for m in messages]
    turns = [(m.pose.orientation.x, m.pose.orientation.y, m.pose.orientation.z,
              m.pose.orientation.w) for m in messages]
    try:
        return Trajectory(np.array(stamps, np.int64), np.array(places), np.array(turns),
                          frames[0])
    except SequenceError as error:
        raise SequenceError(f'bag {bag.path}, {topic}: {error}') from None
