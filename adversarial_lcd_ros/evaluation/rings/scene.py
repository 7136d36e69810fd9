# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The frames of two places, and what hangs in them: on a wall where depth is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.images.poster import Poster, frontal_corners, swayed
from adversarial_lcd_ros.evaluation.rings.walls import Camera, find_wall
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.ground_truth.depth import DepthImages, find_depth
from adversarial_lcd_ros.ground_truth.overlap import rotations
from adversarial_lcd_ros.sequences import Sequence as CameraSequence
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.sequences.part import SequencePart

# What is compared: the same poster, none, or another of the kind in the later place.
SAME, BARE, OTHER = 'same', 'no poster', 'another poster'
_OTHER_SEED = 1_000_003


@dataclass(frozen=True)
class Condition:
    """
    What hangs in the two places.

    Attributes
    ----------
    kind : str
        Texture; 'none' for no poster.
    share : float
        Of the frame, all posters together.
    count : int
        0 to 2 posters.
    control : str
        SAME, BARE or OTHER.

    """

    kind: str
    share: float
    count: int = 1
    control: str = SAME


@dataclass(frozen=True, eq=False)
class Scene:
    """
    The frames of two places.

    Attributes
    ----------
    places : tuple of tuple of int
        Frames that show the earlier place, the main one first; those that show the later one.
    image : dict of int to uint8, (h, w, 3)
        By frame.
    camera, depth : dict
        By frame; empty where depth or poses are not known.
    seed : int
        Of textures, places and light.

    """

    places: tuple[tuple[int, ...], ...]
    image: dict[int, NDArray[np.uint8]]
    camera: dict[int, Camera]
    depth: dict[int, NDArray[np.float32]]
    seed: int

    @classmethod
    def read(cls, source: str, graphs: Sequence[MultiTierGraph],
             places: tuple[tuple[int, ...], ...], focal: float, seed: int) -> Scene:
        """
        Read the frames of a sequence, with depth and poses where they are.

        Parameters
        ----------
        source : str
            As for ``open_graphs``.
        graphs : sequence of MultiTierGraph
            Of all frames.
        places, seed
            See above.
        focal : float
            Over the image width.

        """
        sequence, depth = _opened(source)
        frames = sorted(index for place in places for index in place)
        image = {index: _picture(sequence, graphs[index].sequence) for index in frames}
        if depth is None or sequence.trajectory is None:
            return cls(places, image, {}, {}, seed)
        stamps = np.array([graphs[index].stamp_ns for index in frames], np.int64)
        pose = sequence.trajectory.at(stamps)
        turn, rays = rotations(pose.quaternion), depth.at(stamps)
        return cls(places, image, {
            index: Camera(turn[row], pose.position[row], focal, *sequence.image_size)
            for row, index in enumerate(frames)},
            {index: rays[row] for row, index in enumerate(frames)}, seed)

    def posted(self, condition: Condition) -> tuple[dict[int, NDArray[np.uint8]], int]:
        """Return the frames with what hangs in them, and in how many places it is on a wall."""
        found, walls = dict(self.image), 0
        for number, place in enumerate(self.places if condition.count else ()):
            other = number > 0 and condition.control == OTHER
            poster = Poster(condition.kind, condition.share, self.seed + other * _OTHER_SEED,
                            condition.count)
            rng = np.random.default_rng((self.seed, number, round(1e4 * condition.share)))
            world = self._wall(place[0], condition, rng)
            walls += world is not None
            height, width = found[place[0]].shape[:2]
            frontal = frontal_corners(width, height, poster.span, rng)
            for index in place:
                square = (swayed(frontal, rng) if world is None
                          else self.camera[index].pixels(world))
                if square is not None:
                    found[index] = poster.hang(found[index], square, rng)
        return found, walls

    def _wall(self, index: int, condition: Condition, rng: np.random.Generator
              ) -> NDArray[np.float64] | None:
        if index not in self.depth or condition.count > 1:
            return None
        return find_wall(self.camera[index], self.depth[index], condition.share, rng)


def _picture(sequence: CameraSequence, number: int) -> NDArray[np.uint8]:
    return np.asarray(next(iter(sequence.frames(number, number + 1))).image(), np.uint8)


@lru_cache(2)
def _opened(source: str) -> tuple[CameraSequence, DepthImages | None]:
    path = Path(SequencePart.parse(source).path)
    return open_sequence(path), find_depth(path)
