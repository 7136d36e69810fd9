# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Video files as sequences, through OpenCV."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.poses.trajectory import Trajectory
from adversarial_lcd_ros.sequences.frame import Frame
from adversarial_lcd_ros.sequences.image_files import ticks
from adversarial_lcd_ros.sequences.layouts.base import Options
from adversarial_lcd_ros.sequences.sequence import Sequence

SUFFIXES = ('.mp4', '.avi', '.mkv', '.mov', '.webm', '.m4v', '.mpg', '.mpeg', '.ogv', '.wmv')
_REMEDY = 'get it again, or convert it: ffmpeg -i VIDEO whole.mp4'


def is_video(path: Path) -> bool:
    """Tell whether a path looks like a video file."""
    return path.is_file() and path.suffix.lower() in SUFFIXES


def video_sequence(path: Path, options: Options) -> Sequence:
    """
    Open a video as a sequence.

    Its frames have the stamps of the file, from 0; or those of a rate, where one is given. With
    as many poses as frames, pose i belongs to frame i and stamps it, unless a rate is given.

    Raises
    ------
    SequenceError
        OpenCV cannot open it, or it holds no frame.

    """
    stamps, size, notes = _scan(path)
    if options.rate_hz is not None:
        stamps, notes = ticks(len(stamps), options.rate_hz), ()
    trajectory = options.trajectory(stamps, lambda: None)
    if _is_pose_per_frame(trajectory, stamps, options):
        assert trajectory is not None
        stamps = trajectory.stamp_ns

    def read(wanted: range) -> Iterator[Frame]:
        with _opened(path) as video:
            at = 0
            for number in wanted:
                while at < number and video.grab():
                    at += 1
                is_there, pixels = video.read()
                if not is_there:
                    return
                at += 1
                yield Frame.of_pixels(int(stamps[number]), np.asarray(pixels, np.uint8))

    # Detectors that go through a video name what they find by it and by the frame, from 1.
    names = tuple(f'{path.stem}_{number}' for number in range(1, len(stamps) + 1))
    return Sequence(path.resolve().stem, path, stamps, size, trajectory, read, frame_names=names,
                    notes=notes)


def _is_pose_per_frame(trajectory: Trajectory | None, stamps: NDArray[np.int64],
                       options: Options) -> bool:
    return (trajectory is not None and options.rate_hz is None
            and len(trajectory) == len(stamps) and not trajectory.is_near(stamps).all())


def _scan(path: Path) -> tuple[NDArray[np.int64], tuple[int, int], tuple[str, ...]]:
    """Return the stamps of the frames, their size, and what is to be said."""
    stamps: list[int] = []
    with _opened(path) as video:
        rate = float(video.get(cv2.CAP_PROP_FPS))
        while video.grab():
            stamps.append(round(video.get(cv2.CAP_PROP_POS_MSEC) * 1e6))
    if not stamps:
        raise SequenceError(f'video {path} holds no frame that OpenCV can decode: {_REMEDY}')
    with _opened(path) as video:
        pixels = video.read()[1]
        size = pixels.shape[1], pixels.shape[0]
    if len(stamps) == 1 or np.diff(stamps).min() > 0:
        return np.array(stamps), size, ()
    if not 0 < rate < 1e6:
        raise SequenceError(f'video {path} tells neither stamps nor a rate: give --rate-hz')
    return ticks(len(stamps), rate), size, (
        f'{path.name}: its stamps do not ascend, so that its rate of {rate:g} Hz was taken',)


@contextmanager
def _opened(path: Path) -> Iterator[cv2.VideoCapture]:
    # FFmpeg would tell of a damaged file on stderr, in its own words and many lines.
    os.environ.setdefault('OPENCV_FFMPEG_LOGLEVEL', '-8')
    video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    if not video.isOpened():
        video = cv2.VideoCapture(str(path))
    try:
        if not video.isOpened():
            raise SequenceError(f'video {path} cannot be opened by OpenCV: it is truncated, no '
                                f'video, or of a codec that is missing here; {_REMEDY}')
        yield video
    finally:
        video.release()
