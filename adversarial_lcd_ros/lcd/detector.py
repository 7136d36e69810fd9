# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The loop closure detector: retrieve by words, decide by graph (paper, target-LCD).

Stored keyframes are the whole state: consistency over successive queries, or a counter, would be
changed by them. The one cache, nodes of the latest query, is keyed by what it was made of.
Candidates come from words alone, outside the temporal gap and none in another's window, so flips
cannot change which keyframes are looked at. The first graph judged of a frame is a base; for
others only what flips changed is recomputed, by the same function: a query costs 0.06 to 0.1 ms
instead of 6, and no bit of an answer depends on what was asked before.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
import math

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.keyframes.database import Database
from adversarial_lcd_ros.lcd.decision import Decision, probability
from adversarial_lcd_ros.lcd.scoring import Compared, Judge
from adversarial_lcd_ros.lcd.views import View
from adversarial_lcd_ros.messages.types import LcdAnswer, LcdQuery, LoopClosure

CACHED_VIEWS = 256


@dataclass
class QueryNodes:
    """
    What judging a graph leaves to reuse for its perturbations.

    Attributes
    ----------
    key : tuple
        What all of it was made of, the base's edges apart.
    base : View
        The first graph judged. Later ones are the cheaper the fewer edges they have changed,
        and are judged the same whichever came first.
    candidates : list of int
        Keyframes, r' of them.
    bow : list of float, (r',)
        vBoW score of each candidate.
    average : float64, (r', r)
        Weight of each reference in the window of each candidate.
    compared : Compared
        With the references.
    support : dict
        Candidate, by its place, to how far a loop with it is borne out, where that was asked for.

    """

    key: tuple[object, ...]
    base: View
    candidates: list[int]
    bow: list[float]
    average: NDArray[np.float64]
    compared: Compared
    support: dict[int, float] = field(default_factory=dict)


class LoopClosureDetector:
    """
    Graphs in, loop closures out.

    A graph is compared with the keyframes that look alike by visual words and are old enough.
    Temporal consistency: the scores of a candidate are averaged with those of the keyframes
    before and after it, since a true loop is also seen from there. What a graph is judged to be
    depends on the stored keyframes and on nothing else, so a query has no effect.
    """

    def __init__(self, config: LcdConfig | None = None) -> None:
        self.config = config or LcdConfig()
        self.judging = Judge(self.config)
        self._database = Database()
        self._view = lru_cache(CACHED_VIEWS)(lambda index: View(self._database[index]))
        self._latest: QueryNodes | None = None

    @property
    def decision(self) -> Decision:
        """The trained decision."""
        return self.judging.decision

    @property
    def keyframe_count(self) -> int:
        """Number of graphs remembered."""
        return len(self._database)

    def detect(self, graph: MultiTierGraph) -> LoopClosure:
        """Judge a graph, then remember it as a keyframe."""
        decision = self.judge(graph)
        self.remember(graph)
        return decision

    def remember(self, graph: MultiTierGraph) -> None:
        """
        Store a graph as a keyframe without judging it, while there is room.

        It is stored as defences have prepared it: what a keyframe is compared with later finds
        that done.

        Raises
        ------
        GraphError
            It is of another variant than the target needs.

        """
        if self.has_room:
            self._database.add(self.judging.scoring.prepare(graph))

    @property
    def has_room(self) -> bool:
        """Whether a further graph would be remembered."""
        return (len(self._database) < self.config.max_keyframes
                and self._database.memory < self.config.max_keyframe_mb * 2 ** 20)

    def answer(self, query: LcdQuery) -> LcdAnswer:
        """Tell what the decision on a graph would be; remembers nothing."""
        decision = self.judge(query.graph)
        soft = not self.config.hard_answers
        if not soft:
            return LcdAnswer(query.id, decision.is_loop, soft, float(decision.is_loop))
        return LcdAnswer(query.id, decision.is_loop, soft, decision.probability,
                         decision.log_odds)

    def judge(self, graph: MultiTierGraph) -> LoopClosure:
        """Decide whether a graph closes a loop with a keyframe; remembers nothing."""
        nodes = self.query_nodes(graph)
        if not nodes.candidates:
            return LoopClosure(graph.stamp_ns, graph.frame_id, graph.sequence,
                               is_loop=False, probability=0.0)
        logit = self.log_odds(graph)
        best = int(logit.argmax())
        log_odds = float(logit[best])
        match = self._database[nodes.candidates[best]]
        is_loop, chance = self.judging.verdict(log_odds, lambda: self.support(graph, best))
        if chance != probability(log_odds):  # what a check has lowered
            log_odds = math.nan
        return LoopClosure(
            graph.stamp_ns, graph.frame_id, graph.sequence,
            is_loop=is_loop, probability=chance,
            match_stamp_ns=match.stamp_ns, match_sequence=match.sequence,
            vbow_score=nodes.bow[best], candidates=len(nodes.candidates), log_odds=log_odds,
            match_session=match.session)

    def support(self, graph: MultiTierGraph, candidate: int) -> float:
        """Return how far a loop with a candidate is borne out; flips of edges do not change it."""
        nodes = self.query_nodes(graph)
        if candidate not in nodes.support:
            nodes.support[candidate] = self.judging.scoring.support(
                graph, self._database[nodes.candidates[candidate]])
        return nodes.support[candidate]

    def verdict_log_odds(self, graph: MultiTierGraph) -> float:
        """Return the log odds in a soft answer; -inf without a candidate."""
        logits = self.log_odds(graph)
        if not len(logits):
            return -np.inf
        return float(self.judging.verdict_logits(
            logits[None], lambda candidate: self.support(graph, candidate))[0])

    def log_odds(self, graph: MultiTierGraph) -> NDArray[np.float64]:
        """Return the log odds of a loop with each candidate, the most alike by words first."""
        nodes = self.query_nodes(graph)
        if not nodes.candidates:
            return np.zeros(0)
        view = self.judging.scoring.view(graph, nodes.base)
        return self.decision.logit(nodes.average @ nodes.compared.scores(view))

    def query_nodes(self, graph: MultiTierGraph) -> QueryNodes:
        """Return what flips of a graph leave alone; kept until other nodes are asked about."""
        key = (graph.node_digest, graph.word.tobytes(), graph.word_weight.tobytes(),
               graph.stamp_ns, len(self._database))
        if self._latest is None or self._latest.key != key:
            self._latest = self._compare_nodes(graph, key)
        return self._latest

    def _compare_nodes(self, graph: MultiTierGraph, key: tuple[object, ...]) -> QueryNodes:
        old = self._database.admissible(graph.stamp_ns, round(self.config.min_gap_s * 1e9))
        candidates, bow = self._database.retrieve(
            graph, old, self.config.candidates, self.config.map_window)
        around = [self._window(candidate, old) for candidate in candidates]
        keyframes = sorted({keyframe for window in around for keyframe in window})
        average = np.zeros((len(around), len(keyframes)))
        for row, window in zip(average, around, strict=True):
            row[np.searchsorted(keyframes, window)] = 1 / len(window)
        query = self.judging.scoring.view(graph)
        compared = self.judging.scoring.compare(
            query, [self._view(keyframe) for keyframe in keyframes])
        return QueryNodes(key, query, candidates, bow, average, compared)

    def _window(self, candidate: int, old: NDArray[np.bool_]) -> list[int]:
        """Return the candidate and the keyframes around it that are old enough, too."""
        window = range(max(0, candidate - self.config.map_window),
                       min(len(old), candidate + self.config.map_window + 1))
        return [keyframe for keyframe in window if old[keyframe]]
