# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A query graph held against one given reference and its window: the paper's accuracy on pairs.

Retrieval, the temporal gap and the best of several candidates are left out: what is judged is the
comparison alone, and what was trained on pairs is judged as it was trained.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE
from adversarial_lcd_ros.keyframes.database import bow_score
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector, QueryNodes

_DRAW = 20_211  # of the one drawing that all seeds share


def draw_pairs(relation: NDArray[np.int8], per_kind: int, seed: int
               ) -> tuple[NDArray[np.int64], NDArray[np.int8], NDArray[np.int64]]:
    """
    Draw loops, and as many pairs of different places, spread over time.

    The frames that have a pair of a kind are cut in time into ``per_kind`` parts, and one of each
    part is drawn, with one of its references. No frame is a query twice with one seed: those
    drawn for a loop are not drawn for another place. Seeds that follow each other draw different
    queries, until a part is used up.

    Parameters
    ----------
    relation : int8, (n, n)
        From ``FrameLabels``.
    per_kind : int
        Pairs of each kind; a kind with fewer queries gives all it has.
    seed : int
        Of the cell.

    Returns
    -------
    query : int64, (k,)
        Ascending.
    kind : int8, (k,)
        +1 the reference shows the same place, -1 another.
    reference : int64, (k,)
        Earlier than the query.

    """
    earlier = np.tril(relation, -1)
    chosen: dict[int, tuple[int, int]] = {}
    for kind in (POSITIVE, NEGATIVE):
        queries = np.flatnonzero((earlier == kind).any(axis=1))
        for part in np.array_split(queries, min(per_kind, len(queries)) or 1):
            if not len(part):
                continue
            order = np.random.default_rng((_DRAW, kind % 3, int(part[0]))).permutation(part)
            turns = np.roll(order, -(seed % len(order))).tolist()
            query = next((turn for turn in turns if turn not in chosen), None)
            if query is not None:
                rng = np.random.default_rng((_DRAW, kind % 3, query, seed))
                chosen[query] = kind, int(rng.choice(np.flatnonzero(earlier[query] == kind)))
    query = np.array(sorted(chosen), np.int64)
    return (query, np.array([chosen[one][0] for one in query.tolist()], np.int8),
            np.array([chosen[one][1] for one in query.tolist()], np.int64))


class PairDetector(LoopClosureDetector):
    """
    A detector that holds every graph against one keyframe, whatever its words and its age.

    Scores are averaged over the keyframe and those around it, as in training and by the
    detector. Answers, the optimum and single flips come from the same code as a detector's.

    Attributes
    ----------
    reference : int
        Index of the keyframe, in order of insertion.

    """

    def __init__(self, config: LcdConfig | None = None) -> None:
        super().__init__(config)
        self.reference = 0

    def query_nodes(self, graph: MultiTierGraph) -> QueryNodes:
        """Return what flips of a graph leave alone; kept until other nodes are asked about."""
        key = (graph.node_digest, graph.word.tobytes(), graph.word_weight.tobytes(),
               graph.stamp_ns, self.keyframe_count, self.reference)
        if self._latest is None or self._latest.key != key:
            self._latest = self._compare_pair(graph, key)
        return self._latest

    def _compare_pair(self, graph: MultiTierGraph, key: tuple[object, ...]) -> QueryNodes:
        if not 0 <= self.reference < self.keyframe_count:
            raise EvaluationError(f'pair with keyframe {self.reference} of {self.keyframe_count}: '
                                  'expected one that is remembered')
        window = self._window(self.reference, np.ones(self.keyframe_count, bool))
        query = self.judging.scoring.view(graph)
        compared = self.judging.scoring.compare(query, [self._view(frame) for frame in window])
        return QueryNodes(key, query, [self.reference],
                          [bow_score(graph, self._database[self.reference])],
                          np.full((1, len(window)), 1 / len(window)), compared)
