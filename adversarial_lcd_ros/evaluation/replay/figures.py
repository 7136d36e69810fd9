# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""From what went over the wire to records and figures, whether we replayed it or others did."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from adversarial_lcd_ros.config import AttackConfig, LabelConfig, LcdConfig
from adversarial_lcd_ros.evaluation.replay.behind import ask_check
from adversarial_lcd_ros.evaluation.replay.processes import Recording
from adversarial_lcd_ros.evaluation.replay.records import (
    CLEAN,
    AttackRun,
    QueryRecord,
    make_records,
)
from adversarial_lcd_ros.evaluation.replay.summary import GraphStatistics, summarise
from adversarial_lcd_ros.evaluation.replay.unexplained import unexplained_edges
from adversarial_lcd_ros.graph_sequences.opening import GraphSequence
from adversarial_lcd_ros.ground_truth.labelling import label_graphs
from adversarial_lcd_ros.ground_truth.labels import FrameLabels, unlabelled
from adversarial_lcd_ros.sequences import Sequence as CameraSequence


def label_run(sequence: CameraSequence | GraphSequence, clean: Recording,
              config: LabelConfig) -> FrameLabels:
    """Return the labels of the frames of the clean run; without ground truth none is scored."""
    if sequence.trajectory is None:
        return unlabelled([graph.stamp_ns for graph in clean.clean])
    return label_graphs(clean.clean, sequence.trajectory, sequence.source, config)


def make_figures(name: str, labels: FrameLabels, clean: Recording, runs: Mapping[str, Recording],
                 attacks: Mapping[str, AttackConfig | None], lcd: LcdConfig, seed: int, *,
                 reported: bool = True) -> tuple[list[QueryRecord], dict[str, Any]]:
    """
    Return the records of all runs, and what they come to (``summarise``).

    Parameters
    ----------
    name : str
        Of the sequence.
    labels : FrameLabels
    clean : Recording
        The run without an attack.
    runs, attacks : mapping
        Recording and settings of every attack by the name of its run; None for settings that
        nobody knows.
    lcd : LcdConfig
        Of the detector.
    seed : int
        Of the bootstrap.
    reported : bool
        The attacker reported on its work; else reports hold what the graphs tell of it.

    Raises
    ------
    EvaluationError
        See ``make_records``.

    """
    records = make_records(labels, clean.decisions, {
        run: AttackRun(recording.decisions, recording.reports, reported)
        for run, recording in runs.items()})
    sent = {CLEAN: clean.clean, **{run: recording.forwarded for run, recording in runs.items()}}
    records = ask_check(records, sent, lcd)
    summary = summarise(name, records, attacks, GraphStatistics.of(
        [graph.node_count for graph in clean.clean],
        [graph.edge_count for graph in clean.clean]), seed, lcd, told_by=labels.told_by)
    summary['unexplained_edges'] = unexplained_edges(sent, lcd)
    return records, summary
