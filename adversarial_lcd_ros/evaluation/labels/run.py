# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A results folder of labels: counts, the trajectory, pairs to look at."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from adversarial_lcd_ros.config import BuilderConfig, LabelConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.labels.check import check_labels
from adversarial_lcd_ros.evaluation.labels.page import PicturePair, write_page
from adversarial_lcd_ros.evaluation.outcomes import FRAME_KINDS
from adversarial_lcd_ros.evaluation.results import SUMMARY, ResultsFolder, summary_document
from adversarial_lcd_ros.graph_sequences.opening import holds_graphs, open_graphs
from adversarial_lcd_ros.ground_truth.labelling import Labelled, Views, label_views
from adversarial_lcd_ros.ground_truth.labels import POSITIVE, FrameLabels
from adversarial_lcd_ros.poses.trajectory import Trajectory, nearest_in_time
from adversarial_lcd_ros.sequences import Sequence as CameraSequence
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.sequences.part import SequencePart
from adversarial_lcd_ros.sequences.sequence import Progress

KIND, SCHEMA = 'labels', 1
_LOOKED_AT = 4  # kinds of which pairs are shown: the first ones
_PAIRS_OF_A_KIND = 6


@dataclass(frozen=True, eq=False)
class Opened:
    """Frames to label, with their pictures where the source has any."""

    name: str
    views: Views
    pictures: CameraSequence | None


def open_views(source: str) -> Opened:
    """
    Open a sequence to label; graphs are not built.

    Parameters
    ----------
    source : str
        As for ``open_graphs``.

    Raises
    ------
    SequenceError, EvaluationError
        It cannot be opened, or has no ground truth.

    """
    part = SequencePart.parse(source)
    if holds_graphs(part.path):
        graphs = open_graphs(source, BuilderConfig())
        trajectory = _known(graphs.trajectory, source, 'no ground truth')
        views = Views(np.array([graph.stamp_ns for graph in graphs.graphs], np.int64),
                      graphs.image_size, trajectory, part.path, graphs.graphs)
        return Opened(graphs.name, views, None)
    sequence = open_sequence(part.path)
    numbers = part.numbers(sequence.frame_count)
    views = Views(sequence.stamps_ns[numbers.start:numbers.stop], sequence.image_size,
                  _known(sequence.trajectory, source, str(sequence.coverage)), part.path)
    return Opened(sequence.name, views, None if sequence.detections else sequence)


def _known(trajectory: Trajectory | None, source: str, reason: str) -> Trajectory:
    if trajectory is None:
        raise EvaluationError(f'{source}: {reason}; by it loops are known: name it with '
                              '--ground-truth, or go on without labels: "adversarial-lcd '
                              'evaluate" then counts the decisions that change')
    return trajectory


def write_labels(source: str, output: Path, config: LabelConfig, *, check: bool = False,
                 command_line: Sequence[str] = (), progress: Progress | None = None
                 ) -> dict[str, Any]:
    """
    Label a sequence, write the results folder, and return its summary.

    Parameters
    ----------
    source : str
        As for ``open_graphs``.
    output : Path
        Folder, made if it is missing; what is in it is written anew.
    config : LabelConfig
    check : bool
        Hold the audit against the exact co-visibility beside the sequence.
    command_line : sequence of str
        Kept with the results.
    progress : callable, optional
        Called with frames done and to do.

    """
    opened = open_views(source)
    found = label_views(opened.views, config, progress)
    row = {'sequence': opened.name, **_counts(found)}
    if check:
        row['check'] = check_labels(opened.views, config, progress)
    summary = summary_document(KIND, SCHEMA, [row])
    output.mkdir(parents=True, exist_ok=True)
    folder = ResultsFolder(output)
    folder.write_setup([config], command_line, 0)
    folder.write_json(SUMMARY, summary)
    trajectory = opened.views.trajectory
    write_page(output, row, found.labels, trajectory,
               _pictures(opened, pairs_to_look_at(found.labels, trajectory)))
    return summary


def _counts(found: Labelled) -> dict[str, Any]:
    labels = found.labels
    lower = np.tril(np.ones_like(labels.possible), -1)
    old = np.arange(len(labels.kind))[None, :] < labels.candidates[:, None]
    words = Counter(labels.names)
    return {'frames': len(labels.kind), 'told_by': labels.told_by,
            'focal_length': found.focal_length, 'focal_from': found.focal_from,
            **{kind: words[kind] for kind in FRAME_KINDS},
            'loop_pairs': int((lower & (labels.relation == POSITIVE)).sum()),
            'pairs': int(old.sum()), 'right_pairs': int((labels.possible & old).sum()),
            'scaled_pairs': int((labels.scaled & old).sum()),
            'wrong_pairs': int((labels.elsewhere & old).sum())}


def pairs_to_look_at(labels: FrameLabels,
                     trajectory: Trajectory) -> list[tuple[str, int, int]]:
    """
    Return pairs (kind, frame, older frame) worth a look, spread over time.

    A frame is shown with a frame that it makes a loop with, or with the furthest one of a change
    of scale; any other with the older one that was taken nearest to it.
    """
    place = trajectory.position[nearest_in_time(trajectory.stamp_ns, labels.stamp_ns)]
    names = np.array(labels.names)
    chosen = []
    for kind in FRAME_KINDS[:_LOOKED_AT]:
        frames = np.flatnonzero(names == kind)
        at = np.linspace(0, len(frames) - 1, min(_PAIRS_OF_A_KIND, len(frames))).astype(int)
        for frame in frames[at].tolist():
            old = np.arange(labels.candidates[frame])
            fitting = {'positive': labels.relation[frame, old] == POSITIVE,
                       'scale': labels.scaled[frame, old]}.get(kind)
            among = old if fitting is None else old[fitting]
            apart = np.linalg.norm(place[among] - place[frame], axis=1)
            telling = np.argmax(apart) if kind == 'scale' else np.argmin(apart)
            chosen.append((kind, frame, int(among[telling])))
    return chosen


def _pictures(opened: Opened, pairs: Iterable[tuple[str, int, int]]) -> list[PicturePair]:
    if opened.pictures is None:
        return []
    pairs = list(pairs)
    stamps = opened.views.stamp_ns
    wanted = {int(stamps[frame]) for pair in pairs for frame in pair[1:]}
    image = {frame.stamp_ns: frame.image() for frame in opened.pictures.frames()
             if frame.stamp_ns in wanted}
    return [PicturePair(kind, frame, other, image[int(stamps[frame])], image[int(stamps[other])])
            for kind, frame, other in pairs]
