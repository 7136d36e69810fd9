# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Fit the decision of a target on labelled pairs of graphs.

Hard negatives come from retrieval: random pairs of different places are easy, those that words
confuse are what a detector decides on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import balanced_accuracy_score
from sklearn.preprocessing import StandardScaler

from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.keyframes.database import Database
from adversarial_lcd_ros.lcd.decision import Decision
from adversarial_lcd_ros.lcd.scoring import Scoring
from adversarial_lcd_ros.lcd.views import View
from adversarial_lcd_ros.sequences.sequence import Progress


@dataclass(frozen=True)
class LabelledPairs:
    """
    Pairs of frames of one sequence, with what ground truth says of them.

    Attributes
    ----------
    graphs : sequence of MultiTierGraph
        The frames in order of time.
    query, reference : int64, (k,)
        Indices into graphs.
    is_loop : bool, (k,)

    """

    graphs: Sequence[MultiTierGraph]
    query: NDArray[np.int64]
    reference: NDArray[np.int64]
    is_loop: NDArray[np.bool_]


class PairScorer:
    """
    Scores of pairs of frames of one sequence, averaged over the map window.

    The window is that of the detector: the reference's neighbours in order of time.
    """

    def __init__(self, scoring: Scoring, graphs: Sequence[MultiTierGraph],
                 map_window: int) -> None:
        self._scoring = scoring
        self._views = [scoring.view(graph) for graph in graphs]
        self._window = map_window

    def references(self, reference: int) -> range:
        """Return the frames whose scores are averaged for a reference."""
        return range(max(0, reference - self._window),
                     min(len(self._views), reference + self._window + 1))

    def scores(self, query: View, reference: int) -> NDArray[np.float64]:
        """Return the mean scores of a query with a reference's window, shape (channels,)."""
        views = [self._views[frame] for frame in self.references(reference)]
        mean: NDArray[np.float64] = self._scoring.compare(query, views).scores(query).mean(axis=0)
        return mean

    def pairs(self, pairs: LabelledPairs, progress: Progress | None = None
              ) -> NDArray[np.float64]:
        """Return the scores of every pair, shape (k, channels)."""
        rows = []
        for done, (query, reference) in enumerate(zip(pairs.query, pairs.reference, strict=True)):
            rows.append(self.scores(self._views[query], int(reference)))
            if progress:
                progress(done + 1, len(pairs.query))
        return np.array(rows).reshape(len(rows), len(self._scoring.target.channels))


def retrieved_pairs(graphs: Sequence[MultiTierGraph], relation: NDArray[np.int8],
                    min_gap_ns: int, count: int) -> NDArray[np.int64]:
    """
    Return labelled pairs that a detector would compare, shape (k, 2), query first.

    These are the keyframes with the largest vBoW scores of another place: the hardest negatives
    of the live protocol, which random pairs hardly hold.

    Parameters
    ----------
    graphs : sequence of MultiTierGraph
    relation : int8, (n, n)
        +1 loop, -1 different place, 0 neither; only -1 is returned.
    min_gap_ns : int
        Least age of a candidate, nanoseconds.
    count : int
        Candidates for each frame.

    """
    database = Database()
    found: list[tuple[int, int]] = []
    for query, graph in enumerate(graphs):
        old = database.admissible(graph.stamp_ns, min_gap_ns)
        best, _ = database.retrieve(graph, old, count)
        found += [(query, reference) for reference in best if relation[query, reference] < 0]
        database.add(graph)
    return np.array(found, np.int64).reshape(-1, 2)


def fit_decision(scoring: Scoring, sequences: Sequence[LabelledPairs], map_window: int,
                 progress: Progress | None = None, card: dict[str, object] | None = None
                 ) -> Decision:
    """
    Return a logistic decision on the square roots of the target's scores.

    Loops and others weigh the same, whatever their numbers, and so do sequences. The card gets
    the balanced accuracy on the training pairs of each sequence.

    Raises
    ------
    ModelError
        There are no loops, or nothing but loops.

    """
    target = scoring.target
    rows, labels, weights = [], [], []
    for pairs in sequences:
        rows.append(PairScorer(scoring, pairs.graphs, map_window).pairs(pairs, progress))
        labels.append(pairs.is_loop)
        loops = pairs.is_loop.mean() if len(pairs.is_loop) else 0.0
        if not 0 < loops < 1:
            raise ModelError(f'training pairs of a sequence: {len(pairs.is_loop)}, of which '
                             f'{loops:.0%} are loops; both kinds are needed')
        weights.append(np.where(pairs.is_loop, 0.5 / loops, 0.5 / (1 - loops))
                       / len(pairs.is_loop))
    roots = np.sqrt(np.concatenate(rows))
    scaler = StandardScaler().fit(roots)
    weight = np.concatenate(weights)
    model = LogisticRegression(C=10.0, max_iter=1000)
    model.fit(scaler.transform(roots), np.concatenate(labels), weight * len(weight) / weight.sum())
    slope = model.coef_[0] / scaler.scale_
    bias = float(model.intercept_[0] - slope @ scaler.mean_)
    decision = Decision(target.name, target.channels, tuple(float(value) for value in slope), bias)
    accuracy = [float(balanced_accuracy_score(is_loop, decision.logit(scores) >= 0))
                for scores, is_loop in zip(rows, labels, strict=True)]
    return replace(decision, card={**(card or {}), 'training_balanced_accuracy': accuracy})
