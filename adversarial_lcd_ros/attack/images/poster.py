# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A poster in the scene: the same simple, highly textured patch in two places (Ikram et al.).

Whoever hangs it needs no access to any message. What is pasted is lit, blurred and noisy, each
time otherwise, and seen in perspective; it is a stand-in for a printed sheet, and no print was
photographed.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import POSTERS
from adversarial_lcd_ros.errors import ConfigError

SIDE_PX, CELLS, SQUARES = 480, 24, 8
# Of the side: how far corners stray from a frontal view, from all sides and between frames.
JITTER, SWAY = 0.10, 0.02
GAIN, OFFSET, BLUR_PX, NOISE = (0.75, 1.15), (-15.0, 15.0), (0.3, 1.0), (2.0, 6.0)
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
        Of the frame, that it covers.
    seed : int
        Of texture, place and light.

    """

    kind: str
    share: float
    seed: int

    @property
    def texture(self) -> NDArray[np.uint8]:
        """The pixels."""
        return make_texture(self.kind, self.seed)


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
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
    return np.asarray(corner + side * (square + JITTER * rng.uniform(-1, 1, (4, 2))))


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
