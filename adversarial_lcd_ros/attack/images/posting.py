# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A poster in the frames of a replay, at times that are given: on the way to graph_builder."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.images.poster import Poster, frontal_corners, swayed
from adversarial_lcd_ros.config import ReplayConfig
from adversarial_lcd_ros.errors import CodecError, ConfigError, SequenceError
from adversarial_lcd_ros.messages.codec import typestore
from adversarial_lcd_ros.registry import NONE
from adversarial_lcd_ros.sequences.bagfile import COMPRESSED_IMAGE, IMAGE
from adversarial_lcd_ros.sequences.encodings import message_pixels
from adversarial_lcd_ros.sequences.frame import PNG, Frame, decode


class Posting:
    """
    Pastes the same poster, of one sheet or two, into the frames of some spans of time.

    It hangs in one place of the frame for the whole of a span, but for a sway; light is another
    in each frame. The same seed and stamps give the same pixels. Changed frames are PNG, or raw
    as they came: what the builder gets is what was pasted.

    Parameters
    ----------
    config : ReplayConfig
    first_ns : int
        From which stamp on spans are counted.

    Raises
    ------
    ConfigError
        The spans are not of the form FROM:TO, ..., or there is a poster without any, or of two
        sheets that overlap.

    """

    def __init__(self, config: ReplayConfig, first_ns: int) -> None:
        self._poster = Poster(config.poster, config.poster_share, config.poster_seed,
                              config.poster_sheets)
        self._spans = [(first_ns + round(start * 1e9), first_ns + round(stop * 1e9))
                       for start, stop in spans_in(config.poster_spans)]
        if config.poster != NONE and not self._spans:
            raise ConfigError('poster without poster_spans: say when it is seen, in seconds '
                              'of the bag, such as "10:12, 60:62"')

    def on_pixels(self, pixels: NDArray[np.uint8], stamp_ns: int) -> NDArray[np.uint8]:
        """Return a frame's pixels, (h, w, 3) BGR or (h, w), as they leave the scene."""
        span = self._span(stamp_ns)
        if span is None:
            return pixels
        height, width = pixels.shape[:2]
        seed = self._poster.seed
        square = frontal_corners(width, height, self._poster.span,
                                 np.random.default_rng((seed, span)))
        rng = np.random.default_rng((seed, stamp_ns))
        return self._poster.hang(pixels, swayed(square, rng), rng)

    def on_message(self, message_type: str, stamp_ns: int, wire: bytes) -> bytes:
        """Return the CDR of a frame as it leaves the scene; raises SequenceError."""
        if self._span(stamp_ns) is None:
            return wire
        message: Any = typestore().deserialize_cdr(wire, message_type)
        if message_type == COMPRESSED_IMAGE:
            pixels = decode(message.data.tobytes(), f'frame at {stamp_ns} ns')
            frame = Frame.of_pixels(stamp_ns, self.on_pixels(pixels, stamp_ns)).compressed(PNG)
            message.format, message.data = PNG, np.frombuffer(frame.data, np.uint8)
        elif message_type == IMAGE:
            try:
                pixels = self.on_pixels(message_pixels(message), stamp_ns)
            except CodecError as error:
                raise SequenceError(f'frame at {stamp_ns} ns: {error}') from error
            message.encoding = 'bgr8' if pixels.ndim == 3 else 'mono8'
            message.step, message.data = pixels.strides[0], pixels.ravel()
        else:
            raise ConfigError(f'a poster in frames of type {message_type}: expected images')
        return bytes(typestore().serialize_cdr(message, message_type))

    def _span(self, stamp_ns: int) -> int | None:
        if self._poster.kind == NONE:
            return None
        return next((number for number, (start, stop) in enumerate(self._spans)
                     if start <= stamp_ns < stop), None)


def spans_in(text: str) -> list[tuple[float, float]]:
    """Return the spans in a text such as "10:12, 60:62", seconds; raises ConfigError."""
    spans = []
    for part in filter(None, (part.strip() for part in text.split(','))):
        try:
            start, stop = map(float, part.split(':'))
        except ValueError:
            start, stop = 0.0, 0.0
        if not 0 <= start < stop < 1e9:
            raise ConfigError(f'poster_spans {text!r}: expected spans FROM:TO in seconds between '
                              'commas, such as "10:12, 60:62"')
        spans.append((start, stop))
    return spans
