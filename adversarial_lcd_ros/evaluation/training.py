"""Train the decision of a target on sequences with ground truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from adversarial_lcd_ros.config import LabelConfig, LcdConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.labels import label_frames
from adversarial_lcd_ros.evaluation.pairs import sample_pairs
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.decision import Decision
from adversarial_lcd_ros.lcd.training import LabelledPairs, Progress, fit_decision, retrieved_pairs

if TYPE_CHECKING:
    from adversarial_lcd_ros.sequences import Trajectory

RETRIEVED_PER_FRAME = 3


@dataclass(frozen=True)
class TrainingSequence:
    """
    One sequence, or the part of it that may be trained on.

    Attributes
    ----------
    name : str
        Sequence, part and licence, for the model card.
    graphs : sequence of MultiTierGraph
        In order of time.
    trajectory : Trajectory
        Ground truth.

    """

    name: str
    graphs: Sequence[MultiTierGraph]
    trajectory: Trajectory


def training_pairs(sequence: TrainingSequence, labels: LabelConfig, count: int,
                   rng: np.random.Generator) -> LabelledPairs:
    """
    Return loops, random pairs of different places, and those that words confuse.

    Parameters
    ----------
    sequence : TrainingSequence
    labels : LabelConfig
    count : int
        Most loops, and most random pairs of different places.
    rng : numpy.random.Generator

    """
    graphs = sequence.graphs
    found = label_frames(sequence.trajectory, [graph.stamp_ns for graph in graphs],
                         (graphs[0].width, graphs[0].height), labels)
    lower = np.tril(found.relation, -1)
    available = min(int((lower == 1).sum()), int((lower == -1).sum()))
    if not available:
        raise EvaluationError(f'{sequence.name}: no loops, or no different places, to train on')
    pairs = sample_pairs(found.relation, rng, min(count, available))
    hard = retrieved_pairs(graphs, found.relation, round(labels.min_gap_s * 1e9),
                           RETRIEVED_PER_FRAME)
    return LabelledPairs(graphs, np.r_[pairs.query, hard[:, 0]],
                         np.r_[pairs.reference, hard[:, 1]],
                         np.r_[pairs.is_loop, np.zeros(len(hard), bool)])


def train_decision(target: str, sequences: Sequence[TrainingSequence], *, lcd: LcdConfig,
                   labels: LabelConfig, pairs: int, seed: int,
                   progress: Progress | None = None) -> Decision:
    """
    Return a decision for a target, with its card.

    Parameters
    ----------
    target : str
        Name of the target.
    sequences : sequence of TrainingSequence
    lcd : LcdConfig
        Its map window.
    labels : LabelConfig
        What counts as a loop.
    pairs : int
        Most loops and random other pairs of a sequence.
    seed : int
    progress : callable, optional
        Called with pairs done and to do.

    """
    rng = np.random.default_rng(seed)
    drawn = [training_pairs(sequence, labels, pairs, rng) for sequence in sequences]
    card: dict[str, object] = {
        'sequences': [{'name': sequence.name, 'frames': len(sequence.graphs),
                       'nodes_mean': float(np.mean([g.node_count for g in sequence.graphs])),
                       'loops': int(chosen.is_loop.sum()),
                       'others': int((~chosen.is_loop).sum())}
                      for sequence, chosen in zip(sequences, drawn, strict=True)],
        'map_window': lcd.map_window, 'labels': asdict(labels), 'seed': seed}
    return fit_decision(target, drawn, lcd.map_window, progress, card)
