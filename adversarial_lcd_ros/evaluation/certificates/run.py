# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Certificates of the decisions on a sequence, with a clean map.

Every sampled frame is judged and certified against the keyframes before it, all clean. Certified
is a decision that is right and proven to stand; so at 0 flips the share is the accuracy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
import json
import time

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.environment import code_digest
from adversarial_lcd_ros.evaluation.digests import model_digests
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.evaluation.streams import Stream, load_stream_graphs
from adversarial_lcd_ros.files.digests import digest_of
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE
from adversarial_lcd_ros.lcd.certificates import certify
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.targets import decision_path

KIND, SCHEMA = 'certificates', 2
CLASSES = {'new places': NEGATIVE, 'loops': POSITIVE}
CELL_COLUMNS: Mapping[str, tuple[type, ...]] = {
    **dict.fromkeys(('sequence', 'target', 'defences', 'changed', 'told_by'), (str,)),
    **dict.fromkeys(('nodes', 'certify_s'), (int, float)),
    **dict.fromkeys(('frames', 'right', 'certified'), (list,)), 'budget': (int,)}
# A task in a few seconds, even of a slow detector: progress is seen, little is lost.
_FRAMES = 8
_CODE = ('lcd', 'graph', 'edge_rule', 'weisfeiler_lehman', 'keyframes', 'compiled', 'messages',
         'evaluation/certificates/run')


@dataclass(frozen=True, eq=False)
class CertificateTask:
    """
    A detector on a few frames of a sequence.

    Attributes
    ----------
    stream : Stream
    lcd : LcdConfig
    budget : int
        Most flips that are looked at.
    frames : tuple of int
        Ascending.

    """

    stream: Stream
    lcd: LcdConfig
    budget: int
    frames: tuple[int, ...]

    @property
    def key(self) -> str:
        """Digest of all that the certificates depend on, hexadecimal."""
        values = {'schema': SCHEMA, 'code': code_digest(*_CODE), 'stream': self.stream.digest,
                  'detector': asdict(self.lcd), 'budget': self.budget, 'frames': self.frames,
                  'models': model_digests(decision_path(self.lcd.model, self.lcd.target))}
        return digest_of(json.dumps(values, sort_keys=True).encode())


def spread_frames(kind: NDArray[np.int8], count: int) -> dict[str, NDArray[np.int64]]:
    """Return at most so many frames of each class, spread over a sequence, by class."""
    found = {}
    for name, value in CLASSES.items():
        there = np.flatnonzero(kind == value)
        found[name] = there[np.unique(np.linspace(
            0, len(there) - 1, min(count, len(there)), dtype=np.int64))]
    return found


def certificate_tasks(stream: Stream, lcd: LcdConfig, budget: int, count: int
                      ) -> list[CertificateTask]:
    """Return the tasks of a detector on a sequence: at most so many frames of each class."""
    chosen = np.sort(np.concatenate(list(spread_frames(stream.labels.kind, count).values())))
    return [CertificateTask(stream, lcd, budget, tuple(chosen[first:first + _FRAMES].tolist()))
            for first in range(0, len(chosen), _FRAMES)]


def run_certificates(task: CertificateTask) -> tuple[str, Row]:
    """
    Return the key of a task and its cell.

    A cell has ``sequence, target, defences, changed, told_by, nodes, budget, certify_s``, the
    processor time, and of every frame in ``frames`` whether the decision is ``right`` and the
    most flips that it is ``certified`` against; -1: none, not even 0.
    """
    detector = LoopClosureDetector(task.lcd)
    right: list[bool] = []
    certified: list[int] = []
    spent = 0.0
    for number, graph in enumerate(load_stream_graphs(task.stream.graphs)[:task.frames[-1] + 1]):
        if number in task.frames:
            began = time.process_time()
            found = certify(detector, graph, task.budget)
            spent += time.process_time() - began
            right.append(found.is_loop == bool(task.stream.labels.kind[number] == POSITIVE))
            certified.append(int(found.holds.sum()) - 1 if right[-1] else -1)
        detector.remember(graph)
    return task.key, {
        'sequence': task.stream.name, 'target': task.lcd.target, 'defences': task.lcd.defences,
        'changed': task.lcd.changed('target', 'defences', 'model'),
        'told_by': task.stream.labels.told_by, 'nodes': task.stream.nodes_mean,
        'budget': task.budget, 'certify_s': spent, 'frames': list(task.frames), 'right': right,
        'certified': certified}


def by_detector(tasks: Sequence[CertificateTask]) -> list[list[CertificateTask]]:
    """Return the tasks of each detector on each sequence, in the order in which they are."""
    groups: dict[tuple[str, LcdConfig], list[CertificateTask]] = {}
    for task in tasks:
        groups.setdefault((task.stream.name, task.lcd), []).append(task)
    return list(groups.values())
