# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A poster in the scene: the same simple, highly textured patch in two places (Ikram et al.).

Two sheets hang in opposite corners of one square of half the frame: who knows that a check asks
how much of the frame agrees makes more of it agree with no more paper.

Whoever hangs it needs no access to any message. What is pasted is lit, blurred and noisy, each
time otherwise, and seen in perspective; it is a stand-in for a printed sheet, and no print was
photographed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import POSTERS
from adversarial_lcd_ros.errors import ConfigError

SIDE_PX, CELLS, SQUARES = 480, 24, 8
# Of the side: how far corners stray from a frontal view, from all sides and between frames.
JITTER, SWAY = 0.10, 0.02
GAIN, OFFSET, BLUR_PX, NOISE = (0.75, 1.15), (-15.0, 15.0), (0.3, 1.0), (2.0, 6.0)
# Of the frame: the square in which two sheets hang. Above half of that they overlap.
TWO_SPAN = 0.5
_SECOND_SEED = 500_009
_UNIT = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
_SHIFT = 4


def make_texture(kind: str, seed: int) -> NDArray[np.uint8]:
    """
    Return a square poster, grey, shape (480, 480).

    Parameters
    ----------
    kind : str
        cells: 24 x 24 black or white at random; noise: 120 x 120 greys at random; chessboard:
        8 x 8 squares, always the same.
    seed : int
        Another seed, another poster of the kind.

    """
    rng = np.random.default_rng((seed, POSTERS.index(kind)))
    small: NDArray[np.uint8]
    if kind == 'cells':
        small = (255 * rng.integers(0, 2, (CELLS, CELLS))).astype(np.uint8)
    elif kind == 'noise':
        small = rng.integers(0, 256, (SIDE_PX // 4, SIDE_PX // 4)).astype(np.uint8)
    elif kind == 'chessboard':
        small = (255 * (np.indices((SQUARES, SQUARES)).sum(axis=0) % 2)).astype(np.uint8)
    else:
        raise ConfigError(f'poster {kind!r} has no texture: expected one of '
                          f'{", ".join(POSTERS[1:])}')
    return np.asarray(cv2.resize(small, (SIDE_PX, SIDE_PX), interpolation=cv2.INTER_NEAREST),
                      np.uint8)


@dataclass(frozen=True)
class Poster:
    """
    What hangs in the scene, and how large.

    Attributes
    ----------
    kind : str
        See ``make_texture``.
    share : float
        Of the frame, that it covers, all sheets together.
    seed : int
        Of texture, place and light.
    sheets : int
        1, or 2 with a texture each.

    Raises
    ------
    ConfigError
        Two sheets of that share would overlap.

    """

    kind: str
    share: float
    seed: int
    sheets: int = 1

    def __post_init__(self) -> None:
        if self.sheets > 1 and self.share > TWO_SPAN / 2:
            raise ConfigError(f'two sheets over {self.share:g} of the frame overlap: expected a '
                              f'share of at most {TWO_SPAN / 2:g}')

    @cached_property
    def textures(self) -> list[NDArray[np.uint8]]:
        """The pixels of each sheet."""
        return [make_texture(self.kind, self.seed + number * _SECOND_SEED)
                for number in range(self.sheets)]

    @property
    def span(self) -> float:
        """Share of the frame of the square that it hangs in."""
        return self.share if self.sheets == 1 else TWO_SPAN

    def hang(self, image: NDArray[np.uint8], square: NDArray[np.float64],
             rng: np.random.Generator) -> NDArray[np.uint8]:
        """
        Return a copy of a picture with every sheet in it.

        Parameters
        ----------
        image : uint8, (h, w, 3) or (h, w)
        square : float64, (4, 2)
            Corners of what it hangs in, pixels; see ``paste``.
        rng : Generator
            Of the light.

        """
        for number, texture in enumerate(self.textures):
            image = paste(image, texture, self._corners(square, number), rng)
        return image

    def _corners(self, square: NDArray[np.float64], number: int) -> NDArray[np.float64]:
        """Return the corners of a sheet, (4, 2)."""
        if self.sheets == 1:
            return square
        side = np.sqrt(self.share / self.sheets / TWO_SPAN)
        matrix = cv2.getPerspectiveTransform(_UNIT, square.astype(np.float32))
        own = (side * _UNIT + number * (1 - side)).astype(np.float32)
        return np.asarray(cv2.perspectiveTransform(own[None], matrix)[0], np.float64)


def frontal_corners(width: int, height: int, share: float, rng: np.random.Generator
                    ) -> NDArray[np.float64]:
    """
    Return the corners of a poster seen nearly from the front, anywhere in the frame, (4, 2).

    From the upper left one on, clockwise, pixels. A poster as large as the frame allows where
    the share asks for more.
    """
    side = min(np.sqrt(share * width * height), min(width, height) / (1 + 2 * JITTER))
    room = np.array([width, height]) - side * (1 + 2 * JITTER)
    corner = JITTER * side + rng.random(2) * room
    return np.asarray(corner + side * (_UNIT + JITTER * rng.uniform(-1, 1, (4, 2))))


def paste(image: NDArray[np.uint8], texture: NDArray[np.uint8], corners: NDArray[np.float64],
          rng: np.random.Generator) -> NDArray[np.uint8]:
    """
    Return a copy of a picture with a poster in it, under a light of its own.

    Parameters
    ----------
    image : uint8, (h, w, 3) or (h, w)
    texture : uint8, (s, s)
    corners : float64, (4, 2)
        Where the texture's corners come to lie, pixels, also beyond the frame.
    rng : Generator
        Of gain, offset, blur and noise.

    """
    height, width = image.shape[:2]
    side = len(texture)
    source = np.array([(0, 0), (side, 0), (side, side), (0, side)], np.float32)
    matrix = cv2.getPerspectiveTransform(source, corners.astype(np.float32))
    warped = cv2.warpPerspective(texture, matrix, (width, height), flags=cv2.INTER_AREA)
    mask: NDArray[np.uint8] = np.zeros((height, width), np.uint8)
    cv2.fillConvexPoly(mask, np.rint(corners * (1 << _SHIFT)).astype(np.int32), 255, cv2.LINE_AA,
                       _SHIFT)
    lit = rng.uniform(*GAIN) * cv2.GaussianBlur(
        warped, (0, 0), rng.uniform(*BLUR_PX)).astype(np.float64) + rng.uniform(*OFFSET)
    lit += rng.normal(0.0, rng.uniform(*NOISE), lit.shape)
    weight = mask / 255.0
    if image.ndim == 3:
        lit, weight = lit[:, :, None], weight[:, :, None]
    return np.asarray(np.clip(np.rint((1 - weight) * image + weight * lit), 0, 255), np.uint8)


def swayed(corners: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Return corners as a camera sees them that has moved a little, (4, 2)."""
    side = float(np.linalg.norm(corners[1] - corners[0]))
    return np.asarray(corners + SWAY * side * rng.uniform(-1, 1, (4, 2)))
