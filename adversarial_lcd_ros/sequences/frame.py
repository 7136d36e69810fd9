"""One camera frame, as it was recorded."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import SequenceError

JPEG, PNG = 'jpeg', 'png'
NO_PICTURE = 'none'
RAW_CHANNELS = {'bgr8': 3, 'rgb8': 3, 'mono8': 1}
JPEG_QUALITY = 95
_WRITE_OPTIONS = {JPEG: [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY], PNG: []}
_MAGIC = {JPEG: b'\xff\xd8\xff', PNG: b'\x89PNG\r\n\x1a\n'}
_PNG_END = b'IEND\xaeB`\x82'
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
        A JPEG or PNG file, or rows of pixels without padding.
    encoding : str
        'jpeg', 'png', 'bgr8', 'rgb8' or 'mono8'; 'none' where nobody kept the picture: there
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

        A frame that is a JPEG or PNG already is returned as it is, whatever is asked for.
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
        if self.encoding == 'bgr8':
            return pixels.copy()
        code = cv2.COLOR_RGB2BGR if self.encoding == 'rgb8' else cv2.COLOR_GRAY2BGR
        return np.asarray(cv2.cvtColor(pixels, code))


def compressed_encoding(data: bytes, what: str) -> str:
    """
    Return 'jpeg' or 'png', by the first bytes of an image file and its end marker.

    Some versions of OpenCV fill up a truncated image with grey and only warn: hence the look
    for the end. Behind it, cameras put padding and data of their own.

    Raises
    ------
    SequenceError
        The data are neither, or end too early.

    """
    for encoding, magic in _MAGIC.items():
        if data.startswith(magic):
            is_whole = _has_jpeg_end(data) if encoding == JPEG else _PNG_END in data
            if not is_whole:
                raise SequenceError(f'{what} is a truncated {encoding.upper()} of {len(data)} '
                                    'bytes: get the sequence again')
            return encoding
    raise SequenceError(f'{what}: {len(data)} bytes that start with {data[:4].hex() or "nothing"} '
                        'are neither a JPEG nor a PNG')


def _has_jpeg_end(data: bytes) -> bool:
    # Inside the scan the marker cannot occur, but in the segments before it, where thumbnails
    # have ends of their own: step over these, from length to length.
    at = 2
    while at + 4 <= len(data) and data[at] == 0xFF and data[at + 1] != _JPEG_SCAN:
        is_fill = data[at + 1] == 0xFF
        at += 1 if is_fill else 2 + int.from_bytes(data[at + 2:at + 4], 'big')
    return data.rfind(_JPEG_END) >= at


def decode(data: bytes, what: str) -> NDArray[np.uint8]:
    """Return the pixels of a JPEG or PNG as BGR, uint8 (h, w, 3); raises SequenceError."""
    compressed_encoding(data, what)
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error as error:
        raise SequenceError(f'{what} cannot be decoded: {error}') from error
    if pixels is None:
        raise SequenceError(f'{what} cannot be decoded: {len(data)} damaged bytes; get the '
                            'sequence again')
    return np.asarray(pixels, np.uint8)


def open_compressed(stamp_ns: int, data: bytes, what: str,
                    size: tuple[int, int] | None = None) -> Frame:
    """
    Return the frame in a JPEG or PNG file.

    Without its size (width, height) the data are decoded for it; with it, only their ends are
    looked at, and ``Frame.image`` holds the rest against it.
    """
    encoding = compressed_encoding(data, what)
    if size is None:
        height, width = decode(data, what).shape[:2]
        size = width, height
    return Frame(stamp_ns, data, encoding, *size)
