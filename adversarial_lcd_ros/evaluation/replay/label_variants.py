# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether a conclusion hangs on the thresholds of the labels: decisions, labelled anew."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from adversarial_lcd_ros.config import LabelConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.evaluation.metrics import balanced_accuracy, effect
from adversarial_lcd_ros.evaluation.outcomes import Outcomes, outcomes
from adversarial_lcd_ros.evaluation.replay.records import CLEAN, QueryRecord, column, runs_of
from adversarial_lcd_ros.files.writing import write_csv
from adversarial_lcd_ros.ground_truth.labels import (
    NEGATIVE,
    NO_MATCH,
    POSITIVE,
    RIGHT,
    UNTOLD,
    FrameLabels,
)

SWEEP = 'label_sweep.csv'
# One threshold at a time, the others as they are.
_GRID: Mapping[str, tuple[float, ...]] = {
    'positive_overlap': (0.45, 0.5, 0.7, 0.8), 'possible_overlap': (0.2, 0.3, 0.5),
    'loop_share': (0.4, 0.7), 'elsewhere_share': (0.05, 0.2),
    'min_gap_s': (4.0, 12.0, 16.0), 'positive_distance_m': (0.3, 1.0),
    'positive_angle_deg': (15.0, 40.0)}


def label_variants(base: LabelConfig) -> Iterator[tuple[str, LabelConfig]]:
    """Yield settings by what differs from the base, the base first; impossible ones left out."""
    yield 'as set', base
    for name, values in _GRID.items():
        for value in values:
            if value != getattr(base, name):
                try:
                    yield f'{name} = {value:g}', LabelConfig.from_mapping(
                        {**asdict(base), name: value})
                except ConfigError:
                    continue  # such as a loop that would be no possible match
    other = 'distance' if base.rule == 'overlap' else 'overlap'
    yield f'rule = {other}', replace(base, rule=other)


def sweep_labels(records: Sequence[QueryRecord], label: Callable[[LabelConfig], FrameLabels],
                 base: LabelConfig) -> list[dict[str, Any]]:
    """
    Return the figures of every run under every variant of the labels.

    Parameters
    ----------
    records : sequence of QueryRecord
        Of the clean run and the attacks.
    label : callable
        Returns the labels of the frames by some settings.
    base : LabelConfig

    Returns
    -------
    list of dict
        labels (what differs), run, positives, negatives, balanced_accuracy, decline_pp,
        suppressed, invented, and all settings; None where a class is empty.

    """
    runs = runs_of(records)
    rows = []
    for title, config in label_variants(base):
        labels = label(config)
        outcome = {name: _outcomes(labels, run) for name, run in runs.items()}
        for name, found in outcome.items():
            change = effect(labels.kind, outcome[CLEAN], found)
            rows.append({
                'labels': title, 'run': name, 'positives': int((labels.kind == POSITIVE).sum()),
                'negatives': int((labels.kind == NEGATIVE).sum()),
                'balanced_accuracy': balanced_accuracy(labels.kind, found),
                'decline_pp': change.decline_pp, 'suppressed': change.suppressed,
                'invented': change.invented, **asdict(config)})
    return rows


def write_sweep(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write the rows as CSV."""
    write_csv(path, list(rows[0]), rows)


def _outcomes(labels: FrameLabels, run: Sequence[QueryRecord]) -> Outcomes:
    match = np.array([NO_MATCH if record.match_frame is None else record.match_frame
                      for record in run], np.int64)
    match_is = labels.judge(np.arange(len(match)), match)
    return outcomes(labels.kind, column(run, 'is_loop').astype(bool), match_is == RIGHT,
                    match_is != UNTOLD)
