# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Finished cells of certificates to one row for each detector on each sequence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.evaluation import intervals
from adversarial_lcd_ros.evaluation.certificates.run import CLASSES, CertificateTask, by_detector
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.ground_truth.labels import FrameLabels

_SEED = 42


def summarise(tasks: Sequence[CertificateTask], cells: Mapping[str, Row]) -> list[Row]:
    """
    Return a row for each detector on each sequence, in the order of the tasks.

    Parameters
    ----------
    tasks : sequence of CertificateTask
    cells : mapping
        Key of a task to its cell.

    Returns
    -------
    list of dict
        ``sequence, target, defences, changed, told_by, nodes, budget``; ``certify_ms``, processor
        time of a certificate; ``classes``: of each, ``frames``, how many are ``right``, and how
        many are ``certified`` by the number of flips; ``accuracy``, balanced over the classes,
        by the number of flips (None without one of them), and the interval of its last, ``ci95``.

    """
    return [_summary(group[0], [cells[task.key] for task in group])
            for group in by_detector(tasks)]


def _summary(task: CertificateTask, cells: Sequence[Row]) -> Row:
    labels = task.stream.labels
    frames, right, certified = (np.concatenate([cell[name] for cell in cells])
                                for name in ('frames', 'right', 'certified'))
    classes = {name: _counts(right[of], certified[of], task.budget)
               for name, value in CLASSES.items() for of in [labels.kind[frames] == value]}
    row = {name: cells[0][name] for name in
           ('sequence', 'target', 'defences', 'changed', 'told_by', 'nodes', 'budget')}
    interval = _interval(labels, frames, certified >= task.budget)
    return {**row, 'certify_ms': 1e3 * sum(cell['certify_s'] for cell in cells) / len(frames),
            'classes': classes, 'accuracy': _accuracy(classes, task.budget),
            'ci95': None if interval is None else list(interval)}


def _counts(right: NDArray[np.bool_], certified: NDArray[np.int64], budget: int
            ) -> dict[str, Any]:
    holds = certified[:, None] >= np.arange(budget + 1)
    return {'frames': len(right), 'right': int(right.sum()),
            'certified': holds.sum(axis=0).tolist()}


def _accuracy(classes: Mapping[str, Mapping[str, Any]], budget: int) -> list[float | None]:
    if not all(found['frames'] for found in classes.values()):
        return [None] * (budget + 1)
    shares = [np.array(found['certified']) / found['frames'] for found in classes.values()]
    mean: list[float | None] = np.mean(shares, axis=0).tolist()
    return mean


def _interval(labels: FrameLabels, frames: NDArray[np.int64], holds: NDArray[np.bool_]
              ) -> intervals.Interval | None:
    size = np.zeros((len(CLASSES), len(labels.kind)), np.int64)
    total = np.zeros_like(size)
    for row, value in enumerate(CLASSES.values()):
        of = labels.kind[frames] == value
        size[row, frames[of]] = 1
        total[row, frames[of]] = holds[of]
    return intervals.class_mean_interval(
        size, total, intervals.block_frames(labels.stamp_ns), _SEED)
