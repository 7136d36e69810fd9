# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Certificates of the decisions on a sequence, with a clean map.

Every sampled frame is judged and certified against the keyframes before it, all clean. Certified
is a decision that is right and proven to stand; so at 0 flips the share is the accuracy.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.evaluation.streams import Stream, load_stream_graphs
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE
from adversarial_lcd_ros.lcd.certificates import certify
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector

KIND, SCHEMA = 'certificates', 1
CLASSES = {'new places': NEGATIVE, 'loops': POSITIVE}


@dataclass(frozen=True, eq=False)
class CertificateTask:
    """
    A detector on a sequence.

    Attributes
    ----------
    stream : Stream
    lcd : LcdConfig
    budget : int
        Most flips that are looked at.
    frames : int
        Most frames of each class, spread over the sequence.

    """

    stream: Stream
    lcd: LcdConfig
    budget: int
    frames: int

    def chosen(self) -> dict[str, NDArray[np.int64]]:
        """Return the frames of each class."""
        found = {}
        for name, kind in CLASSES.items():
            there = np.flatnonzero(self.stream.labels.kind == kind)
            found[name] = there[np.unique(np.linspace(
                0, len(there) - 1, min(self.frames, len(there)), dtype=np.int64))]
        return found


def run_certificates(task: CertificateTask) -> dict[str, Any]:
    """
    Return the row of a task.

    ``sequence, target, defences, geometric_check, geometric_hull, nodes, budget, settings`` and,
    of each class, ``frames`` and ``certified``: how many of them by the number of flips.
    """
    detector = LoopClosureDetector(task.lcd)
    chosen = task.chosen()
    certified = {name: np.zeros(task.budget + 1, np.int64) for name in chosen}
    for number, graph in enumerate(load_stream_graphs(task.stream.graphs)):
        for name, frames in chosen.items():
            if number in frames:
                found = certify(detector, graph, task.budget)
                if found.is_loop == (CLASSES[name] == POSITIVE):
                    certified[name] += found.holds
        detector.remember(graph)
    return {'sequence': task.stream.name, 'target': task.lcd.target,
            'defences': task.lcd.defences, 'geometric_check': task.lcd.geometric_check,
            'nodes': task.stream.nodes_mean, 'budget': task.budget,
            'settings': asdict(task.lcd),
            'classes': {name: {'frames': len(frames), 'certified': certified[name].tolist()}
                        for name, frames in chosen.items()}}
