# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The same stream of graphs through attacker and detector as over ROS, without ROS."""

from __future__ import annotations

from collections.abc import Sequence
import time

from adversarial_lcd_ros.attack.attacker import Attacker
from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.evaluation.replay.records import AttackRun
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.messages.types import LcdQuery
from adversarial_lcd_ros.sequences.sequence import Progress


def run_offline(graphs: Sequence[MultiTierGraph], lcd: LcdConfig,
                attack: AttackConfig | None = None,
                progress: Progress | None = None, *,
                asked: LcdConfig | None = None, sealed: bool = False
                ) -> tuple[AttackRun, list[MultiTierGraph]]:
    """
    Return decisions and reports on a stream, and the graphs as the detector got them.

    Parameters
    ----------
    graphs : sequence of MultiTierGraph
        Clean graphs in order of time.
    lcd : LcdConfig
    attack : AttackConfig, optional
        None: no man in the middle.
    progress : callable, optional
        Called with graphs done and to do.
    asked : LcdConfig, optional
        Transfer: the detector that answers the attacker's queries, where it is not the one that
        is judged. It stores the same graphs. A report's loss and status are about its answers.
    sealed : bool
        The builder seals graphs: those that were changed are refused, neither judged nor stored,
        and there is no decision on them.

    """
    detector = LoopClosureDetector(lcd)
    shadow = LoopClosureDetector(asked) if asked else None
    oracle = shadow or detector
    attacker = Attacker(attack) if attack else None
    decisions, reports, forwarded = [], [], []
    for done, clean in enumerate(graphs):
        graph = clean
        if attacker:
            started = time.perf_counter()
            result = attacker.process(clean, lambda g: oracle.answer(LcdQuery(0, g)))
            reports.append(result.report(time.perf_counter() - started))
            graph = result.perturbed
        if not sealed or graph is clean:
            decisions.append(detector.detect(graph))
            if shadow:
                shadow.detect(graph)
        forwarded.append(graph)
        if progress:
            progress(done + 1, len(graphs))
    return AttackRun(decisions, reports), forwarded
