# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Train the decision of a target on sequences with ground truth.

Sequences and classes weigh the same, whatever their numbers of pairs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from adversarial_lcd_ros.attack.memory import Memory
from adversarial_lcd_ros.attack.oracle import answer_logit
from adversarial_lcd_ros.attack.perturbations import Allowed, make_perturbation
from adversarial_lcd_ros.attack.surrogate_data import SurrogateData
from adversarial_lcd_ros.config import AttackConfig, LabelConfig, LcdConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.ground_truth.labelling import label_graphs
from adversarial_lcd_ros.ground_truth.pairs import sample_pairs
from adversarial_lcd_ros.lcd.decision import Decision
from adversarial_lcd_ros.lcd.defences import make_defences
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.scoring import Scoring, prepared
from adversarial_lcd_ros.messages.types import LcdQuery
from adversarial_lcd_ros.sequences.sequence import Progress
from adversarial_lcd_ros.training.networks import make_trainer
from adversarial_lcd_ros.training.pair_scores import (
    LabelledPairs,
    fit_decision,
    retrieved_pairs,
)
from adversarial_lcd_ros.weisfeiler_lehman.continuous import flip_features, node_features

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
    source : Path
        What the sequence was opened from.

    """

    name: str
    graphs: Sequence[MultiTierGraph]
    trajectory: Trajectory
    source: Path


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
    found = label_graphs(graphs, sequence.trajectory, sequence.source, labels)
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
                   labels: LabelConfig, pairs: int, seed: int, network: Path,
                   train_network: bool = True, progress: Progress | None = None) -> Decision:
    """
    Return a decision for a target, with its card.

    Parameters
    ----------
    target : str
        Name of the target.
    sequences : sequence of TrainingSequence
    lcd : LcdConfig
        Its map window, and its defences: the decision is fitted behind them.
    labels : LabelConfig
        What counts as a loop.
    pairs : int
        Most loops and random other pairs of a sequence.
    seed : int
    network : Path
        Where the network of a target that has one is written.
    train_network : bool
        Otherwise it is there already.
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
    lcd = replace(lcd, target=target)
    trainer = make_trainer(target) if train_network else None
    if not train_network:
        card['network'] = {'reused': True}
    if trainer:
        defences = make_defences(lcd)
        seen = [replace(pairs, graphs=[prepared(graph, defences) for graph in pairs.graphs])
                for pairs in drawn]
        card['network'] = trainer.train(seen, network, seed, progress)
    return fit_decision(Scoring.of(lcd, network), drawn, lcd.map_window, progress, card)


def collect_surrogate_data(graphs: Sequence[MultiTierGraph], lcd: LcdConfig, attack: AttackConfig,
                           flips_per_frame: int, progress: Progress | None = None
                           ) -> SurrogateData:
    """
    Return what an attacker learns by querying a detector on a stream of its own.

    Parameters
    ----------
    graphs : sequence of MultiTierGraph
        Training stream, in order of time; not one that is attacked later.
    lcd : LcdConfig
        The detector that answers.
    attack : AttackConfig
        Its perturbation proposes the flips.
    flips_per_frame : int
        Flips queried on every frame; the clean graph costs one query more.
    progress : callable, optional
        Called with frames done and to do.

    """
    detector, memory = LoopClosureDetector(lcd), Memory()
    perturbation = make_perturbation(attack.perturbation)
    features, gains, loops, word_score, word_loop = [], [], [], [], []
    for done, graph in enumerate(graphs):
        answer = detector.answer(LcdQuery(0, graph))
        similar = memory.similar(graph, 1)
        if similar:
            side = -1.0 if answer.is_loop else 1.0
            pairs = perturbation.propose(graph, flips_per_frame, Allowed(attack.edits),
                                         np.random.default_rng((attack.seed, done)))
            logits = [answer_logit(detector.answer(LcdQuery(0, graph.flip(pair))))
                      for pair in pairs]
            gains += [side * (logit - answer_logit(answer)) for logit in logits]
            features.append(flip_features(graph, node_features(graph), pairs,
                                          attack.wl_iterations))
            loops += [answer.is_loop] * len(pairs)
            word_score.append(similar[0][1])
            word_loop.append(answer.is_loop)
        detector.detect(graph)
        memory.add(graph)
        if progress:
            progress(done + 1, len(graphs))
    if not features:
        raise EvaluationError(f'{len(graphs)} graphs: none came eight seconds after another')
    return SurrogateData(np.concatenate(features).astype(np.float32).astype(np.float64),
                         np.array(gains), np.array(loops), np.array(word_score),
                         np.array(word_loop))
