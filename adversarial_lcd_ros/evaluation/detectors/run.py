# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What a detector is worth before any attack: every target, on pairs and live.

Pairs are the paper's "accuracy": as many loops as other places, judged one by one. Live, every
frame of a replay is judged against the keyframes before it, retrieval by words included.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LabelConfig, LcdConfig
from adversarial_lcd_ros.environment import code_digest
from adversarial_lcd_ros.evaluation import intervals
from adversarial_lcd_ros.evaluation.digests import model_digests
from adversarial_lcd_ros.evaluation.metrics import Metrics, first_closure_latency_s, measure
from adversarial_lcd_ros.evaluation.outcomes import outcomes, right, told_kind
from adversarial_lcd_ros.evaluation.replay.offline import run_offline
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.evaluation.streams import Stream, load_stream_graphs
from adversarial_lcd_ros.files.digests import digest_of
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.ground_truth.labels import (
    ELSEWHERE,
    NEGATIVE,
    NO_MATCH,
    POSITIVE,
    RIGHT,
    UNTOLD,
    FrameLabels,
)
from adversarial_lcd_ros.ground_truth.pairs import sample_pairs
from adversarial_lcd_ros.lcd.scoring import Judge
from adversarial_lcd_ros.lcd.targets import decision_path
from adversarial_lcd_ros.training.model_folder import trained_on
from adversarial_lcd_ros.training.pair_scores import LabelledPairs, PairScorer

# Of the row's columns; a change in the code below makes rows again by itself.
KIND, SCHEMA = 'targets', 5
_CODE = ('lcd', 'graph', 'edge_rule', 'weisfeiler_lehman', 'keyframes', 'compiled', 'messages',
         'ground_truth/pairs', 'training/pair_scores', 'evaluation/metrics', 'evaluation/outcomes',
         'evaluation/intervals', 'evaluation/replay/offline', 'evaluation/detectors/run')
PROTOCOLS = ('pairs', 'live')

_FIGURES = ('positives', 'negatives', 'balanced_accuracy', 'average_precision',
            'recall_at_100_precision', 'mcc', 'precision', 'recall')
# What the columns of a row hold, for whoever reads rows that another run has written.
ROW_COLUMNS: Mapping[str, tuple[type, ...]] = {
    **dict.fromkeys(('sequence', 'target', 'protocol'), (str,)),
    **dict.fromkeys(('nodes', 'nodes_mean', 'frames'), (int, float)),
    **dict.fromkeys(_FIGURES, (int, float, type(None))),
    **dict.fromkeys(('trained_on', 'references_trained_on'), (bool, type(None))),
    'scored': (list,), 'geometric_check': (bool,), 'ci95': (list, type(None)), 'labels': (dict,)}


@dataclass(frozen=True, eq=False)
class TargetTask:
    """
    A target on a sequence by one protocol.

    Attributes
    ----------
    stream : Stream
    target : str
    protocol : str
        'pairs' or 'live'.
    lcd : LcdConfig
        Of the detector, but for its target.
    pairs : int
        Most loops, and as many pairs of different places, of a draw.
    seeds : tuple of int
        One draw of pairs each.
    scored : (float, float)
        From and to which fraction of the frames queries are scored; the others are map only.
    label_config : LabelConfig
        What the stream was labelled with.

    """

    stream: Stream
    target: str
    protocol: str
    lcd: LcdConfig
    pairs: int
    seeds: tuple[int, ...]
    scored: tuple[float, float] = (0.0, 1.0)
    label_config: LabelConfig = LabelConfig()

    @property
    def key(self) -> str:
        """Digest of all that the figures depend on, hexadecimal."""
        values = {'schema': SCHEMA, 'code': code_digest(*_CODE),
                  'stream': self.stream.digest, 'protocol': self.protocol,
                  'detector': {**asdict(self.lcd), 'target': self.target},
                  'models': model_digests(self.model), 'seeds': self.seeds,
                  'scored': self.scored, 'labels': asdict(self.label_config)}
        if self.protocol == 'pairs':
            # The stream's digest is of what a replay needs, and knows nothing of pairs.
            values |= {'pairs': self.pairs,
                       'relation': digest_of(self.labels().relation.tobytes())}
        return digest_of(json.dumps(values, sort_keys=True).encode())

    @property
    def model(self) -> Path:
        """File of the trained decision."""
        return decision_path(self.lcd.model, self.target)

    def judge(self) -> Judge:
        """Return what judges as the detector does: target, decision, threshold and defences."""
        return Judge(replace(self.lcd, target=self.target))

    def labels(self) -> FrameLabels:
        """Return the labels, without queries outside the part that is scored."""
        labels = self.stream.labels
        frames = len(labels.kind)
        outside = np.ones(frames, bool)
        outside[int(frames * self.scored[0]):int(frames * self.scored[1])] = False
        relation = np.tril(labels.relation, -1)
        relation[outside] = 0
        return replace(labels, relation=relation,
                       kind=np.where(outside, 0, labels.kind).astype(np.int8))


