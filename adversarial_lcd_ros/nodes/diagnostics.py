# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Counts, rates and latencies of a node, published on /diagnostics once a second."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator
from functools import wraps
import socket
from threading import Lock
import time
import traceback
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from adversarial_lcd_ros.errors import AdversarialLcdError

PERIOD_S = 1.0
_LATE_S = 1.5 * PERIOD_S
TOPIC = '/diagnostics'
DEFECTS = 'defects'
_KEPT_LATENCIES = 1000
_THROTTLE_S = 5.0
_INPUT, _OUTPUT, _REFUSED = 'received ', 'published ', 'refused '


class Diagnostics:
    """
    What a node has counted, and what is wrong with it.

    Attributes
    ----------
    gauges : dict of str to callable
        Further values, read when a status goes out.
    problems : list of callable
        Each tells what is wrong at the moment, or ''; read when a status goes out.
    state : str
        What the node does before it takes messages; empty from then on.
    waiting_for : str
        What the node cannot start without; empty once it is there.

    """

    def __init__(self, node: Node, activity: str) -> None:
        self._node = node
        self._activity = activity
        self._lock, self._publishing = Lock(), Lock()
        self._counts: Counter[str] = Counter()
        self._worries: set[str] = set()
        self._said_s: dict[str, float] = {}
        self._latency_s: deque[float] = deque(maxlen=_KEPT_LATENCIES)
        self.gauges: dict[str, Callable[[], Any]] = {}
        self.problems: list[Callable[[], str]] = []
        self.state = self.waiting_for = ''
        self._last_counts: Counter[str] = Counter()
        self._last_s = time.monotonic()
        self._publisher = node.create_publisher(DiagnosticArray, TOPIC, 10)
        # Steady: in simulated time a timer is silent until the first /clock.
        self._timer = node.create_timer(PERIOD_S, self.guard('status', self.publish),
                                        clock=Clock(clock_type=ClockType.STEADY_TIME))

    def count(self, name: str, by: int = 1) -> None:
        """Add to a count; from any thread."""
        with self._lock:
            self._counts[name] += by

    def __getitem__(self, name: str) -> int:
        """Return a count; 0 where nothing was counted."""
        with self._lock:
            return self._counts[name]

    def time(self, latency_s: float) -> None:
        """Note the time from a message's arrival to the publication of what came of it."""
        with self._lock:
            self._latency_s.append(latency_s)

    def worry(self, name: str, text: str, by: int = 1, said_as: str = '') -> None:
        """Count something that should not be, and warn, of each at most every 5 seconds."""
        with self._lock:
            self._counts[name] += by
            self._worries.add(name)
        if self._is_due(name + said_as):
            self._node.get_logger().warning(f'{text} ({name}: {self[name]})')

    def refuse(self, what: str, error: Exception) -> None:
        """Count a message that was dropped, in all and by cause, and warn."""
        cause = getattr(error, 'cause', type(error).__name__)
        self.count(f'{_REFUSED}{what}: {cause}')
        self.worry(f'{_REFUSED}{what}', f'{what} refused: {error}', said_as=cause)

    def defect(self, what: str) -> None:
        """Count an error of our own in a callback; its traceback once, then a line at most."""
        count = self[DEFECTS]
        trace = traceback.format_exc()
        self.worry(DEFECTS, f'{what} dropped, a defect of this node: '
                   f'{trace.strip().splitlines()[-1]}')
        if not count:
            self._node.get_logger().error(f'please report this:\n{trace}')

    def guard(self, what: str, callback: Callable[..., Any]) -> Callable[..., None]:
        """
        Return a callback that survives any message.

        What this package refuses is counted by its cause; what it did not foresee, lack of
        memory included, as a defect.
        """
        @wraps(callback)
        def guarded(*arguments: Any) -> None:
            try:
                callback(*arguments)
            except AdversarialLcdError as error:
                self.refuse(what, error)
            except Exception:
                self.defect(what)
            self._catch_up()
        return guarded

    def _catch_up(self) -> None:
        """
        Publish the status where the timer does not get a turn.

        The executor of events works off messages in the order in which they came, those
        included that have given way to newer ones: a node with more of them than it can manage
        would be silent just then.
        """
        if time.monotonic() > self._last_s + _LATE_S:
            try:
                self.publish()
            except Exception:
                self.defect('status')

    def _is_due(self, key: str) -> bool:
        now_s = time.monotonic()
        with self._lock:
            before_s = self._said_s.get(key)
            if before_s is not None and now_s < before_s + _THROTTLE_S:
                return False
            self._said_s[key] = now_s
        return True

    def latency_ms(self) -> tuple[float, float]:
        """Return the median and the 99th percentile of the latest latencies, milliseconds."""
        with self._lock:
            latencies = list(self._latency_s)
        if not latencies:
            return 0.0, 0.0
        median, tail = np.percentile(latencies, (50, 99)) * 1e3
        return float(median), float(tail)

    def summary(self) -> str:
        """Return the counts in one line, for the end."""
        with self._lock:
            counts = {name: number for name, number in self._counts.items() if number}
        return ', '.join(f'{name} {counts[name]}' for name in sorted(counts)) or 'nothing received'

    def publish(self) -> None:
        """Publish the status of the node; from any thread."""
        with self._publishing:
            self._publish()

    def _publish(self) -> None:
        with self._lock:
            counts, worries = self._counts.copy(), set(self._worries)
        now_s = time.monotonic()
        new = counts - self._last_counts
        level, message = self._judge(new, [name for name in sorted(worries) if new[name]])
        status = DiagnosticStatus(
            name=f'{self._node.get_fully_qualified_name()[1:]}: {self._activity}',
            level=level, message=message, hardware_id=socket.gethostname(),
            values=[KeyValue(key=key, value=value)
                    for key, value in self._values(counts, new, now_s - self._last_s)])
        self._last_counts, self._last_s = counts, now_s
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)

    def _judge(self, new: Counter[str], worries: list[str]) -> tuple[bytes, str]:
        """Return the level of what happened since the last status, and its line."""
        parts = [f'{new[name]} {name} in the last second' for name in worries]
        parts += filter(None, (problem() for problem in self.problems))
        if self.state:
            parts.append(self.state)
        elif self.waiting_for:
            parts.append(f'waiting for {self.waiting_for}')
        message = '; '.join(parts) or 'ok'
        passed = any(number for name, number in new.items() if name.startswith(_OUTPUT))
        refused = any(name.startswith(_REFUSED) for name in worries)
        if DEFECTS in worries or (refused and not passed):
            return DiagnosticStatus.ERROR, message
        return (DiagnosticStatus.WARN if parts else DiagnosticStatus.OK), message

    def _values(self, counts: Counter[str], new: Counter[str],
                elapsed_s: float) -> Iterator[tuple[str, str]]:
        for name in sorted(counts):
            yield name, str(counts[name])
            if name.startswith((_INPUT, _OUTPUT)):
                yield f'{name} per second', f'{new[name] / elapsed_s:.1f}'
        median, tail = self.latency_ms()
        yield 'latency p50 ms', f'{median:.2f}'
        yield 'latency p99 ms', f'{tail:.2f}'
        for name, read in self.gauges.items():
            yield name, str(read())
