# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pixels of sensor_msgs/Image: every encoding of a camera that cv_bridge knows, to BGR or grey."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import CodecError

MAX_PIXELS = 2**27
# What depth cameras publish; a camera's 16 bits are called mono16.
DEPTH = ('16UC1', '32FC1')
Pixels = NDArray[Any]


@dataclass(frozen=True)
class _Encoding:
    """
    How pixels lie in a message.

    Attributes
    ----------
    channels : int
        Values a pixel in a row.
    bits : int
        Of a value, 8 or 16.
    convert : callable or None
        Makes BGR of rows that came as something else; keeps the number of bits.
    chroma_rows : float
        Rows of colour behind the rows of brightness, in rows of the image.

    """

    channels: int
    bits: int = 8
    convert: Callable[[Pixels], Pixels] | None = None
    chroma_rows: float = 0.0


def _by(code: int) -> Callable[[Pixels], Pixels]:
    return lambda pixels: np.asarray(cv2.cvtColor(pixels, code))


def _nv24(rows: Pixels) -> Pixels:
    """Return NV24 as BGR: as NV12 of twice the size, of which every second pixel is kept."""
    height = len(rows) // 3
    bright = cv2.resize(rows[:height], None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    colour = rows[height:].reshape(height, -1)
    return np.ascontiguousarray(
        cv2.cvtColor(np.vstack([bright, colour]), cv2.COLOR_YUV2BGR_NV12)[::2, ::2])


# OpenCV names a Bayer pattern by the second row's second and third pixel, ROS by the first two
# rows' first two.
_BAYER = {'rggb': cv2.COLOR_BayerBG2BGR, 'bggr': cv2.COLOR_BayerRG2BGR,
          'gbrg': cv2.COLOR_BayerGR2BGR, 'grbg': cv2.COLOR_BayerGB2BGR}
_UYVY, _YUYV = _Encoding(2, 8, _by(cv2.COLOR_YUV2BGR_UYVY)), _Encoding(2, 8,
                                                                      _by(cv2.COLOR_YUV2BGR_YUYV))
_ENCODINGS = {
    **{f'{name}{bits}': _Encoding(channels, bits, convert) for bits in (8, 16)
       for name, channels, convert in (
           ('mono', 1, None), ('bgr', 3, None), ('rgb', 3, _by(cv2.COLOR_RGB2BGR)),
           ('bgra', 4, _by(cv2.COLOR_BGRA2BGR)), ('rgba', 4, _by(cv2.COLOR_RGBA2BGR)),
           *((f'bayer_{pattern}', 1, _by(code)) for pattern, code in _BAYER.items()))},
    '8UC1': _Encoding(1), '8UC3': _Encoding(3), '8UC4': _Encoding(4, 8, _by(cv2.COLOR_BGRA2BGR)),
    '16UC3': _Encoding(3, 16), '16UC4': _Encoding(4, 16, _by(cv2.COLOR_BGRA2BGR)),
    'yuv422': _UYVY, 'uyvy': _UYVY, 'yuv422_yuy2': _YUYV, 'yuyv': _YUYV,
    'nv12': _Encoding(1, 8, _by(cv2.COLOR_YUV2BGR_NV12), 0.5),
    'nv21': _Encoding(1, 8, _by(cv2.COLOR_YUV2BGR_NV21), 0.5),
    'nv24': _Encoding(1, 8, _nv24, 2.0),
}
KNOWN = tuple(_ENCODINGS)


def is_camera(encoding: str) -> bool:
    """Tell whether pixels of an encoding are those of a camera, and can be converted."""
    return encoding in _ENCODINGS


def message_pixels(message: Any) -> NDArray[np.uint8]:
    """
    Return the pixels of a sensor_msgs/Image, uint8: (height, width, 3) BGR, or (height, width).

    Rows may be padded, values of 16 bits be big-endian; these are scaled to 8 bits, as cv_bridge
    does. An encoding without a meaning of its own (8UC3) is taken for blue, green, red.

    Parameters
    ----------
    message : sensor_msgs/Image
        Of rclpy or of rosbags.

    Raises
    ------
    CodecError
        The encoding is depth, or not one of a camera; or size, step and data contradict each
        other.

    """
    width, height = int(message.width), int(message.height)
    encoding = _find(message.encoding)
    if not 0 < width * height <= MAX_PIXELS:
        raise CodecError(f'image of {width} x {height} pixels: expected 1 to {MAX_PIXELS}',
                         cause='image size')
    rows = _rows(message, width, height, encoding)
    try:
        pixels = rows if encoding.convert is None else encoding.convert(rows)
    except cv2.error as error:
        raise CodecError(f'{message.encoding} image of {width} x {height} pixels cannot be '
                         f'converted: {error.err}', cause='format') from error
    if encoding.bits == 16:
        pixels = cv2.convertScaleAbs(pixels, alpha=255 / 65535)
    return np.ascontiguousarray(pixels, np.uint8)


def _find(name: str) -> _Encoding:
    if name in DEPTH:
        raise CodecError(f'image encoding {name!r} is depth: expected the images of a camera',
                         cause='encoding')
    if name not in _ENCODINGS:
        raise CodecError(f'image encoding {name!r}: expected one of {", ".join(KNOWN)}',
                         cause='encoding')
    return _ENCODINGS[name]


def _rows(message: Any, width: int, height: int, encoding: _Encoding) -> Pixels:
    """Return the values of a message without padding: (rows, width) or (rows, width, channels)."""
    step, size = int(message.step), encoding.bits // 8
    needed = width * encoding.channels * size
    count = height + round(height * encoding.chroma_rows)
    if step < needed or len(message.data) < step * (count - 1) + needed:
        raise CodecError(
            f'{message.encoding} image of {width} x {height} pixels is truncated: '
            f'{len(message.data)} bytes in rows of {step}; expected {count} rows of {needed} or '
            'more', cause='step')
    data: NDArray[np.uint8] = np.frombuffer(message.data, np.uint8)
    # Some drivers leave the padding of the last row out.
    data = np.pad(data, (0, max(step * count - len(data), 0)))[:step * count]
    bare = np.ascontiguousarray(data.reshape(count, step)[:, :needed])
    if size == 2:
        native = '>u2' if message.is_bigendian else '<u2'
        bare = bare.view(native).astype(np.uint16)
    return bare if encoding.channels == 1 else bare.reshape(count, width, encoding.channels)