def run_target(task: TargetTask) -> tuple[str, Row]:
    """
    Return the key of a task and its row.

    The row has ``sequence, target, protocol, nodes, nodes_mean, frames, scored, trained_on,
    references_trained_on, geometric_check, defences, changed, labels, labels_changed, told_by,
    positives, negatives, balanced_accuracy, ci95, average_precision, recall_at_100_precision,
    mcc, precision, recall``, and ``n_pairs, distinct_pairs, seeds`` or ``n_frames, wrong_matches,
    untold_matches, declared_elsewhere, latency_to_first_closure_s``, ``outcomes``, those of all
    frames between commas, and ``block``, the frames of one of the interval; labels are settings.
    Undefined figures are None, so all of a sequence without pairs of a class.
    """
    figures = _pairs(task) if task.protocol == 'pairs' else _live(task)
    stream = task.stream
    return task.key, {
        'sequence': stream.name, 'target': task.target, 'protocol': task.protocol,
        'nodes': stream.nodes, 'nodes_mean': stream.nodes_mean,
        'frames': len(stream.labels.kind), 'scored': list(task.scored),
        'trained_on': trained_on(task.model, stream.graphs.source, task.scored),
        'references_trained_on': trained_on(task.model, stream.graphs.source,
                                            (0.0, task.scored[1])),
        'geometric_check': task.lcd.geometric_check, 'defences': task.lcd.defences,
        'changed': ', '.join(filter(None, (
            task.lcd.changed('target', 'model', 'geometric_check', 'defences'),
            stream.graphs.builder.changed('features', 'model', 'vocabulary', 'detections')))),
        'labels_changed': task.label_config.changed(),
        'labels': asdict(task.label_config), 'told_by': stream.labels.told_by, **figures}


def _pairs(task: TargetTask) -> Row:
    labels, judge = task.labels(), task.judge()
    graphs = load_stream_graphs(task.stream.graphs)
    count = min(task.pairs, *(int((labels.relation == value).sum())
                              for value in (POSITIVE, NEGATIVE)))
    if not count:
        return {**_figures(None), 'n_pairs': 0, 'distinct_pairs': 0, 'seeds': 0, 'ci95': None}
    scorer = PairScorer(judge.scoring, graphs, task.lcd.map_window)
    draws = [sample_pairs(labels.relation, np.random.default_rng(seed), count)
             for seed in task.seeds]
    query, reference, is_loop = (np.concatenate([getattr(draw, name) for draw in draws])
                                 for name in ('query', 'reference', 'is_loop'))
    logit = judge.decision.logit(scorer.pairs(LabelledPairs(graphs, query, reference, is_loop)))
    kind = np.where(is_loop, POSITIVE, NEGATIVE).astype(np.int8)
    declared, probability = _verdicts(judge, logit, [
        (graphs[one], graphs[other]) for one, other in zip(query, reference, strict=True)])
    metrics = measure(kind, declared, probability, np.ones(len(kind), bool))
    return {**_figures(metrics), 'n_pairs': len(kind), 'seeds': len(task.seeds),
            'distinct_pairs': np.unique([query, reference], axis=1).shape[1],
            'ci95': _pair_interval(labels, query, kind, declared == is_loop)}


def _verdicts(judge: Judge, logit: NDArray[np.float64],
              pairs: Sequence[tuple[MultiTierGraph, MultiTierGraph]]
              ) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    verdicts = [judge.verdict(float(value), partial(judge.scoring.support, *pair))
                for value, pair in zip(logit, pairs, strict=True)]
    return (np.array([is_loop for is_loop, _ in verdicts], bool),
            np.array([chance for _, chance in verdicts]))


def _pair_interval(labels: FrameLabels, query: NDArray[np.int64], kind: NDArray[np.int8],
                   correct: NDArray[np.bool_]) -> list[float] | None:
    """Return the interval over blocks of query frames: pairs of one frame are near copies."""
    size = np.zeros((2, len(labels.kind)), np.int64)
    total = np.zeros_like(size)
    row = (kind == NEGATIVE).astype(np.int64)
    np.add.at(size, (row, query), 1)
    np.add.at(total, (row, query), correct)
    interval = intervals.class_mean_interval(
        size, total, intervals.block_frames(labels.stamp_ns), seed=0)
    return list(interval) if interval else None


def _live(task: TargetTask) -> Row:
    labels = task.labels()
    run, _ = run_offline(load_stream_graphs(task.stream.graphs),
                         replace(task.lcd, target=task.target))
    frame_of = {int(stamp): frame for frame, stamp in enumerate(labels.stamp_ns)}
    match = np.array([NO_MATCH if decision.match_stamp_ns is None
                      else frame_of[decision.match_stamp_ns] for decision in run.decisions])
    match_is = labels.judge(np.arange(len(match)), match)
    correct, told = match_is == RIGHT, match_is != UNTOLD
    is_loop = np.array([decision.is_loop for decision in run.decisions])
    probability = np.array([decision.probability for decision in run.decisions])
    metrics = measure(labels.kind, is_loop, probability, correct, told)
    outcome = outcomes(labels.kind, is_loop, correct, told)
    block = intervals.block_frames(labels.stamp_ns)
    interval = intervals.balanced_accuracy_interval(
        told_kind(labels.kind, outcome), right(outcome), block, seed=0)
    return {**_figures(metrics), 'n_frames': len(match), 'wrong_matches': metrics.wrong_matches,
            'untold_matches': metrics.untold_matches,
            'declared_elsewhere': int((is_loop & (match_is == ELSEWHERE)).sum()),
            'ci95': list(interval) if interval else None,
            'outcomes': ','.join(outcome.tolist()), 'block': block,
            'latency_to_first_closure_s': first_closure_latency_s(
                labels.stamp_ns, labels.kind, outcome)}


def _figures(metrics: Metrics | None) -> Row:
    return {name: getattr(metrics, name, None) for name in _FIGURES}
