# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
From sequences with ground truth to a folder of artefacts: ``adversarial-lcd train``.

Vocabulary, decisions and surrogate data belong together: ``--models FOLDER`` swaps all of them at
once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, replace
from pathlib import Path
import shutil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.memory import MIN_GAP_NS
from adversarial_lcd_ros.attack.surrogate_data import SurrogateData
from adversarial_lcd_ros.config import AttackConfig, BuilderConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.files.writing import write_json
from adversarial_lcd_ros.lcd.targets import needed_variant
from adversarial_lcd_ros.paths import SURROGATE_DATA, VOCABULARY
from adversarial_lcd_ros.registry import TARGETS
from adversarial_lcd_ros.sequences.part import SequencePart
from adversarial_lcd_ros.sequences.sequence import Progress
from adversarial_lcd_ros.training.cards import decision_card, sequence_card, versions_card
from adversarial_lcd_ros.training.decisions import (
    TrainingSequence,
    collect_surrogate_data,
    train_decision,
)
from adversarial_lcd_ros.training.model_folder import (
    MODEL_CARD,
    decision_file,
    file_digests,
    model_folder,
    network_file,
)
from adversarial_lcd_ros.training.networks import make_trainer, reused_network
from adversarial_lcd_ros.training.operating_points import meet_loops, with_operating_points
from adversarial_lcd_ros.training.plan import TrainingPlan
from adversarial_lcd_ros.training.sources import (
    TrainingFrames,
    one_licence_each,
    open_source,
)
from adversarial_lcd_ros.vision.builder import GraphBuilder
from adversarial_lcd_ros.vision.features import FeatureExtractor, to_grey
from adversarial_lcd_ros.vision.vocabulary import Vocabulary, train_vocabulary

FORMAT = 'adversarial_lcd_ros/model_card/1'
# Flips off a random walk are more varied than those of one ranking: a better sample to learn of.
SURROGATE_PERTURBATION = 'random_walk'

Stage = Callable[[str], AbstractContextManager[Progress]]


@contextmanager
def silent(_: str) -> Iterator[Progress]:
    """Show nothing of a stage."""
    yield lambda _done, _total: None


def train(sources: Sequence[SequencePart], output: Path, *, seed: int = 42,
          plan: TrainingPlan | None = None, stage: Stage = silent, overwrite: bool = False,
          command_line: Sequence[str] = (), licences: Sequence[str] = ()) -> dict[str, Any]:
    """
    Train vocabulary, decisions and surrogate data, and return their card.

    Written are vocabulary.npz, target_<name>.json, surrogate_data.npz and MODEL_CARD.json, all
    of them or none. Same sequences, plan and seed: same bytes (on one machine; another build of
    OpenCV, BLAS or the network may round otherwise).

    Parameters
    ----------
    sources : sequence of SequencePart
        At least one; the surrogate data come from the first.
    output : Path
        Folder of the artefacts.
    seed : int
        Of every random choice.
    plan : TrainingPlan, optional
    stage : callable, optional
        Given the title of a stage, returns a context that yields what is called with the work
        done and the whole.
    overwrite : bool
        Replace the artefacts of an earlier training.
    command_line : sequence of str, optional
        For the card.
    licences : sequence of str, optional
        Of the pictures of each sequence, in their order, for the card.

    Raises
    ------
    SequenceError
        A sequence cannot be read, or has no ground truth; or licences are not one for each.
    EvaluationError
        A sequence has no loops, no different places, or is too short. Found before the work.
    ModelError
        There are too few descriptors for the words, the folder is taken, or the target gnn is
        asked for without PyTorch.

    """
    plan = plan or TrainingPlan()
    with model_folder(output, overwrite=overwrite) as work:
        opened = _open_all(sources, licences, plan)
        vocabulary = _write_vocabulary(opened, plan, seed, work / VOCABULARY, stage)
        builder = replace(plan.builder, vocabulary=str(work / VOCABULARY))
        graphs = {variant: [_build_graphs(source, builder, variant, stage) for source in opened]
                  for variant in dict.fromkeys(map(needed_variant, plan.targets))}
        sequences = graphs[needed_variant(plan.targets[0])]
        targets = _write_decisions(graphs, plan, seed, work, stage)
        surrogate = _write_surrogate_data(sequences[0], plan, seed, work, stage)
        card = {
            'format': FORMAT, 'seed': seed, 'command_line': list(command_line),
            'sequences': [sequence_card(source, sequence)
                          for source, sequence in zip(opened, sequences, strict=True)],
            'vocabulary': vocabulary, 'targets': targets, 'surrogate_data': surrogate,
            'settings': {'builder': asdict(plan.builder), 'labels': asdict(plan.labels),
                         'lcd': asdict(plan.lcd), 'pairs': plan.pairs},
            'files': file_digests(work),
            **versions_card()}
        write_json(work / MODEL_CARD, card)
    return card


