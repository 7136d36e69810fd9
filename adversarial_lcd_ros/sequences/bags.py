"""Sequences that are bags: of ROS 1 and ROS 2, raw or compressed images on any topic."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.sequences.bag_truth import BagTruth, TruthOptions
from adversarial_lcd_ros.sequences.bagfile import COMPRESSED_IMAGE, IMAGE, BagFile
from adversarial_lcd_ros.sequences.frame import RAW_CHANNELS, Frame, open_compressed
from adversarial_lcd_ros.sequences.sequence import Sequence
from adversarial_lcd_ros.sequences.stamps import LOG, frame_stamps
from adversarial_lcd_ros.sequences.trajectory import Trajectory

# image_transport puts depth into CompressedImage, too.
_DEPTH = 'compresseddepth'


def bag_sequence(path: Path, topic: str | None, ground_truth: Path | str | None,
                 truth: TruthOptions | None = None, stamps: str | None = None) -> Sequence:
    """
    Open a bag as a sequence.

    Parameters
    ----------
    path : Path
    topic : str or None
        Of the frames; None: the only one that holds camera images (depth does not count).
    ground_truth : Path, str or None
        A topic of the bag, a file of poses, or 'none'; see ``BagTruth.find``.
    truth : TruthOptions, optional
        How poses become those of the camera.
    stamps : str, optional
        Of the frames: 'header' or 'log'; see ``frame_stamps``.

    """
    with BagFile(path) as bag:
        chosen = topic if topic is not None else _find_topic(bag)
        _check_topic(bag, chosen)
        stamps_ns = _frame_stamps(bag, chosen, stamps)
        first = next(iter(bag.messages([chosen])))[2]
        message = bag.decode(chosen, first)
        size = _size(message, _what(path, chosen, 0))
        found = BagTruth(bag, stamps_ns, (chosen, message.header.frame_id), truth,
                         stamps).find(ground_truth)

    def read(wanted: range) -> Iterator[Frame]:
        with BagFile(path) as source:
            messages = islice(source.messages([chosen]), wanted.start, wanted.stop, wanted.step)
            for number, (_, log_ns, wire) in zip(wanted, messages, strict=False):
                frame = _frame(source.decode(chosen, wire), _what(path, chosen, number), size)
                yield replace(frame, stamp_ns=log_ns) if stamps == LOG else frame

    return Sequence(path.resolve().stem, path, stamps_ns, size, found.trajectory, read,
                    truth=found.text)


def bag_trajectory(path: Path, stamps_ns: NDArray[np.int64],
                   camera_frame: str = '') -> Trajectory | None:
    """
    Return the ground truth of a bag, with or without images; None where it has none.

    Parameters
    ----------
    path : Path
    stamps_ns : int64, (n,)
        Of the frames.
    camera_frame : str
        The camera's frame on /tf, where that is all there is.

    """
    with BagFile(path) as bag:
        return BagTruth(bag, stamps_ns, ('', camera_frame)).find(None).trajectory


def _frame_stamps(bag: BagFile, topic: str, stamps: str | None) -> NDArray[np.int64]:
    rows = [(bag.stamp_ns(wire), log_ns) for _, log_ns, wire in bag.messages([topic])]
    return frame_stamps([stamp for stamp, _ in rows], [log for _, log in rows], bag.path, stamps)


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
