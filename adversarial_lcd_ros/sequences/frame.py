# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""One camera frame, as it was recorded."""

from __future__ import annotations

from dataclasses import dataclass
import re

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import CodecError, SequenceError
from adversarial_lcd_ros.sequences.encodings import DEPTH, MAX_PIXELS
from adversarial_lcd_ros.sequences.picture_size import picture_size

JPEG, PNG, WEBP = 'jpeg', 'png', 'webp'
NO_PICTURE = 'none'
RAW_CHANNELS = {'bgr8': 3, 'mono8': 1}
JPEG_QUALITY = 95
_WRITE_OPTIONS = {JPEG: [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY], PNG: []}
# WebP has four bytes of length behind the first four.
_MAGIC = {JPEG: re.compile(rb'\xff\xd8\xff'), PNG: re.compile(rb'\x89PNG\r\n\x1a\n'),
          WEBP: re.compile(rb'RIFF.{4}WEBP', re.DOTALL)}
_PNG_END = b'IEND\xaeB`\x82'
# Behind magic, length and name of the header: width, height, bits, kind (0: grey).
_PNG_BITS = slice(24, 26)
_JPEG_SCAN, _JPEG_END = 0xDA, b'\xff\xd9'


@dataclass(frozen=True)
class Frame:
    """
    A camera frame with its bytes untouched.

    Attributes
    ----------
    stamp_ns : int
        Nanoseconds.
    data : bytes
        A JPEG, PNG or WebP file, or rows of pixels without padding.
    encoding : str
        'jpeg', 'png', 'webp', 'bgr8' or 'mono8'; 'none' where nobody kept the picture: there
        are no data.
    width, height : int
        Pixels.

    """

    stamp_ns: int
    data: bytes
    encoding: str
    width: int
    height: int

    def image(self) -> NDArray[np.uint8]:
        """
        Return the pixels as BGR, uint8 (height, width, 3).

        Raises
        ------
        SequenceError
            The data are truncated or no such image, or one of another size, or there is none.

        """
        if self.encoding == NO_PICTURE:
            raise SequenceError(
                f'frame at {self.stamp_ns} ns has no picture, only recorded detections: build '
                'graphs of them with "adversarial-lcd build" and the detector "csv"')
        pixels = (self._raw_pixels() if self.encoding in RAW_CHANNELS
                  else decode(self.data, f'frame at {self.stamp_ns} ns'))
        if pixels.shape[:2] != (self.height, self.width):
            raise SequenceError(
                f'frame at {self.stamp_ns} ns is {pixels.shape[1]} x {pixels.shape[0]} pixels, '
                f'the frames before it {self.width} x {self.height}: a sequence has one image '
                'size')
        return pixels

    def compressed(self, encoding: str = JPEG) -> Frame:
        """
        Return the frame as a JPEG of quality 95, or as a PNG, which keeps every pixel.

        A frame that is an image file already is returned as it is, whatever is asked for.
        """
        if self.encoding not in RAW_CHANNELS:
            return self
        # cv2 knows grey by its shape; a grey file is smaller and loses nothing.
        pixels = self.image() if RAW_CHANNELS[self.encoding] == 3 else self.image()[:, :, 0]
        done, data = cv2.imencode(f'.{encoding}', pixels, _WRITE_OPTIONS[encoding])
        if not done:
            raise SequenceError(f'frame at {self.stamp_ns} ns: OpenCV cannot write it as '
                                f'{encoding.upper()}')
        return Frame(self.stamp_ns, data.tobytes(), encoding, self.width, self.height)

    def _raw_pixels(self) -> NDArray[np.uint8]:
        channels = RAW_CHANNELS[self.encoding]
        expected = self.width * self.height * channels
        if len(self.data) != expected:
            raise SequenceError(
                f'frame at {self.stamp_ns} ns has {len(self.data)} bytes: expected {expected} '
                f'for {self.width} x {self.height} pixels of {self.encoding}')
        pixels: NDArray[np.uint8] = np.frombuffer(self.data, np.uint8).reshape(
            self.height, self.width, channels)
        if channels == 3:
            return pixels.copy()
        return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR))

    @classmethod
    def of_pixels(cls, stamp_ns: int, pixels: NDArray[np.uint8]) -> Frame:
        """Return the frame of uint8 pixels, (h, w, 3) BGR or (h, w) grey."""
        height, width = pixels.shape[:2]
        return cls(stamp_ns, pixels.tobytes(), 'bgr8' if pixels.ndim == 3 else 'mono8', width,
                   height)


