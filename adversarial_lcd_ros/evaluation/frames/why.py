# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Why an attack works on one target and not on another, over one frame.

An attack can only take what its target feels. Here is which flips each attack asks about, and what
every single flip of the graph does to the answer of each target. It looks into the detector, which
no attack can.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.attacker import Attacker
from adversarial_lcd_ros.attack.oracle import edit_budget
from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.evaluation.frames.cells import Cell, detector_of
from adversarial_lcd_ros.evaluation.frames.run import FIRST_SEED
from adversarial_lcd_ros.evaluation.frames.samples import SAMPLES
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.evaluation.streams import Stream, load_stream_graphs
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.ground_truth.labels import POSITIVE
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.flips import flip_logits
from adversarial_lcd_ros.messages.types import LcdAnswer, LcdQuery
from adversarial_lcd_ros.registry import NONE

# Without a surrogate, whose order would hang on the answers: what is proposed is asked about.
ATTACKS: Mapping[str, AttackConfig] = {
    'eigencentrality': AttackConfig(surrogate=NONE),
    'shortest path': AttackConfig(perturbation='shortest_path', surrogate=NONE),
    'recall': AttackConfig(search='recall')}
ASKED = 40  # flips of an attack that are shown: as many as the paper's queries an edit
_LOOPS = 30  # a sequence, that are looked at for one that all targets find
_FELT = 1e-9  # log odds


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """
    What a target makes of every single flip of a graph.

    Attributes
    ----------
    target : str
    graph : MultiTierGraph
    margin : float
        Log odds of the loop above the threshold: what an attack has to take.
    taken : float64, (n (n - 1) / 2,)
        Log odds that each flip takes from the loop, in the order of ``numpy.triu_indices``.
    asked : mapping of str to int64, (k, 2)
        Attack to the first flips that it asked about, at most ``ASKED``.

    """

    target: str
    graph: MultiTierGraph
    margin: float
    taken: NDArray[np.float64]
    asked: Mapping[str, NDArray[np.int64]]

    @property
    def felt(self) -> float:
        """Share of all flips that change the answer at all."""
        return float(np.mean(np.abs(self.taken) > _FELT))

    @property
    def strongest(self) -> NDArray[np.int64]:
        """The ``ASKED`` flips that take most, the most first, (k, 2)."""
        order = np.argsort(-self.taken, kind='stable')[:ASKED]
        return np.stack(np.triu_indices(self.graph.node_count, 1), axis=1)[order]

    @property
    def at_node(self) -> NDArray[np.float64]:
        """Mean change of the answer by the flips at each node, either way, (n,)."""
        square = np.zeros((self.graph.node_count,) * 2)
        square[np.triu_indices(self.graph.node_count, 1)] = np.abs(self.taken)
        return np.asarray((square + square.T).sum(axis=1) / max(self.graph.node_count - 1, 1))

    def taken_by(self, pairs: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return what each of some flips takes, (k,)."""
        square = np.zeros((self.graph.node_count,) * 2)
        square[np.triu_indices(self.graph.node_count, 1)] = self.taken
        return np.asarray(square[pairs[:, 0], pairs[:, 1]], np.float64)


@dataclass(frozen=True, eq=False)
class Why:
    """
    One frame, as its targets see it.

    Attributes
    ----------
    stream : Stream
    judged : str
        As of a cell.
    edits : int
        Flips that the budget allows.
    targets : tuple of Sensitivity

    """

    stream: Stream
    judged: str
    edits: int
    targets: tuple[Sensitivity, ...]


def explain(streams: Sequence[Stream], cells: Sequence[Cell], rows: Sequence[Row],
            lcd: LcdConfig) -> Why | None:
    """
    Return what attacks ask about and targets feel, over one frame; None without any such.

    The targets are the two on which the paper's attack has lost the most and the least loops. The
    frame is the first, of those drawn for the first seed, whose loop both find.

    Parameters
    ----------
    streams, cells, rows
        Of the experiment.
    lcd : LcdConfig
        Of the detectors.

    """
    plain = [cell for cell in cells if cell.asked_target == cell.target and not cell.detector]
    judged = 'pairs' if any(cell.judged == 'pairs' for cell in plain) else 'frames'
    targets = extremes(rows, judged)
    plain = [cell for cell in plain if cell.judged == judged and cell.target in targets]
    if not plain:
        return None
    nodes = Counter(cell.nodes for cell in plain).most_common(1)[0][0]
    chosen: dict[str, Cell] = {}
    for cell in plain:
        if cell.nodes == nodes:
            chosen.setdefault(cell.target, cell)
    chosen = {target: chosen[target] for target in targets if target in chosen}
    for name in dict.fromkeys(stream.name for stream in streams):
        here = {target: stream for target, cell in chosen.items() for stream in streams
                if (stream.name, stream.nodes, stream.variant) == (name, nodes,
                                                                   cell.variant_needed)}
        found = _in_stream(here, chosen, judged, lcd) if len(here) == len(chosen) else None
        if found is not None:
            return found
    return None


def extremes(rows: Sequence[Row], judged: str) -> list[str]:
    """Return the targets on which the paper's attack lost the most and the least of the loops."""
    lost: dict[str, list[float]] = {}
    for row in rows:
        if (row['judged'] == judged and row['asked_target'] == row['target']
                and row['perturbation'] == 'eigencentrality' and not row.get('detector')):
            counts = lost.setdefault(row['target'], [0.0, 0.0])
            counts[0] += row['suppressed']
            counts[1] += sum(frame['clean'] == 'TP' for frame in row['frame_results'])
    share = {target: part / whole for target, (part, whole) in lost.items() if whole}
    order = sorted(share, key=lambda target: -share[target])
    return order if len(order) < 2 else [order[0], order[-1]]


def _in_stream(here: Mapping[str, Stream], cells: Mapping[str, Cell], judged: str,
               lcd: LcdConfig) -> Why | None:
    """Walk a sequence up to the first loop that all targets find."""
    stream = next(iter(here.values()))
    sample = SAMPLES[judged](stream.labels, _LOOPS, FIRST_SEED)
    graphs = {target: load_stream_graphs(of.graphs) for target, of in here.items()}
    detectors = {target: sample.make_detector(replace(detector_of(lcd, cell), target=target,
                                                      hard_answers=False))
                 for target, cell in cells.items()}
    ratio = max(cell.attack.ratio for cell in cells.values())
    place = {int(frame): row for row, frame in enumerate(sample.frame)
             if sample.kind[row] == POSITIVE}
    for index in range(max(place, default=-1) + 1):
        if index in place:
            sample.hold_against(place[index], detectors.values())
            if all(detector.judge(graphs[target][index]).is_loop
                   for target, detector in detectors.items()):
                found = tuple(_sensitivity(target, detector, graphs[target][:index + 1], ratio)
                              for target, detector in detectors.items())
                return Why(stream, judged, edit_budget(found[0].graph.node_count, ratio), found)
        for target, detector in detectors.items():
            detector.remember(graphs[target][index])
    return None


def _sensitivity(target: str, detector: LoopClosureDetector,
                 graphs: Sequence[MultiTierGraph], ratio: float) -> Sensitivity:
    *earlier, graph = graphs
    before = detector.verdict_log_odds(graph)
    threshold = detector.config.threshold
    margin = before - float(np.log(threshold / (1 - threshold))) if 0 < threshold < 1 else before
    return Sensitivity(target, graph, margin, before - flip_logits(detector, graph),
                       {name: _asked(replace(config, ratio=ratio), detector, earlier, graph)
                        for name, config in ATTACKS.items()})


def _asked(config: AttackConfig, detector: LoopClosureDetector,
           earlier: Sequence[MultiTierGraph], graph: MultiTierGraph) -> NDArray[np.int64]:
    """Return the first flips that an attack asks about, each once, (k, 2)."""
    seen: dict[tuple[int, int], None] = {}

    def ask(asked: MultiTierGraph) -> LcdAnswer:
        seen.update(dict.fromkeys(map(tuple, graph.flips_to(asked).tolist())))
        return detector.answer(LcdQuery(0, asked))

    # One query is about the clean graph. The first edit is shown: later flips hang on it.
    attacker = Attacker(replace(config, max_queries=ASKED + 1, queries_per_edit=ASKED + 1))
    for one in earlier:
        attacker.observe(one)
    attacker.attack(graph, ask)
    return np.array(list(seen)[:ASKED], np.int64).reshape(-1, 2)
