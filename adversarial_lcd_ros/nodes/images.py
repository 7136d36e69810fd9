# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Camera messages to pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import CodecError, SequenceError
from adversarial_lcd_ros.sequences.encodings import message_pixels
from adversarial_lcd_ros.sequences.frame import check_camera_file, decode
from adversarial_lcd_ros.sequences.picture_size import picture_size


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
        The encoding is not one of a camera, or size, step and data contradict each other.

    """
    check_size(message.width, message.height, max_pixels)
    return message_pixels(message)


def compressed_pixels(message: Any, max_pixels: int) -> NDArray[np.uint8]:
    """
    Return the pixels of a sensor_msgs/CompressedImage (JPEG, PNG, WebP) as BGR, uint8.

    Raises
    ------
    CodecError
        The data are no such image, or depth, or the header declares more pixels than the limit.

    """
    data, what = bytes(message.data), f'compressed image of format {message.format[:40]!r}'
    check_size(*picture_size(data, what), max_pixels)
    try:
        check_camera_file(data, message.format)
        return decode(data, what)
    except SequenceError as error:
        raise CodecError(str(error), cause='format') from error
