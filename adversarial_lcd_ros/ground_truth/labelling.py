"""Labels of a sequence by the best evidence that there is (docs/evaluation.md)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from adversarial_lcd_ros.config import LabelConfig
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.ground_truth.covisibility import find_covisibility, read_covisibility
from adversarial_lcd_ros.ground_truth.evidence import Evidence, from_shares
from adversarial_lcd_ros.ground_truth.labels import FrameLabels, label_frames

if TYPE_CHECKING:
    from adversarial_lcd_ros.sequences import Trajectory


def label_graphs(graphs: Sequence[MultiTierGraph], trajectory: Trajectory, source: Path,
                 config: LabelConfig) -> FrameLabels:
    """
    Label the frames of a sequence.

    Parameters
    ----------
    graphs : sequence of MultiTierGraph
        One a frame, in order of time, at least one.
    trajectory : Trajectory
        Ground truth.
    source : Path
        What the sequence was opened from: evidence is looked for in it, or beside it.
    config : LabelConfig

    Raises
    ------
    EvaluationError
        The evidence is damaged or of another sequence; or see ``label_frames``.

    """
    return label_frames(trajectory, [graph.stamp_ns for graph in graphs],
                        (graphs[0].width, graphs[0].height), config,
                        _evidence(graphs, source, config))


def _evidence(graphs: Sequence[MultiTierGraph], source: Path,
              config: LabelConfig) -> Evidence | None:
    path = find_covisibility(source) if config.rule == 'auto' else None
    if path is None:
        return None
    stamps = np.array([graph.stamp_ns for graph in graphs], np.int64)
    return from_shares(read_covisibility(path).shares(stamps), config)
