# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A node in a process of its own, and a probe of ours that speaks and listens to it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import os
import signal
import subprocess
import sys
import time
from typing import Any

from adversarial_lcd_ros.errors import CodecError
from adversarial_lcd_ros.evaluation.replay.domain import own_domain
from adversarial_lcd_ros.evaluation.replay.processes import node_environment
from adversarial_lcd_ros.messages.codec import decode_graph, decode_loop_closure
from adversarial_lcd_ros.messages.payload import unwrap
from soak.outcome import Outcome

_READY_S, _END_S = 300.0, 60.0
# Diagnostics come once a second, where the machine is not busy.
_STATUS_S = 60.0
# What a node hears, the topic of its work first; and where its work comes out.
HEARS = {'lcd': ('graph', 'query'), 'attacker': ('graph_clean', 'answer'),
         'graph_builder': ('image', 'image/compressed')}
_ANSWERS: dict[str, tuple[str, Callable[[bytes], Any]]] = {
    'lcd': ('loop_closures', decode_loop_closure), 'attacker': ('graph', decode_graph),
    'graph_builder': ('graph', decode_graph)}


class World:
    """
    A probe, and one node.

    Attributes
    ----------
    heard : list of int
        Stamps of what came out of the node, ns.
    counts : dict of str to str
        What the node said last on /diagnostics.
    statuses : int
        How often it did.

    """

    def __init__(self, node: str, parameters: Sequence[str]) -> None:
        from diagnostic_msgs.msg import DiagnosticArray
        import rclpy
        from rclpy.qos import QoSProfile
        from sensor_msgs.msg import CompressedImage, Image
        from std_msgs.msg import UInt8MultiArray

        kinds = {'image': Image, 'image/compressed': CompressedImage}
        self._rclpy, self._context = rclpy, rclpy.Context()
        rclpy.init(args=[], context=self._context)
        self.probe = rclpy.create_node('soak', context=self._context)
        self.executor = rclpy.executors.SingleThreadedExecutor(context=self._context)
        self.executor.add_node(self.probe)
        quality = QoSProfile(depth=1000)
        self.heard: list[int] = []
        self.counts: dict[str, str] = {}
        self.statuses = 0
        self.publishers = [
            self.probe.create_publisher(kinds.get(topic, UInt8MultiArray), topic, quality)
            for topic in HEARS[node]]
        self.answers, decode = _ANSWERS[node]
        self.probe.create_subscription(UInt8MultiArray, self.answers, self._listen(decode),
                                       quality, raw=True)
        self.probe.create_subscription(DiagnosticArray, '/diagnostics', self._note, quality)
        arguments = [part for entry in parameters for part in ('-p', entry)]
        self.process = subprocess.Popen(
            [sys.executable, '-m', f'adversarial_lcd_ros.nodes.{node}', '--ros-args', *arguments],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)

    def _listen(self, decode: Callable[[bytes], Any]) -> Callable[[bytes], None]:
        def hear(wire: bytes) -> None:
            try:
                self.heard.append(int(decode(unwrap(wire)).stamp_ns))
            except CodecError:
                pass  # the attacker forwards what it cannot read
        return hear

    def _note(self, message: Any) -> None:
        self.counts = {entry.key: entry.value for entry in message.status[0].values}
        self.statuses += 1

    def count(self, name: str) -> int:
        """Return what the node counts under a name."""
        return int(self.counts.get(name, 0))

    def until(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Run callbacks until something holds, the node ends, or the time is over."""
        end = time.monotonic() + seconds
        while not condition():
            if self.process.poll() is not None or time.monotonic() > end:
                return False
            self.executor.spin_once(timeout_sec=0.01)
        return True

    def settle(self) -> None:
        """Wait until the node has worked off what it got, and has told its counts."""
        before: dict[str, str] | None = None
        while before != self._work():
            before, told = self._work(), self.statuses
            if not self.until(lambda told=told: self.statuses > told + 1,  # type: ignore[misc]
                              _STATUS_S):
                return

    def _work(self) -> dict[str, str]:
        return {name: value for name, value in self.counts.items()
                if name.startswith(('received', 'published')) and 'per second' not in name}

    def ready(self) -> bool:
        """Wait until both hear each other."""
        return self.until(lambda: all(publisher.get_subscription_count()
                                      for publisher in self.publishers)
                          and self.probe.count_publishers(self.answers) > 0
                          and self.statuses > 0, _READY_S)

    def close(self) -> int | None:
        """End the node as a user would; return its exit code, None if it had to be killed."""
        self.process.send_signal(signal.SIGINT)
        try:
            code: int | None = self.process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            code = None
        self.executor.shutdown()
        self.probe.destroy_node()
        self._context.shutdown()
        return code


@contextmanager
def living(node: str, parameters: Sequence[str], outcome: Outcome) -> Iterator[World | None]:
    """Run a node in a domain of its own; None if it is not ready. Notes how it ended."""
    before = dict(os.environ)
    with own_domain() as domain:
        # DDS reads them when a context begins.
        os.environ.update(node_environment(domain))
        world = World(node, parameters)
        ready = world.ready()
        try:
            if not ready:
                outcome.outcomes['BROKEN the node was not ready'] += 1
            yield world if ready else None
        finally:
            if world.process.poll() is not None:
                outcome.outcomes[f'BROKEN the node ended with {world.process.returncode}'] += 1
                world.close()
            elif world.close() != 0:
                outcome.outcomes['BROKEN the node did not end on SIGINT with 0'] += 1
            os.environ.clear()
            os.environ.update(before)
