# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ORB features, spread over the frame (paper, Fig. 2a)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import GraphError
from adversarial_lcd_ros.graph import DESCRIPTOR_BYTES

GRID_COLUMNS, GRID_ROWS = 10, 8


@dataclass(frozen=True)
class Features:
    """
    Features of one image, k of them.

    Attributes
    ----------
    position : float32, (k, 2)
        Pixels.
    size : float32, (k,)
        Diameter of the patch, pixels.
    score : float32, (k,)
        Harris response.
    descriptor : uint8, (k, 32)

    """

    position: NDArray[np.float32]
    size: NDArray[np.float32]
    score: NDArray[np.float32]
    descriptor: NDArray[np.uint8]

    def __len__(self) -> int:
        """Return the number of features."""
        return len(self.score)

    @classmethod
    def none(cls) -> Features:
        """Return no features."""
        return cls(np.zeros((0, 2), np.float32), np.zeros(0, np.float32),
                   np.zeros(0, np.float32), np.zeros((0, DESCRIPTOR_BYTES), np.uint8))

    def __getitem__(self, chosen: NDArray[np.int64]) -> Features:
        """Return the features with the given indices."""
        return Features(self.position[chosen], self.size[chosen], self.score[chosen],
                        self.descriptor[chosen])


class FeatureExtractor:
    """
    Finds ORB features.

    Parameters
    ----------
    count : int
        Most features of a frame.
    fast_threshold : int
        FAST threshold, grey levels.

    """

    def __init__(self, count: int, fast_threshold: int) -> None:
        self._orb = cv2.ORB.create(nfeatures=count, fastThreshold=fast_threshold)

    def extract(self, grey: NDArray[np.uint8]) -> Features:
        """Return the features of a grey image, uint8 (h, w), strongest first."""
        # ORB keeps off the border, and OpenCV fails on images of a few pixels.
        if min(grey.shape) <= 2 * self._orb.getEdgeThreshold():
            return Features.none()
        keypoints, descriptor = self._orb.detectAndCompute(grey, None)
        if not keypoints:
            return Features.none()
        features = Features(np.asarray(cv2.KeyPoint.convert(keypoints), np.float32),
                            np.array([keypoint.size for keypoint in keypoints], np.float32),
                            np.array([keypoint.response for keypoint in keypoints], np.float32),
                            descriptor)
        return features[np.argsort(-features.score, kind='stable')]


def spread(features: Features, count: int, width: int, height: int) -> NDArray[np.int64]:
    """
    Return the indices of the ``count`` strongest features, cells of a 10 x 8 grid taking turns.

    The strongest of every cell come first, then the second of every cell, and so on; within a
    turn the stronger win. Features must come strongest first.
    """
    column = np.minimum(features.position[:, 0] / width * GRID_COLUMNS, GRID_COLUMNS - 1)
    row = np.minimum(features.position[:, 1] / height * GRID_ROWS, GRID_ROWS - 1)
    cell = row.astype(np.int64) * GRID_COLUMNS + column.astype(np.int64)
    order = np.argsort(cell, kind='stable')
    _, start, size = np.unique(cell[order], return_index=True, return_counts=True)
    turn = np.zeros(len(features), np.int64)
    turn[order] = np.arange(len(features)) - np.repeat(start, size)
    return np.argsort(turn, kind='stable')[:count]


def to_grey(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """
    Return a grey image of a BGR (h, w, 3) or grey (h, w) one.

    Raises
    ------
    GraphError
        It is of another type or shape, or empty.

    """
    if image.dtype != np.uint8 or not image.size or (
            image.ndim != 2 and image.shape[2:] != (3,)):
        raise GraphError(f'image of {image.dtype}{image.shape}: '
                         'expected uint8 (h, w, 3) or (h, w)')
    grey: NDArray[np.uint8] = image
    if image.ndim == 3:
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
    return grey
