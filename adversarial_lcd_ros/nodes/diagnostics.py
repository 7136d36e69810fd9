"""Counts, rates and latencies of a node, published on /diagnostics once a second."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator
from threading import Lock
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

PERIOD_S = 1.0
TOPIC = '/diagnostics'
_KEPT_LATENCIES = 1000
_THROTTLE_S = 5.0


class Diagnostics:
    """
    What a node has counted.

    Attributes
    ----------
    gauges : dict of str to callable
        Further values, read when a status goes out.
    state : str
        What the node does before it takes messages; empty from then on.
    waiting_for : str
        What the node cannot start without; empty once it is there.

    """

    def __init__(self, node: Node, activity: str) -> None:
        self._node = node
        self._activity = activity
        self._lock = Lock()
        self._counts: Counter[str] = Counter()
        self._latency_s: deque[float] = deque(maxlen=_KEPT_LATENCIES)
        self.gauges: dict[str, Callable[[], Any]] = {}
        self.state = self.waiting_for = ''
        self._last_counts: Counter[str] = Counter()
        self._last_s = time.monotonic()
        self._publisher = node.create_publisher(DiagnosticArray, TOPIC, 10)
        # Steady: in simulated time a timer is silent until the first /clock.
        self._timer = node.create_timer(PERIOD_S, self.publish,
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

    def refuse(self, what: str, error: Exception) -> None:
        """Count a message that was dropped, and warn, but not thirty times a second."""
        self.count(f'refused {what}')
        self._node.get_logger().warning(f'{what} refused: {error}',
                                        throttle_duration_sec=_THROTTLE_S)

    def latency_ms(self) -> tuple[float, float]:
        """Return the median and the 99th percentile of the latest latencies, milliseconds."""
        with self._lock:
            latencies = list(self._latency_s)
        if not latencies:
            return 0.0, 0.0
        median, tail = np.percentile(latencies, (50, 99)) * 1e3
        return float(median), float(tail)

    def publish(self) -> None:
        """Publish the status of the node."""
        with self._lock:
            counts = self._counts.copy()
        now_s = time.monotonic()
        new = counts - self._last_counts
        refused = sum(number for name, number in new.items() if name.startswith('refused'))
        status = DiagnosticStatus(
            name=f'{self._node.get_fully_qualified_name()[1:]}: {self._activity}',
            level=DiagnosticStatus.WARN if refused else DiagnosticStatus.OK,
            message=self._message(refused),
            values=[KeyValue(key=key, value=value)
                    for key, value in self._values(counts, new, now_s - self._last_s)])
        self._last_counts, self._last_s = counts, now_s
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)

    def _message(self, refused: int) -> str:
        if refused:
            return f'{refused} messages refused in the last second'
        if self.state:
            return self.state
        return f'waiting for {self.waiting_for}' if self.waiting_for else 'ok'

    def _values(self, counts: Counter[str], new: Counter[str],
                elapsed_s: float) -> Iterator[tuple[str, str]]:
        for name in sorted(counts):
            yield name, str(counts[name])
            if name.startswith(('received', 'published')):
                yield f'{name} per second', f'{new[name] / elapsed_s:.1f}'
        median, tail = self.latency_ms()
        yield 'latency p50 ms', f'{median:.2f}'
        yield 'latency p99 ms', f'{tail:.2f}'
        for name, read in self.gauges.items():
            yield name, str(read())
