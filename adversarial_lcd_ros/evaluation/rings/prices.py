# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a defence costs: time of a decision with it, beside one without, or of a seal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import time

import numpy as np

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.messages.authentic import Gate
from adversarial_lcd_ros.messages.codec import decode_graph, encode_graph
from adversarial_lcd_ros.messages.sealing import Sealer

FRAMES = 40


def decision_us(graphs: Sequence[MultiTierGraph], lcd: LcdConfig,
                detectors: Sequence[tuple[tuple[str, object], ...]]) -> list[float]:
    """
    Return the median time of a decision on a clean graph, microseconds of processor time.

    The last frames of a stream are judged with all before them as the map, by every detector in
    turn, so that what else the machine does meets all alike. One whose time does not count goes
    first: what a graph works out once and keeps is no cost of the detector that happens to ask.

    Parameters
    ----------
    graphs : sequence of MultiTierGraph
    lcd : LcdConfig
    detectors : sequence of tuple of (str, value)
        Settings that each has in place of those of ``lcd``.

    """
    there = [LoopClosureDetector(replace(lcd, **dict(settings)))  # type: ignore[arg-type]
             for settings in detectors]
    first_of_all = LoopClosureDetector(lcd)
    first = max(1, len(graphs) - FRAMES)
    spent: list[list[float]] = [[] for _ in there]
    for index, graph in enumerate(graphs):
        if index >= first:
            first_of_all.judge(graph)
        first_of_all.remember(graph)
        for detector, times in zip(there, spent, strict=True):
            if index >= first:
                begun = time.thread_time()
                detector.judge(graph)
                times.append(1e6 * (time.thread_time() - begun))
            detector.remember(graph)
    return [float(np.median(times)) for times in spent]


def sealing_us(graphs: Sequence[MultiTierGraph]) -> float:
    """
    Return the median time of sealing a graph and opening it, microseconds of processor time.

    What is encoded and decoded without a seal, too, does not count.
    """
    key = bytes(32)
    sealer = Sealer(key)
    spent = []
    for graph in graphs[-FRAMES:]:
        payload, gate = encode_graph(graph), Gate(key)
        begun = time.thread_time()
        gate.take(sealer.seal(payload))
        opened = time.thread_time()
        decode_graph(payload)
        spent.append(1e6 * (opened - begun - (time.thread_time() - opened)))
    return float(np.median(spent))
