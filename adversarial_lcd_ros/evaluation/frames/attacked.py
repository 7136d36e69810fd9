# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Attacks on single frames of a stream: the protocol of the paper's experiments.

The stream is walked in order. The detector remembers every clean graph and the attacker sees
each go by, but only a sample of the frames is attacked and judged, each against the map of clean
graphs before it. In a replay (``evaluation.replay``) every frame is attacked and the map
consists of attacked graphs; here frames do not hang on each other, and attacks with a thousand
queries a frame can be compared over many seeds. By pairs a sampled frame is judged against one
given reference and its window instead (``pairs``); all else is the same.

The sample hangs on seed and sequence only: all attacks meet the same frames.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
import time
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.attacker import Attacker, AttackResult
from adversarial_lcd_ros.attack.oracle import Ask
from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.frames.cells import Cell, detector_of
from adversarial_lcd_ros.evaluation.frames.optimum import Optimum
from adversarial_lcd_ros.evaluation.frames.samples import FrameSample
from adversarial_lcd_ros.evaluation.frames.sealed import SealedWire
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.messages.types import LcdAnswer, LcdQuery, LoopClosure


@dataclass(frozen=True)
class FrameResult:
    """
    One attacked frame.

    Attributes
    ----------
    kind : int
        +1 a loop is there to be found, -1 a new place.
    clean, attacked : LoopClosure
        Decisions on the clean and on the forwarded graph.
    clean_is, attacked_is : str
        What is said of the match named, declared or not: ``FrameLabels.judge``.
    result : AttackResult
    unexplained_clean, unexplained : int or None
        Edges of the clean graph, and of the one that arrived, that defences have no explanation
        for; None if none of them counts, or no graph arrived.
    refused : str
        Why the detector took no graph on this frame, and decided nothing; empty if it did.
    query_s, search_s, judge_s : float
        Processor time spent in the asked detector, in the rest of the attack, and on judging
        its outcome: what else the machine does is no matter.

    """

    kind: int
    clean: LoopClosure
    attacked: LoopClosure
    clean_is: str
    attacked_is: str
    result: AttackResult
    query_s: float
    search_s: float
    judge_s: float
    unexplained_clean: int | None = None
    unexplained: int | None = None
    refused: str = ''


class _Adversary(Protocol):
    def attack(self, graph: MultiTierGraph, ask: Ask) -> AttackResult: ...

    def observe(self, graph: MultiTierGraph) -> None: ...


@dataclass
class _Yardstick:
    """The optimum in an attacker's place: it looks into the detector instead of asking."""

    optimum: Optimum

    def attack(self, graph: MultiTierGraph, ask: Ask) -> AttackResult:
        return self.optimum.process(graph)

    def observe(self, graph: MultiTierGraph) -> None:
        """Remember nothing."""


class _Resigned:
    """Knows that graphs are sealed, and sends them as they are."""

    def attack(self, graph: MultiTierGraph, ask: Ask) -> AttackResult:
        return AttackResult(graph, graph, 'skipped', 'what is changed would be refused')

    def observe(self, graph: MultiTierGraph) -> None:
        """Remember nothing."""


@dataclass
class _Timed:
    """A detector that answers queries, counted and timed."""

    detector: LoopClosureDetector
    count: int = 0
    spent_s: float = 0.0

    def __call__(self, graph: MultiTierGraph) -> LcdAnswer:
        started = time.thread_time()
        answer = self.detector.answer(LcdQuery(0, graph))
        self.spent_s += time.thread_time() - started
        self.count += 1
        return answer


@dataclass
class _Contest:
    """A cell's attacker, the detectors that it asks and that judge it, and what is between."""

    adversary: _Adversary
    asked: LoopClosureDetector
    judging: LoopClosureDetector
    wire: SealedWire | None = None
    results: list[FrameResult] = field(default_factory=list)


