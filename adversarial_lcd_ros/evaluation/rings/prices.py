# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a defence costs: the time that a decision takes with it, beside one without."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import time

import numpy as np

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector

FRAMES = 40


def decision_us(graphs: Sequence[MultiTierGraph], lcd: LcdConfig,
                detectors: Sequence[tuple[tuple[str, object], ...]]) -> list[float]:
    """
    Return the median time of a decision on a clean graph, microseconds of processor time.

    The last frames of a stream are judged with all before them as the map, by every detector in
    turn, so that what else the machine does meets all alike.

    Parameters
    ----------
    graphs : sequence of MultiTierGraph
    lcd : LcdConfig
    detectors : sequence of tuple of (str, value)
        Settings that each has in place of those of ``lcd``.

    """
    there = [LoopClosureDetector(replace(lcd, **dict(settings)))  # type: ignore[arg-type]
             for settings in detectors]
    first = max(1, len(graphs) - FRAMES)
    spent: list[list[float]] = [[] for _ in there]
    for index, graph in enumerate(graphs):
        for detector, times in zip(there, spent, strict=True):
            if index >= first:
                begun = time.thread_time()
                detector.judge(graph)
                times.append(1e6 * (time.thread_time() - begun))
            detector.remember(graph)
    return [float(np.median(times)) for times in spent]
