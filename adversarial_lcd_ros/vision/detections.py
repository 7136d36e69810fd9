# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects from a detector of the user's own, in place of the network (paper, Fig. 2b)."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.sequences.detections import DetectionTable
from adversarial_lcd_ros.vision.objects import Detections

# Detections that came before their frames.
MAX_EARLY = 64
MISSED, UNMATCHED = 'frames without detections', 'unmatched detections'


def recorded_objects(table: DetectionTable, stamp_ns: int, tolerance_ns: int) -> Detections:
    """Return what a table says of a frame, as recorded; nothing where it has no such frame."""
    rows = table.rows_near(stamp_ns, tolerance_ns)
    return Detections(table.label[rows], table.box[rows], table.score[rows])


def given_objects(found: Detections, width: int, height: int, score: float) -> Detections:
    """Return foreign detections as the network's would be: clipped, sorted, confident enough."""
    corners = np.concatenate([found.box[:, :2], found.box[:, :2] + found.box[:, 2:]], axis=1)
    kept = found.score >= score
    return Detections.of(found.label[kept], corners[kept], found.score[kept], width, height)


def class_words(label: NDArray[np.uint32]) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """
    Return the vBoW vector of a frame that has objects and no features: its classes.

    A class is a word, weighed by its frequency in the frame (L1-normalised). Such vectors
    compare with each other only: class 5 has nothing to do with word 5 of a vocabulary.
    """
    word, count = np.unique(label, return_counts=True)
    return word.astype(np.uint32), (count / max(len(label), 1)).astype(np.float32)


@dataclass(frozen=True)
class _Waiting:
    stamp_ns: int
    until_s: float
    objects: Future[Detections]


class DetectionInbox:
    """
    Brings frames and their detections together by their stamps, whichever come first.

    A frame waits for its detections, but not for ever: then it has no objects. Not for use from
    several threads.

    Parameters
    ----------
    tolerance_ns : int
        Largest difference of the stamps.
    wait_s : float
        Longest wait of a frame, seconds.
    capacity : int
        Frames that may wait; beyond, the oldest one waits no longer.
    count : callable
        Called with MISSED for a frame that has waited in vain, with UNMATCHED for detections
        that no frame has waited for.

    """

    def __init__(self, tolerance_ns: int, wait_s: float, capacity: int,
                 count: Callable[[str], None]) -> None:
        self._tolerance_ns, self._wait_s, self._capacity = tolerance_ns, wait_s, capacity
        self._count = count
        self._early: dict[int, Detections] = {}
        self._waiting: list[_Waiting] = []
        self._latest_ns: int | None = None

    def expect(self, stamp_ns: int, now_s: float) -> Future[Detections]:
        """Return what will hold the detections of a frame that has come."""
        self._latest_ns = stamp_ns
        objects: Future[Detections] = Future()
        near = self._nearest(list(self._early), stamp_ns)
        if near is None:
            self._waiting.append(_Waiting(stamp_ns, now_s + self._wait_s, objects))
        else:
            objects.set_result(self._early.pop(near))
        # Frames come in order: what belongs to an earlier one has missed it.
        for stamp in [stamp for stamp in self._early if stamp < stamp_ns - self._tolerance_ns]:
            del self._early[stamp]
            self._count(UNMATCHED)
        while len(self._waiting) > self._capacity:
            self._give_up(self._waiting[0])
        return objects

    def offer(self, stamp_ns: int, detections: Detections) -> None:
        """Hand over the detections of a frame that waits, or that is still to come."""
        near = self._nearest([frame.stamp_ns for frame in self._waiting], stamp_ns)
        if near is not None:
            frame = next(frame for frame in self._waiting if frame.stamp_ns == near)
            self._waiting.remove(frame)
            frame.objects.set_result(detections)
            return
        if self._latest_ns is not None and stamp_ns <= self._latest_ns + self._tolerance_ns:
            self._count(UNMATCHED)
            return
        if len(self._early) == MAX_EARLY:
            del self._early[min(self._early)]
            self._count(UNMATCHED)
        self._early[stamp_ns] = detections

    def expire(self, now_s: float) -> None:
        """Let frames go that have waited long enough."""
        for frame in [frame for frame in self._waiting if frame.until_s <= now_s]:
            self._give_up(frame)

    def close(self) -> None:
        """Let all frames go."""
        while self._waiting:
            self._give_up(self._waiting[0])

    def _give_up(self, frame: _Waiting) -> None:
        self._waiting.remove(frame)
        self._count(MISSED)
        frame.objects.set_result(Detections.none())

    def _nearest(self, stamps: list[int], stamp_ns: int) -> int | None:
        near = min(stamps, key=lambda stamp: abs(stamp - stamp_ns), default=None)
        if near is None or abs(near - stamp_ns) > self._tolerance_ns:
            return None
        return near