def compressed_encoding(data: bytes, what: str) -> str:
    """
    Return 'jpeg', 'png' or 'webp', by the first bytes of an image file and its end.

    Some versions of OpenCV fill up a truncated image with grey and only warn: hence the look
    for the end. Behind it, cameras put padding and data of their own.

    Raises
    ------
    SequenceError
        The data are none of these, or end too early.

    """
    for encoding, magic in _MAGIC.items():
        if magic.match(data):
            if not _is_whole(encoding, data):
                raise SequenceError(f'{what} is a truncated {encoding.upper()} of {len(data)} '
                                    'bytes: get the sequence again')
            return encoding
    raise SequenceError(f'{what}: {len(data)} bytes that start with {data[:4].hex() or "nothing"} '
                        'are neither a JPEG nor a PNG or WebP')


def is_depth_file(data: bytes) -> bool:
    """Tell whether an image file is a PNG of 16 bits a pixel without colour, as depth maps are."""
    return bool(_MAGIC[PNG].match(data)) and data[_PNG_BITS] == b'\x10\x00'


def check_camera_file(data: bytes, text: str) -> None:
    """
    Raise SequenceError if an image file in a CompressedImage is depth, or a bare mosaic.

    Parameters
    ----------
    data : bytes
        The file.
    text : str
        The message's format, as 'bgr8; jpeg compressed bgr8', or just 'jpeg'.

    """
    encoding = text.split(';')[0].strip()
    if 'compresseddepth' in text.lower() or encoding in DEPTH:
        raise SequenceError(f'format {text!r} is depth: expected the images of a camera')
    if encoding.startswith('bayer_') and text.rstrip().endswith('compressed'):
        raise SequenceError(f'format {text!r} is a mosaic that was compressed as it is: expected '
                            'colour or grey')
    if is_depth_file(data) and encoding != 'mono16':
        raise SequenceError(f'format {text!r}, but a PNG of 16 bits without colour: depth; '
                            'expected the images of a camera')


def _is_whole(encoding: str, data: bytes) -> bool:
    if encoding == JPEG:
        return _has_jpeg_end(data)
    if encoding == PNG:
        return _PNG_END in data
    return len(data) >= 8 + int.from_bytes(data[4:8], 'little')


def _has_jpeg_end(data: bytes) -> bool:
    # Inside the scan the marker cannot occur, but in the segments before it, where thumbnails
    # have ends of their own: step over these, from length to length.
    at = 2
    while at + 4 <= len(data) and data[at] == 0xFF and data[at + 1] != _JPEG_SCAN:
        is_fill = data[at + 1] == 0xFF
        at += 1 if is_fill else 2 + int.from_bytes(data[at + 2:at + 4], 'big')
    return data.rfind(_JPEG_END) >= at


def decode(data: bytes, what: str) -> NDArray[np.uint8]:
    """Return the pixels of an image file as BGR, uint8 (h, w, 3); raises SequenceError."""
    compressed_encoding(data, what)
    _check_declared_size(data, what)
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error as error:
        raise SequenceError(f'{what} cannot be decoded: {error}') from error
    if pixels is None:
        raise SequenceError(f'{what} cannot be decoded: {len(data)} damaged bytes; get the '
                            'sequence again')
    return np.asarray(pixels, np.uint8)


def _check_declared_size(data: bytes, what: str) -> None:
    # A megabyte of PNG may declare, and would become, gigabytes of pixels.
    try:
        width, height = picture_size(data, what)
    except CodecError as error:
        raise SequenceError(f'{error}: it cannot be decoded; get the sequence again'
                            ) from error
    if not 0 < width * height <= MAX_PIXELS:
        raise SequenceError(f'{what} declares {width} x {height} pixels: expected 1 to '
                            f'{MAX_PIXELS}')


def open_compressed(stamp_ns: int, data: bytes, what: str,
                    size: tuple[int, int] | None = None) -> Frame:
    """
    Return the frame in a JPEG, PNG or WebP file.

    Without its size (width, height) the data are decoded for it; with it, only their ends are
    looked at, and ``Frame.image`` holds the rest against it.
    """
    encoding = compressed_encoding(data, what)
    if size is None:
        height, width = decode(data, what).shape[:2]
        size = width, height
    return Frame(stamp_ns, data, encoding, *size)