def _open_all(sources: Sequence[SequencePart], licences: Sequence[str],
              plan: TrainingPlan) -> list[TrainingFrames]:
    """Open and check everything before the first minute of work."""
    if not sources:
        raise EvaluationError('no sequence to train on: expected at least one')
    for target in plan.targets:
        if plan.networks:
            reused_network(target, plan.networks)
        else:
            make_trainer(target)
    opened = [open_source(source, licence) for source, licence in
              zip(sources, one_licence_each(sources, licences), strict=True)]
    for source in opened:
        source.check_labels(plan.labels)
    stamps = opened[0].stamps_ns
    if plan.flips_per_frame and stamps[-1] - stamps[0] < MIN_GAP_NS:
        raise EvaluationError(
            f'{opened[0].name} lasts {(stamps[-1] - stamps[0]) / 1e9:.1f} s: the surrogate data '
            f'of the first sequence need revisits after {MIN_GAP_NS / 1e9:g} s; put a longer '
            'one first, or ask for 0 flips a frame')
    return opened


def _write_vocabulary(opened: Sequence[TrainingFrames], plan: TrainingPlan, seed: int,
                      path: Path, stage: Stage) -> dict[str, Any]:
    if plan.builder.vocabulary:
        given = Path(plan.builder.vocabulary)
        known = Vocabulary.load(given)
        shutil.copyfile(given, path)
        return {'reused': given.name, 'words': len(known.idf)}
    descriptors: list[NDArray[np.uint8]] = []
    extractor = FeatureExtractor(plan.builder.detected_features, plan.builder.fast_threshold)
    for source in opened:
        frames = range(0, len(source.numbers), plan.vocabulary_stride)
        with stage(f'features of {source.sequence.name}') as progress:
            for frame in _counted(source.frames(plan.vocabulary_stride), len(frames), progress):
                descriptors.append(extractor.extract(to_grey(frame.image())).descriptor)
    with stage('vocabulary') as progress:
        train_vocabulary(descriptors, plan.branching, plan.depth, seed).save(path)
        progress(1, 1)
    return {'words': plan.branching ** plan.depth, 'branching': plan.branching,
            'depth': plan.depth, 'frames': len(descriptors), 'stride': plan.vocabulary_stride,
            'descriptors': sum(map(len, descriptors))}


def _build_graphs(source: TrainingFrames, config: BuilderConfig, variant: str, stage: Stage
                  ) -> TrainingSequence:
    config = replace(config, graph_variant=variant or config.graph_variant)
    with stage(f'graphs of {source.sequence.name}') as progress, GraphBuilder(config) as builder:
        graphs = [builder.build(frame.image(), frame.stamp_ns, sequence=number)
                  for number, frame in zip(source.numbers, _counted(
                      source.frames(), len(source.numbers), progress), strict=True)]
    return TrainingSequence(f'{source.name} ({source.licence})', graphs, source.trajectory,
                            source.source.path)


def _write_decisions(graphs: Mapping[str, Sequence[TrainingSequence]], plan: TrainingPlan,
                     seed: int, work: Path, stage: Stage) -> dict[str, Any]:
    card = {}
    for target in plan.targets:
        name = TARGETS.find(target).name
        reused = plan.networks and reused_network(target, plan.networks)
        if reused:
            shutil.copyfile(reused, work / network_file(name))
        with stage(f'decision of {target}') as progress:
            decision = train_decision(target, graphs[needed_variant(target)], lcd=plan.lcd,
                                      labels=plan.labels, pairs=plan.pairs, seed=seed,
                                      network=work / network_file(name),
                                      train_network=not reused, progress=progress)
        path = work / decision_file(name)
        decision.save(path)  # where the detector that meets the loops finds it
        with stage(f'operating points of {target}') as progress:
            met = meet_loops(graphs[needed_variant(target)],
                             replace(plan.lcd, target=target, model=str(work)), plan.labels,
                             progress)
        decision = with_operating_points(decision, met, plan.labels.min_gap_s)
        decision.save(path)
        card[target] = {**decision_card(decision), 'graph_variant':
                        needed_variant(target) or plan.builder.graph_variant}
    return card


def _write_surrogate_data(sequence: TrainingSequence, plan: TrainingPlan, seed: int, work: Path,
                          stage: Stage) -> dict[str, Any] | None:
    if not plan.flips_per_frame:
        return None
    target = plan.targets[0]
    lcd = replace(plan.lcd, target=target, model=str(work))
    attack = AttackConfig(perturbation=SURROGATE_PERTURBATION, seed=seed)
    with stage('surrogate data') as progress:
        data: SurrogateData = collect_surrogate_data(sequence.graphs, lcd, attack,
                                                     plan.flips_per_frame, progress)
    bound = data.loop_bound()  # also sees that the attacker will be able to use them
    data.save(work / SURROGATE_DATA)
    return {'sequence': sequence.name, 'target': target, 'attack': asdict(attack),
            'flips_per_frame': plan.flips_per_frame, 'frames': len(data.word_score),
            'flips': len(data.gain), 'loops': int(data.word_loop.sum()), 'loop_bound': bound}


def _counted(frames: Iterable[Any], total: int, progress: Progress) -> Iterator[Any]:
    for done, frame in enumerate(frames, 1):
        yield frame
        progress(done, total)
