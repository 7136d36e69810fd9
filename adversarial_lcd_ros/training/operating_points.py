# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Where a trained decision may draw its line: operating points, told by the loops of the training.

Random pairs tell little of it: other places are far from loops there, and any line between them
is as good. Taken are the loops as a detector meets them: frame after frame, over a growing map,
the best of its candidates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LabelConfig, LcdConfig
from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.ground_truth.labelling import label_graphs
from adversarial_lcd_ros.ground_truth.labels import POSITIVE, FrameLabels
from adversarial_lcd_ros.lcd.decision import KEPT_PERCENT, Decision
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.sequences.sequence import Progress
from adversarial_lcd_ros.training.decisions import TrainingSequence

_CARD_PERCENT = (100, 99, 95, 90, 75, 50)
_ROUNDING = 1e-9


def met_loops(graphs: Sequence[MultiTierGraph], labels: FrameLabels, lcd: LcdConfig
              ) -> NDArray[np.float64]:
    """
    Return the log odds of the loops that a detector could find in a replay, shape (k,).

    These are frames with a loop of which the best candidate is a right match; others are lost
    wherever the line is drawn.

    Parameters
    ----------
    graphs : sequence of MultiTierGraph
        In order of time.
    labels : FrameLabels
        Of the same frames.
    lcd : LcdConfig
        Of the detector.

    """
    detector = LoopClosureDetector(lcd)
    found = []
    for frame, graph in enumerate(graphs):
        logits = detector.log_odds(graph)
        if len(logits) and labels.kind[frame] == POSITIVE:
            best = int(logits.argmax())
            if labels.is_correct([frame], [detector.query_nodes(graph).candidates[best]])[0]:
                found.append(float(logits[best]))
        detector.remember(graph)
    return np.array(found)


def operating_points(loops: Sequence[NDArray[np.float64]]) -> tuple[float, ...]:
    """
    Return the largest log odds down to which 50, 51, ... 100 percent of the loops are kept.

    Parameters
    ----------
    loops : sequence of float64 (k,)
        Log odds of the loops of each sequence. Sequences weigh the same, whatever their numbers
        of loops; those without one are left out.

    Raises
    ------
    ModelError
        There is no loop at all.

    """
    seen = [odds for odds in loops if len(odds)]
    if not seen:
        raise ModelError('no frame of the training sequences has a right match as its best '
                         'candidate: expected loops that the target can tell from other places')
    odds = np.concatenate(seen)
    weight = np.concatenate([np.full(len(own), 1 / (len(own) * len(seen))) for own in seen])
    falling = np.argsort(-odds, kind='stable')
    kept = np.cumsum(weight[falling])
    place = np.searchsorted(kept, np.array(KEPT_PERCENT) / 100 - _ROUNDING)
    return tuple(float(value) for value in odds[falling][np.minimum(place, len(odds) - 1)])


def meet_loops(sequences: Sequence[TrainingSequence], lcd: LcdConfig, labels: LabelConfig,
               progress: Progress) -> list[NDArray[np.float64]]:
    """
    Return the log odds of the loops that a detector meets in each training sequence, (k,) each.

    Parameters
    ----------
    sequences : sequence of TrainingSequence
    lcd : LcdConfig
        Of the detector, with the decision as it was fitted; its gap is that of the labels.
    labels : LabelConfig
        What counts as a loop.
    progress : callable
        Called with sequences done and to do.

    """
    lcd = replace(lcd, min_gap_s=labels.min_gap_s)
    found = []
    for done, part in enumerate(sequences, 1):
        truth = label_graphs(part.graphs, part.trajectory, part.source, labels)
        found.append(met_loops(part.graphs, truth, lcd))
        progress(done, len(sequences))
    return found


def with_operating_points(decision: Decision, loops: Sequence[NDArray[np.float64]],
                          min_gap_s: float) -> Decision:
    """
    Return a decision with its operating points, told on its card, too.

    Parameters
    ----------
    decision : Decision
    loops : sequence of float64 (k,)
        See ``operating_points``.
    min_gap_s : float
        Least age of a candidate when they were met, seconds.

    """
    points = operating_points(loops)
    told: dict[str, Any] = {
        'chosen_by': 'lcd.kept_loops: share of the loops below that the decision keeps',
        'loops': [len(odds) for odds in loops], 'min_gap_s': min_gap_s,
        'log_odds': {f'{percent / 100:.2f}': points[KEPT_PERCENT.index(percent)]
                     for percent in _CARD_PERCENT}}
    return replace(decision, operating_points=points,
                   card={**decision.card, 'operating_points': told})
