# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The features of every frame that labels look at, and how deep they lie."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.hamming import LANES, lanes, mutual
from adversarial_lcd_ros.graph import DESCRIPTOR_BYTES, MultiTierGraph
from adversarial_lcd_ros.sequences import Frame
from adversarial_lcd_ros.vision.features import FeatureExtractor, spread, to_grey

# Features of a picture: found, with a low threshold so that plain walls have some, and kept.
FOUND, FAST_THRESHOLD, KEPT = 2000, 7, 600


@dataclass(frozen=True, eq=False)
class ViewFeatures:
    """
    Features of n frames, k places for each.

    Attributes
    ----------
    position : float32, (n, k, 2)
        Pixels.
    descriptor : uint8, (n, k, 32)
    count : int64, (n,)
        How many of the places are taken, the first ones.

    """

    position: NDArray[np.float32]
    descriptor: NDArray[np.uint8]
    count: NDArray[np.int64]

    @property
    def words(self) -> NDArray[np.uint64]:
        """Return the descriptors as uint64, (n, k, 4)."""
        packed = np.ascontiguousarray(self.descriptor).view(np.uint64)
        return packed.reshape(*self.descriptor.shape[:2], LANES)


def from_graphs(graphs: Sequence[MultiTierGraph], count: int) -> ViewFeatures:
    """Return the features of the graphs of so many frames; without graphs there are none."""
    if not graphs:
        return _padded([(np.zeros((0, 2), np.float32), np.zeros((0, DESCRIPTOR_BYTES), np.uint8))
                        ] * count)
    return _padded([(graph.position[graph.object_count:], graph.descriptor[graph.object_count:])
                    for graph in graphs])


def from_pictures(frames: Iterable[Frame]) -> ViewFeatures:
    """Return the features of pictures, spread over each."""
    extractor = FeatureExtractor(FOUND, FAST_THRESHOLD)
    rows = []
    for frame in frames:
        found = extractor.extract(to_grey(frame.image()))
        kept = found[spread(found, KEPT, frame.width, frame.height)]
        rows.append((kept.position, kept.descriptor))
    return _padded(rows)


def _padded(rows: Sequence[tuple[NDArray[np.float32], NDArray[np.uint8]]]) -> ViewFeatures:
    count = np.array([len(position) for position, _ in rows], np.int64)
    most = int(count.max(initial=1)) or 1
    position = np.zeros((len(rows), most, 2), np.float32)
    descriptor = np.zeros((len(rows), most, DESCRIPTOR_BYTES), np.uint8)
    for number, (places, words) in enumerate(rows):
        position[number, :len(places)] = places
        descriptor[number, :len(words)] = words
    return ViewFeatures(position, descriptor, count)


def match(features: ViewFeatures, one: int, other: int, bits: int
          ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return features of two frames that are each other's nearest, within so many bits."""
    first, second, _ = mutual(lanes(features.descriptor[one, :features.count[one]]),
                              lanes(features.descriptor[other, :features.count[other]]), bits)
    return first, second
