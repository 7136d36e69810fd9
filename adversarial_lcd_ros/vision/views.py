# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of decisions: the frame, its graph, the match beside it, the verdict and why."""

from __future__ import annotations

from collections import OrderedDict
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import GraphError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages.types import AttackReport, LoopClosure
from adversarial_lcd_ros.sequences.frame import JPEG, Frame
from adversarial_lcd_ros.vision.panels import draw_decision

# Pictures of earlier frames that a later one may be matched with; the oldest go first.
_MOST_BYTES = 256 << 20
# Frames whose graph, report or decision may still be under way.
_UNDER_WAY = 64
KeptT = TypeVar('KeptT')


class Views:
    """
    Makes a picture of each decision once all that belongs to it is there, in whatever order.

    Graphs, reports and decisions wait for each other, a limited number of them; pictures of
    frames stay for later matches, 256 MB at most.

    Attributes
    ----------
    attacked : bool
        There are clean graphs and reports, too: a picture waits for them.

    """

    def __init__(self, *, attacked: bool = False) -> None:
        self.attacked = attacked
        self._reports: OrderedDict[int, AttackReport] = OrderedDict()
        self._pictures: OrderedDict[int, bytes] = OrderedDict()
        self._bytes = 0
        self._clean: OrderedDict[int, MultiTierGraph] = OrderedDict()
        self._heard: OrderedDict[int, MultiTierGraph] = OrderedDict()
        self._decisions: OrderedDict[int, LoopClosure] = OrderedDict()

    def note_frame(self, frame: Frame) -> None:
        """Take a camera frame."""
        data = frame.compressed(JPEG).data
        self._bytes += len(data) - len(self._pictures.pop(frame.stamp_ns, b''))
        self._pictures[frame.stamp_ns] = data
        while self._bytes > _MOST_BYTES:
            self._bytes -= len(self._pictures.popitem(last=False)[1])

    def note_clean(self, graph: MultiTierGraph) -> Frame | None:
        """Take a graph as it was before an attacker got it; return what is complete now."""
        _keep(self._clean, graph.stamp_ns, graph)
        return self._drawn(graph.stamp_ns)

    def note_graph(self, graph: MultiTierGraph) -> Frame | None:
        """Take a graph as the detector got it; return what is complete now."""
        _keep(self._heard, graph.stamp_ns, graph)
        return self._drawn(graph.stamp_ns)

    def note_report(self, report: AttackReport) -> Frame | None:
        """Take what the attacker says of a graph; return what is complete now."""
        _keep(self._reports, report.stamp_ns, report)
        return self._drawn(report.stamp_ns)

    def note_decision(self, decision: LoopClosure) -> Frame | None:
        """Take a decision; return what is complete now."""
        _keep(self._decisions, decision.stamp_ns, decision)
        return self._drawn(decision.stamp_ns)

    def _drawn(self, stamp_ns: int) -> Frame | None:
        """Return the picture of a decision, a JPEG; None where something of it is missing."""
        graph, decision = self._heard.get(stamp_ns), self._decisions.get(stamp_ns)
        clean, report = self._clean.get(stamp_ns), self._reports.get(stamp_ns)
        if graph is None or decision is None or stamp_ns not in self._pictures or (
                self.attacked and (clean is None or report is None)):
            return None
        for kept in (self._heard, self._decisions, self._clean, self._reports):
            kept.pop(stamp_ns, None)
        query = self._picture(stamp_ns)
        assert query is not None
        try:
            drawn = draw_decision(
                query, clean, graph, self._picture(decision.match_stamp_ns), verdict(decision),
                why(decision, clean, graph, report), is_loop=decision.is_loop)
        except GraphError:  # of images of another size
            return None
        return Frame.of_pixels(stamp_ns, drawn).compressed(JPEG)

    def _picture(self, stamp_ns: int | None) -> NDArray[np.uint8] | None:
        data = self._pictures.get(stamp_ns) if stamp_ns is not None else None
        if data is None:
            return None
        return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), np.uint8)


def verdict(decision: LoopClosure) -> str:
    """Return what was decided, in a line."""
    if decision.match_stamp_ns is None:
        return 'no loop: no earlier frame to compare with'
    since_s = (decision.stamp_ns - decision.match_stamp_ns) / 1e9
    match = f'frame {decision.match_sequence}, {since_s:.1f} s before'
    chance = f'probability {decision.probability:.3f}'
    if decision.is_loop:
        return f'LOOP of frame {decision.sequence} with {match}: {chance}'
    return f'no loop: {chance} for frame {decision.sequence} with {match}'


def why(decision: LoopClosure, clean: MultiTierGraph | None, graph: MultiTierGraph,
        report: AttackReport | None) -> str:
    """Return what the decision rests on, and what an attacker did about it, in a line."""
    words = [f'{decision.candidates} candidates, words alike by {decision.vbow_score:.3f}']
    if clean is not None and clean.node_digest != graph.node_digest:
        words.append(f'attacker changed {report.nodes_moved} nodes' if report is not None else
                     'attacker changed nodes')
    elif clean is not None:
        flips = clean.flips_to(graph)
        added = int(np.count_nonzero(graph.has_edges(flips)))
        words.append(f'attacker added {added} edges and deleted {len(flips) - added}')
    if report is not None:
        words.append(f'asked {report.queries} of {report.query_budget} queries: {report.status}'
                     f'{", " if report.reason else ""}{report.reason}')
    return '; '.join(words)


def _keep(kept: OrderedDict[int, KeptT], stamp_ns: int, value: KeptT) -> None:
    kept[stamp_ns] = value
    while len(kept) > _UNDER_WAY:
        kept.popitem(last=False)
