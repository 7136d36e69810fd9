# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sequences that are bags: of ROS 1 and ROS 2, raw or compressed images on any topic."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import CodecError, SequenceError
from adversarial_lcd_ros.poses.trajectory import Trajectory
from adversarial_lcd_ros.sequences.bag_truth import BagTruth, TruthOptions
from adversarial_lcd_ros.sequences.bagfile import CAMERA_INFO, COMPRESSED_IMAGE, IMAGE, BagFile
from adversarial_lcd_ros.sequences.encodings import DEPTH, is_camera, message_pixels
from adversarial_lcd_ros.sequences.frame import (
    Frame,
    check_camera_file,
    decode,
    is_depth_file,
    open_compressed,
)
from adversarial_lcd_ros.sequences.sequence import Sequence
from adversarial_lcd_ros.sequences.stamps import LOG, frame_stamps

# Topics of pictures that were drawn here, raw or compressed.
DRAWN = ('overlay', 'view')


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
        focal_length_px = _focal_length(bag, chosen, message.header.frame_id, size)

    def read(wanted: range) -> Iterator[Frame]:
        with BagFile(path) as source:
            messages = islice(source.messages([chosen]), wanted.start, wanted.stop, wanted.step)
            for number, (_, log_ns, wire) in zip(wanted, messages, strict=False):
                frame = _frame(source.decode(chosen, wire), _what(path, chosen, number), size)
                yield replace(frame, stamp_ns=log_ns) if stamps == LOG else frame

    return Sequence(path.resolve().stem, path, stamps_ns, size, found.trajectory, read,
                    focal_length_px=focal_length_px, truth=found.text)


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


def _focal_length(bag: BagFile, topic: str, frame_id: str,
                  size: tuple[int, int]) -> float | None:
    """
    Return fx of the camera's CameraInfo, pixels; None where no topic is known to be its own.

    By the convention of image_transport it lies beside the raw images. Else one counts that is
    of the same frame and image size.
    """
    topics = bag.of_type(CAMERA_INFO)
    raw = topic.removesuffix('/compressed')
    beside = f'{raw.rsplit("/", 1)[0]}/camera_info'
    messages = {name: _first(bag, name) for name in topics}
    own = messages.get(beside) or next(
        (message for message in messages.values()
         if frame_id and message.header.frame_id == frame_id), None)
    if own is None or (int(own.width), int(own.height)) != size:
        return None
    # ROS 1 calls the matrix K; drivers without a calibration leave it at 0.
    focal = float((own.k if hasattr(own, 'k') else own.K)[0])
    return focal if math.isfinite(focal) and focal > 0 else None


def _find_topic(bag: BagFile) -> str:
    topics = camera_topics(bag)
    if len(topics) == 1:
        return topics[0]
    if topics:
        raise SequenceError(f'bag {bag.path} has camera images on {", ".join(topics)}: name the '
                            'topic to use')
    raise SequenceError(f'bag {bag.path} has no camera images (sensor_msgs/Image in an '
                        'encoding that cv_bridge knows, or CompressedImage); it has '
                        f'{described_topics(bag)}')


def camera_topics(bag: BagFile) -> list[str]:
    """Return the topics whose first message is a camera's, and not depth, sorted."""
    return [topic for topic in bag.of_type(IMAGE, COMPRESSED_IMAGE)
            if topic.rsplit('/', 2)[-1 - topic.endswith('/compressed')] not in DRAWN
            and _is_camera(bag, topic)]


def described_topics(bag: BagFile) -> str:
    """Return the topics of a bag, with their types and, of images, their encodings."""
    return ', '.join(f'{topic} ({_kind(bag, topic)})' for topic in sorted(bag.topics)
                     ) or 'no topics'


def _is_camera(bag: BagFile, topic: str) -> bool:
    message = _first(bag, topic)
    if bag.topics[topic] == IMAGE:
        return is_camera(message.encoding)
    try:
        check_camera_file(bytes(message.data), message.format)
    except SequenceError:
        return False
    return True


def _kind(bag: BagFile, topic: str) -> str:
    """Return the type of a topic, and of images what they are encoded in."""
    kind = bag.topics[topic]
    if kind not in (IMAGE, COMPRESSED_IMAGE) or not bag.counts[topic]:
        return kind if bag.counts[topic] else f'{kind}, empty'
    message = _first(bag, topic)
    if kind == IMAGE:
        return f'{kind}, {"depth " * (message.encoding in DEPTH)}{message.encoding!r}'
    return f'{kind}, {message.format!r}'


def _first(bag: BagFile, topic: str) -> Any:
    return bag.decode(topic, next(iter(bag.messages([topic])))[2])


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
    try:
        if hasattr(message, 'format'):
            data = bytes(message.data)
            check_camera_file(data, message.format)
            named = f'format {message.format!r}'
            if not is_depth_file(data):
                return open_compressed(stamp_ns, data, named, size)
            # A camera's 16 bits (mono16): once the format is forgotten they would look like depth.
            pixels = np.ascontiguousarray(decode(data, named)[:, :, 0])
        else:
            pixels = message_pixels(message)
        frame = Frame.of_pixels(stamp_ns, pixels)
    except (SequenceError, CodecError) as error:
        raise SequenceError(f'{what}: {error}') from error
    if (size or (frame.width, frame.height)) != (frame.width, frame.height):
        raise SequenceError(f'{what} is {frame.width} x {frame.height} pixels, the first one '
                            f'{size}: a sequence has one image size')
    return frame

