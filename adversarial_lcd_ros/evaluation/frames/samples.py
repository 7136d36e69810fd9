# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which frames are attacked: by seed and sequence alone, so that all attacks meet the same."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.evaluation.frames.pairs import PairDetector, draw_pairs
from adversarial_lcd_ros.ground_truth.labels import (
    ELSEWHERE,
    NEGATIVE,
    POSITIVE,
    RIGHT,
    UNTOLD,
    FrameLabels,
)
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector

_DRAW = 20_210  # of the one drawing that all seeds share


@dataclass(frozen=True, eq=False)
class FrameSample:
    """
    The frames to attack, and what ground truth says about them.

    Attributes
    ----------
    frame : int64, (k,)
        Indices in the stream, ascending.
    kind : int8, (k,)
        +1 a loop is there to be found, -1 a new place.
    match_is : str, (k, n)
        What is said of a match with each frame of the stream: ``FrameLabels.judge``.
    told_by : str
        What told the labels, ``FrameLabels.told_by``.
    reference : int64, (k,), optional
        By pairs: the earlier frame that each is held against. None: it is held against the map.

    """

    frame: NDArray[np.int64]
    kind: NDArray[np.int8]
    match_is: NDArray[np.str_]
    told_by: str = ''
    reference: NDArray[np.int64] | None = None

    def make_detector(self, config: LcdConfig) -> LoopClosureDetector:
        """Return a detector that judges as the sample asks: against the map, or by pairs."""
        return (LoopClosureDetector if self.reference is None else PairDetector)(config)

    def hold_against(self, row: int, detectors: Iterable[LoopClosureDetector]) -> None:
        """By pairs, give detectors the reference of a frame of the sample."""
        for detector in detectors:
            if self.reference is not None and isinstance(detector, PairDetector):
                detector.reference = int(self.reference[row])


def sample_frames(labels: FrameLabels, per_kind: int, seed: int) -> FrameSample:
    """
    Draw frames with a loop, and as many at new places.

    The frames of each kind are cut in time into ``per_kind`` parts, and one of each part is
    drawn. Seeds that follow each other draw different frames, until a part is used up and begins
    anew: then its frames are attacked again, with other random numbers. A kind with fewer frames
    than asked for gives all it has, and one without any gives none.

    Parameters
    ----------
    labels : FrameLabels
        Of the stream.
    per_kind : int
        Frames of each kind.
    seed : int
        Of the cell.

    """
    chosen = []
    for kind in (POSITIVE, NEGATIVE):
        frames = np.flatnonzero(labels.kind == kind)
        for part in np.array_split(frames, min(per_kind, len(frames)) or 1):
            if len(part):
                order = np.random.default_rng((_DRAW, int(part[0]))).permutation(part)
                chosen.append(int(order[seed % len(part)]))
    frame = np.array(sorted(chosen), np.int64)
    every = np.arange(len(labels.kind))
    match_is = np.array([labels.judge(np.full(len(every), query), every) for query in frame],
                        np.str_).reshape(len(frame), len(every))
    return FrameSample(frame, labels.kind[frame], match_is, labels.told_by)


def sample_pairs(labels: FrameLabels, per_kind: int, seed: int) -> FrameSample:
    """
    Draw loops, and as many pairs of different places (``pairs.draw_pairs``).

    Parameters
    ----------
    labels : FrameLabels
        Of the stream.
    per_kind : int
        Pairs of each kind.
    seed : int
        Of the cell.

    """
    query, kind, reference = draw_pairs(labels.relation, per_kind, seed)
    match_is = np.full((len(query), len(labels.kind)), UNTOLD, f'<U{len(ELSEWHERE)}')
    match_is[np.arange(len(query)), reference] = np.where(kind == POSITIVE, RIGHT, ELSEWHERE)
    return FrameSample(query, kind, match_is, labels.told_by, reference)


SAMPLES: Mapping[str, Callable[[FrameLabels, int, int], FrameSample]] = {
    'frames': sample_frames, 'pairs': sample_pairs}
