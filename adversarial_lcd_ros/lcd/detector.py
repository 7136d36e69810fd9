"""The loop closure detector: retrieve by words, decide by graph (paper, target-LCD)."""

from __future__ import annotations

from dataclasses import dataclass, field
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
from adversarial_lcd_ros.lcd.views import NodeMatch, View, match_nodes
from adversarial_lcd_ros.paths import model_path

CACHED_VIEWS = 256


@dataclass
class _QueryNodes:
    """What judging a graph leaves to reuse for its perturbations: nodes, candidates, matches."""

    key: tuple[object, ...]
    x0: NDArray[np.float32]
    candidates: list[int]
    scores: NDArray[np.float64]
    matches: dict[int, NodeMatch] = field(default_factory=dict)


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
        logit = self._candidate_logits(View(graph, nodes.x0), nodes)
        best = int(logit.argmax())
        keyframe = nodes.candidates[best]
        chance = probability(float(logit[best]))
        match = self._database[keyframe]
        return LoopClosure(
            graph.stamp_ns, graph.frame_id, graph.sequence,
            is_loop=chance >= self.config.threshold, probability=chance,
            match_stamp_ns=match.stamp_ns, match_sequence=match.sequence,
            vbow_score=float(nodes.scores[keyframe]), candidates=len(nodes.candidates))

    def _query_nodes(self, graph: MultiTierGraph) -> _QueryNodes:
        key = (graph.node_digest, graph.word.tobytes(), graph.word_weight.tobytes(),
               graph.stamp_ns, len(self._database))
        if self._latest is None or self._latest.key != key:
            scores = self._database.scores(graph)
            self._latest = _QueryNodes(key, View(graph).x0, self._retrieve(graph, scores), scores)
        return self._latest

    def _retrieve(self, graph: MultiTierGraph, scores: NDArray[np.float64]) -> list[int]:
        """Return keyframes by falling vBoW score, none in another's map window."""
        old = self._admissible(graph)
        order = np.flatnonzero(old)[np.argsort(-scores[old], kind='stable')]
        taken = np.zeros(len(scores), bool)
        chosen: list[int] = []
        for keyframe in order:
            if not taken[keyframe]:
                chosen.append(int(keyframe))
                taken[max(0, keyframe - self.config.map_window):
                      keyframe + self.config.map_window + 1] = True
                if len(chosen) == self.config.candidates:
                    break
        return chosen

    def _admissible(self, graph: MultiTierGraph) -> NDArray[np.bool_]:
        return self._database.admissible(graph.stamp_ns, round(self.config.min_gap_s * 1e9))

    def _candidate_logits(self, query: View, nodes: _QueryNodes) -> NDArray[np.float64]:
        old = self._admissible(query.graph)
        window = np.arange(-self.config.map_window, self.config.map_window + 1)
        scores: dict[int, NDArray[np.float64]] = {}
        logits = np.zeros(len(nodes.candidates))
        for place, candidate in enumerate(nodes.candidates):
            around = candidate + window
            around = around[(around >= 0) & (around < len(old))]
            around = around[old[around]]
            for keyframe in map(int, around):
                if keyframe not in scores:
                    scores[keyframe] = self._compare(query, keyframe, nodes)
            mean = np.mean([scores[int(keyframe)] for keyframe in around], axis=0)
            logits[place] = self._decision.logit(mean)
        return logits

    def _compare(self, query: View, keyframe: int, nodes: _QueryNodes) -> NDArray[np.float64]:
        reference = self._view(keyframe)
        if keyframe not in nodes.matches:
            nodes.matches[keyframe] = match_nodes(query, reference)
        return self._target.compare(query, reference, nodes.matches[keyframe])
