# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Which sealed graphs are taken: each once, in order, soon after it was made.

Within a run of the builder, sequence numbers must rise. A builder that was started again is told
by its session, and must have been started later than the one before it: a recording of an earlier
run does not come back. What is left is a detector that was itself started again and knows of no
run: therefore a graph must also have been sealed at most ``max_age_s`` ago, by the clocks of both
machines, so that it can be made to believe in seconds of the past, not in days.
"""

from __future__ import annotations

from collections import deque
import time

from adversarial_lcd_ros.config import MessageLimits
from adversarial_lcd_ros.errors import CodecError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages.codec import LIMITS, decode_graph
from adversarial_lcd_ros.messages.sealing import Buffer, opened

# Numbers remembered to tell a graph that comes again from one that comes late: both are refused.
_REMEMBERED = 1000
_NS = 1_000_000_000


class Gate:
    """
    Takes the graphs of one builder at a time.

    Parameters
    ----------
    key : bytes
        That of the builder.
    max_age_s : float
        How long ago, or ahead, a graph may have been sealed; 0: any time.
    limits : MessageLimits

    """

    def __init__(self, key: bytes, max_age_s: float = 0.0,
                 limits: MessageLimits = LIMITS) -> None:
        self._key, self._limits = key, limits
        self._max_age_ns = round(max_age_s * _NS)
        self._started_ns, self._session, self._last = -1, 0, -1
        self._taken: deque[int] = deque(maxlen=_REMEMBERED)

    def take(self, sealed: Buffer, now_ns: int | None = None) -> MultiTierGraph:
        """
        Return the graph under a seal.

        Nothing is decoded before its tag was found right. A graph that is refused leaves no trace.

        Parameters
        ----------
        sealed : bytes
        now_ns : int, optional
            Nanoseconds since 1970; the clock's if not given.

        Raises
        ------
        CodecError
            It is not authentic (causes ``unsealed``, ``seal``), is not the next one (``age``,
            ``run``, ``replayed``, ``reordered``), or is no graph.

        """
        payload, started_ns, sealed_ns = opened(sealed, self._key)
        self._check_age(sealed_ns, time.time_ns() if now_ns is None else now_ns)
        graph = decode_graph(payload, self._limits)
        if started_ns > self._started_ns:
            self._taken.clear()
        else:
            self._check_place(graph, started_ns)
        self._started_ns, self._session = started_ns, graph.session
        self._last = graph.sequence
        self._taken.append(graph.sequence)
        return graph

    def _check_age(self, sealed_ns: int, now_ns: int) -> None:
        if self._max_age_ns and abs(now_ns - sealed_ns) > self._max_age_ns:
            raise CodecError(
                f'graph sealed {(now_ns - sealed_ns) / _NS:.3g} s ago: expected at most '
                f'{self._max_age_ns / _NS:g} s, ahead or behind (parameter max_age_s); is it a '
                'replay, or do the clocks of the machines differ?', cause='age')

    def _check_place(self, graph: MultiTierGraph, started_ns: int) -> None:
        if started_ns < self._started_ns or graph.session != self._session:
            raise CodecError('graph of another run of the builder than the latest: a replay, or '
                             'two builders with one key', cause='run')
        if graph.sequence in self._taken:
            raise CodecError(f'graph number {graph.sequence} was taken before', cause='replayed')
        if graph.sequence < self._last:
            raise CodecError(f'graph number {graph.sequence} after number {self._last}: expected '
                             'rising numbers', cause='reordered')
