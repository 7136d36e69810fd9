"""Camera messages to pixels."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import CodecError
from adversarial_lcd_ros.sequences.picture_size import picture_size

# Encoding to bytes a pixel, and what turns it into BGR.
_ENCODINGS: dict[str, tuple[int, int | None]] = {
    'bgr8': (3, None), 'rgb8': (3, cv2.COLOR_RGB2BGR), 'mono8': (1, None)}


def check_size(width: int, height: int, max_pixels: int) -> None:
    """Refuse an image without pixels, or with more than the limit; raises CodecError."""
    if not 0 < width * height <= max_pixels:
        raise CodecError(f'image of {width} x {height} pixels: expected 1 to {max_pixels} '
                         '(parameter max_pixels)', cause='image size')


def image_pixels(message: Any, max_pixels: int) -> NDArray[np.uint8]:
    """
    Return the pixels of a sensor_msgs/Image, uint8: (height, width, 3) BGR, or grey without 3.

    Raises
    ------
    CodecError
        The encoding is not supported, or size, step and data contradict each other.

    """
    width, height, step = message.width, message.height, message.step
    if message.encoding not in _ENCODINGS:
        raise CodecError(f'image encoding {message.encoding!r}: expected one of '
                         f'{", ".join(_ENCODINGS)}', cause='encoding')
    channels, conversion = _ENCODINGS[message.encoding]
    check_size(width, height, max_pixels)
    if step < width * channels or len(message.data) < step * height:
        raise CodecError(
            f'{message.encoding} image of {width} x {height} pixels with {len(message.data)} '
            f'bytes in rows of {step}: expected at least {width * channels} a row', cause='step')
    rows: NDArray[np.uint8] = np.frombuffer(message.data, np.uint8, step * height)
    shape = (height, width, 3) if channels == 3 else (height, width)
    pixels = np.ascontiguousarray(rows.reshape(height, step)[:, :width * channels]).reshape(shape)
    return pixels if conversion is None else np.asarray(cv2.cvtColor(pixels, conversion))


def compressed_pixels(message: Any, max_pixels: int) -> NDArray[np.uint8]:
    """
    Return the pixels of a sensor_msgs/CompressedImage (JPEG, PNG, WebP) as BGR, uint8.

    Raises
    ------
    CodecError
        The data are no such image, or its header declares more pixels than the limit.

    """
    data: NDArray[np.uint8] = np.frombuffer(message.data, np.uint8)
    what = f'compressed image of format {message.format[:40]!r}'
    check_size(*picture_size(data.tobytes(), what), max_pixels)
    try:
        pixels = cv2.imdecode(data, cv2.IMREAD_COLOR)
    except cv2.error as error:
        raise CodecError(f'{what} cannot be decoded: {error}', cause='format') from error
    if pixels is None:
        raise CodecError(f'{what} cannot be decoded: {len(data)} damaged bytes', cause='format')
    return np.asarray(pixels, np.uint8)
