"""The loop closure detector: retrieve by words, decide by graph (paper, target-LCD)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.codec import LcdAnswer, LcdQuery, LoopClosure
from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.keyframes import Database
from adversarial_lcd_ros.lcd.decision import Decision, probability
from adversarial_lcd_ros.lcd.targets import make_target
from adversarial_lcd_ros.lcd.views import Comparison, View
from adversarial_lcd_ros.paths import model_path

CACHED_VIEWS = 256


@dataclass
class _QueryNodes:
    """What judging a graph leaves to reuse for its perturbations: nodes, candidates, matches."""

    key: tuple[object, ...]
    x0: NDArray[np.float32]
    bow: NDArray[np.float64]
    candidates: list[int]
    windows: list[NDArray[np.int64]]
    comparison: Comparison


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
        self._target = make_target(self.config.target)
        path = (Path(self.config.model) if self.config.model
                else model_path(f'target_{self.config.target}.json'))
        self._decision = Decision.load(path, self._target.name, self._target.channels)
        self._database = Database()
        self._view = lru_cache(CACHED_VIEWS)(lambda index: View(self._database[index]))
        self._latest: _QueryNodes | None = None

    @property
    def keyframe_count(self) -> int:
        """Number of graphs remembered."""
        return len(self._database)

    def detect(self, graph: MultiTierGraph) -> LoopClosure:
        """Judge a graph, then remember it as a keyframe."""
        decision = self.judge(graph)
        if len(self._database) < self.config.max_keyframes:
            self._database.add(graph)
        return decision

    def answer(self, query: LcdQuery) -> LcdAnswer:
        """Tell what the decision on a graph would be; remembers nothing."""
        decision = self.judge(query.graph)
        soft = not self.config.hard_answers
        return LcdAnswer(query.id, decision.is_loop, soft,
                         decision.probability if soft else float(decision.is_loop))

    def judge(self, graph: MultiTierGraph) -> LoopClosure:
        """Decide whether a graph closes a loop with a keyframe; remembers nothing."""
        nodes = self._query_nodes(graph)
        if not nodes.candidates:
            return LoopClosure(graph.stamp_ns, graph.frame_id, graph.sequence,
                               is_loop=False, probability=0.0)
        scores = self._target.compare(View(graph, nodes.x0), nodes.comparison)
        logit = self._decision.logit([scores[rows].mean(axis=0) for rows in nodes.windows])
        best = int(logit.argmax())
        keyframe = nodes.candidates[best]
        chance = probability(float(logit[best]))
        match = self._database[keyframe]
        return LoopClosure(
            graph.stamp_ns, graph.frame_id, graph.sequence,
            is_loop=chance >= self.config.threshold, probability=chance,
            match_stamp_ns=match.stamp_ns, match_sequence=match.sequence,
            vbow_score=float(nodes.bow[keyframe]), candidates=len(nodes.candidates))

    def _query_nodes(self, graph: MultiTierGraph) -> _QueryNodes:
        key = (graph.node_digest, graph.word.tobytes(), graph.word_weight.tobytes(),
               graph.stamp_ns, len(self._database))
        if self._latest is None or self._latest.key != key:
            self._latest = self._compare_nodes(graph, key)
        return self._latest

    def _compare_nodes(self, graph: MultiTierGraph, key: tuple[object, ...]) -> _QueryNodes:
        old = self._database.admissible(graph.stamp_ns, round(self.config.min_gap_s * 1e9))
        bow = self._database.scores(graph)
        candidates = self._retrieve(bow, old)
        around = [self._window(candidate, old) for candidate in candidates]
        keyframes = sorted({keyframe for window in around for keyframe in window})
        rows = {keyframe: row for row, keyframe in enumerate(keyframes)}
        query = View(graph)
        return _QueryNodes(key, query.x0, bow, candidates,
                           [np.array([rows[keyframe] for keyframe in window])
                            for window in around],
                           Comparison(query, [self._view(keyframe) for keyframe in keyframes]))

    def _retrieve(self, bow: NDArray[np.float64], old: NDArray[np.bool_]) -> list[int]:
        """Return keyframes by falling vBoW score, none in another's map window."""
        taken = ~old
        chosen: list[int] = []
        for keyframe in np.argsort(-bow, kind='stable'):
            if not taken[keyframe]:
                chosen.append(int(keyframe))
                taken[max(0, keyframe - self.config.map_window):
                      keyframe + self.config.map_window + 1] = True
                if len(chosen) == self.config.candidates:
                    break
        return chosen

    def _window(self, candidate: int, old: NDArray[np.bool_]) -> list[int]:
        """Return the candidate and the keyframes around it that are old enough, too."""
        window = range(max(0, candidate - self.config.map_window),
                       min(len(old), candidate + self.config.map_window + 1))
        return [keyframe for keyframe in window if old[keyframe]]