def attack_frames(graphs: Sequence[MultiTierGraph], sample: FrameSample, cells: Sequence[Cell],
                  lcd: LcdConfig, seed: int) -> list[list[FrameResult]]:
    """
    Walk a stream once for several cells; return for each its attacked frames.

    Cells do not see each other: results are the same as one by one. What does not depend on
    flips is computed once a frame for all that ask the same detector.

    Parameters
    ----------
    graphs : sequence of MultiTierGraph
        Clean graphs in order of time.
    sample : FrameSample
        The frames to attack; all cells are judged as it says.
    cells : sequence of Cell
    lcd : LcdConfig
        Of the detectors, but for what the cells say.
    seed : int
        Of the attackers.

    Raises
    ------
    EvaluationError
        An attack overspent a budget.

    """
    detectors: dict[LcdConfig, LoopClosureDetector] = {}
    contests = [_contest(cell, lcd, seed, detectors, sample.make_detector) for cell in cells]
    wire = SealedWire() if any(cell.sealed for cell in cells) else None
    for cell, contest in zip(cells, contests, strict=True):
        contest.wire = wire if cell.sealed else None
    place = {int(frame): row for row, frame in enumerate(sample.frame)}
    index_of = {graph.stamp_ns: index for index, graph in enumerate(graphs)}
    for index, graph in enumerate(graphs[:max(place, default=-1) + 1]):
        if index in place:
            row = place[index]
            sample.hold_against(row, detectors.values())
            # What flips leave alone is computed here, at the cost of no cell.
            clean = {config: detector.judge(graph) for config, detector in detectors.items()}
            for contest in contests:
                contest.results.append(_attack_frame(
                    contest, graph, clean[contest.judging.config], int(sample.kind[row]),
                    sample.match_is[row], index_of))
        if wire is not None:
            wire.carry(graph)
        for detector in detectors.values():
            detector.remember(graph)
        for contest in contests:
            contest.adversary.observe(graph)
    return [contest.results for contest in contests]


def _contest(cell: Cell, lcd: LcdConfig, seed: int,
             detectors: dict[LcdConfig, LoopClosureDetector],
             make: Callable[[LcdConfig], LoopClosureDetector]) -> _Contest:
    behind = detector_of(lcd, cell)
    known = behind if cell.aware else replace(lcd, threshold=cell.threshold)
    configs = (replace(behind, target=cell.target, hard_answers=False),
               replace(known, target=cell.asked_target, hard_answers=cell.oracle == 'hard'))
    for config in configs:
        if config not in detectors:
            detectors[config] = make(config)
    judging, asked = (detectors[config] for config in configs)
    attack = replace(cell.attack, seed=seed)
    return _Contest(_adversary(cell, attack, judging, asked), asked, judging)


def _adversary(cell: Cell, attack: AttackConfig, judging: LoopClosureDetector,
               asked: LoopClosureDetector) -> _Adversary:
    if cell.sealed and cell.aware:
        return _Resigned()
    if cell.search == Optimum.name:
        return _Yardstick(Optimum(judging if cell.aware else asked, attack))
    return Attacker(attack)


def _attack_frame(contest: _Contest, graph: MultiTierGraph, clean: LoopClosure, kind: int,
                  match_is: NDArray[np.str_], index_of: dict[int, int]) -> FrameResult:
    ask = _Timed(contest.asked)
    begun = time.thread_time()
    result = contest.adversary.attack(graph, ask)
    attacked = time.thread_time()
    arrived, refused = _arrived(contest, result)
    after = _undecided(graph) if arrived is None else contest.judging.judge(arrived)
    judged = time.thread_time()
    _check_budgets(result, ask.count)
    return FrameResult(
        kind, clean, after, _said_of(clean, match_is, index_of),
        _said_of(after, match_is, index_of), result, ask.spent_s,
        attacked - begun - ask.spent_s, judged - attacked,
        _unexplained(contest, graph), _unexplained(contest, arrived), refused)


def _arrived(contest: _Contest, result: AttackResult) -> tuple[MultiTierGraph | None, str]:
    """Return what the detector gets of an attacked graph, or why it refuses it."""
    if contest.wire is None:
        return result.perturbed, ''
    return contest.wire.arrives(result.clean, result.perturbed)


def _undecided(graph: MultiTierGraph) -> LoopClosure:
    return LoopClosure(graph.stamp_ns, graph.frame_id, graph.sequence, is_loop=False,
                       probability=0.0)


def _unexplained(contest: _Contest, graph: MultiTierGraph | None) -> int | None:
    scoring = contest.judging.judging.scoring
    return scoring.unexplained(graph) if graph is not None and scoring.counts_edges else None


def _said_of(decision: LoopClosure, match_is: NDArray[np.str_], index_of: dict[int, int]) -> str:
    return ('' if decision.match_stamp_ns is None
            else str(match_is[index_of[decision.match_stamp_ns]]))


def _check_budgets(result: AttackResult, queries: int) -> None:
    # Counted here once more, on the graphs and at the detector: a figure of an attack that
    # overspends is a figure of another attack.
    change = result.change
    if (change.edits > result.edit_budget or change.nodes > result.node_budget
            or queries != result.queries or queries > result.query_budget):
        raise EvaluationError(
            f'frame at {result.clean.stamp_ns} ns: {change.edits} edits of {result.edit_budget}, '
            f'{change.nodes} nodes of {result.node_budget}, {queries} queries of '
            f'{result.query_budget} ({result.queries} reported): the attack does not keep to its '
            'budgets')
