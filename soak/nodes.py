"""Faults and floods against living nodes, each in a process of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

import numpy as np

from adversarial_lcd_ros.errors import CodecError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages.codec import decode_graph, decode_loop_closure, encode_graph
from adversarial_lcd_ros.messages.payload import unwrap, wrap
from adversarial_lcd_ros.paths import share_path
from soak.inputs import damaged, graph
from soak.outcome import Outcome, Slope, resident_mb

_READY_S, _ANSWER_S = 120.0, 60.0
# So many damaged messages go out before a valid one, whose answer is waited for.
_BURST = 40
# Where a node listens, and where its work comes out.
_TOPICS = {'lcd': ('graph', 'loop_closures', decode_loop_closure),
           'attacker': ('graph_clean', 'graph', decode_graph)}


class World:
    """A probe of ours, and one node in a process of its own, on this machine alone."""

    def __init__(self, node: str, parameters: Sequence[str]) -> None:
        import rclpy
        from rclpy.qos import QoSProfile
        from std_msgs.msg import UInt8MultiArray

        topic, answers, decode = _TOPICS[node]
        environment = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
                       'ROS_DOMAIN_ID': str(1 + os.getpid() % 100),
                       'FASTRTPS_DEFAULT_PROFILES_FILE': str(share_path('config/fastdds.xml'))}
        # DDS reads them when a context begins.
        self._before = dict(os.environ)
        os.environ.update(environment)
        self._rclpy = rclpy
        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context)
        self.probe = rclpy.create_node('soak', context=self._context)
        self.executor = rclpy.executors.SingleThreadedExecutor(context=self._context)
        self.executor.add_node(self.probe)
        quality = QoSProfile(depth=1000)
        self.heard: list[int] = []
        self.publisher = self.probe.create_publisher(UInt8MultiArray, topic, quality)
        self.probe.create_subscription(UInt8MultiArray, answers, self._listen(decode), quality,
                                       raw=True)
        arguments = [part for entry in parameters for part in ('-p', entry)]
        self.process = subprocess.Popen(
            [sys.executable, '-m', f'adversarial_lcd_ros.nodes.{node}', '--ros-args', *arguments],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)

    def _listen(self, decode: Callable[[bytes], Any]) -> Callable[[bytes], None]:
        def hear(wire: bytes) -> None:
            try:
                self.heard.append(int(decode(unwrap(wire)).sequence))
            except CodecError:
                pass  # the attacker forwards what it cannot read
        return hear

    def until(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Run callbacks until something holds, the node ends, or the time is over."""
        end = time.monotonic() + seconds
        while not condition():
            if self.process.poll() is not None or time.monotonic() > end:
                return False
            self.executor.spin_once(timeout_sec=0.01)
        return True

    def close(self) -> int | None:
        """End the node as a user would; return its exit code, None if it had to be killed."""
        self.process.send_signal(signal.SIGINT)
        try:
            code: int | None = self.process.wait(20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            code = None
        self.probe.destroy_node()
        self.executor.shutdown()
        self._rclpy.shutdown(context=self._context)
        os.environ.clear()
        os.environ.update(self._before)
        return code


@contextmanager
def _world(node: str, parameters: Sequence[str], outcome: Outcome) -> Iterator[World | None]:
    world = World(node, parameters)
    ready = world.until(lambda: world.publisher.get_subscription_count() > 0
                        and world.probe.count_publishers(_TOPICS[node][1]) > 0, _READY_S)
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


def flood(node: str, count: int, seed: int = 0) -> Outcome:
    """Send a living node so many damaged messages, and valid ones between them."""
    outcome = Outcome(f'damaged messages to a living {node}',
                      'it lives, and each valid graph between them is answered')
    rng, slope = np.random.default_rng(seed), Slope()
    base = [encode_graph(graph(nodes, nodes)) for nodes in (12, 40)]
    parameters = ('mode:=pass',) if node == 'attacker' else ('max_keyframes:=200',)
    with _world(node, parameters, outcome) as world:
        for number in range(count if world else 0):
            data = wrap(damaged(base[number % 2], base[1 - number % 2], rng))
            world.publisher.publish(data)
            outcome.outcomes['sent damaged'] += 1
            if number % _BURST == _BURST - 1:
                asked = 10**6 + number
                world.publisher.publish(wrap(encode_graph(
                    graph(40, 1, stamp_ns=asked * 10**7, sequence=asked))))
                if not world.until(lambda asked=asked: asked in world.heard, _ANSWER_S):
                    outcome.outcomes['BROKEN a valid graph was not answered'] += 1
                    break
                world.heard.clear()
                outcome.outcomes['valid graph answered'] += 1
                slope.add(number, resident_mb(world.process.pid))
        if world:
            outcome.note = slope.text(1000, 'per 1000 messages')
    return outcome


def stream(nodes: int, rate_hz: float, seconds: float, node: str = 'lcd') -> Outcome:
    """Send a living node valid graphs at a rate; count what comes out, and what is missing."""
    outcome = Outcome(f'graphs of {nodes} nodes to {node} at {rate_hz:g} Hz for {seconds:g} s',
                      'it lives; each graph is answered or counted as lost')
    slope = Slope()
    several = [graph(nodes, seed) for seed in range(20)]
    with _world(node, ('max_keyframes:=300',), outcome) as world:
        if not world:
            return outcome
        sent, began = 0, time.monotonic()
        while time.monotonic() - began < seconds and world.process.poll() is None:
            while sent <= (time.monotonic() - began) * rate_hz:
                world.publisher.publish(wrap(encode_graph(_numbered(several[sent % 20], sent))))
                sent += 1
            world.executor.spin_once(timeout_sec=0.5 / rate_hz)
            if sent % max(int(rate_hz * seconds) // 60, 1) == 0:
                slope.add(time.monotonic() - began, resident_mb(world.process.pid))
        before = -1
        while before != len(world.heard):  # until nothing comes any more
            before = len(world.heard)
            world.until(lambda before=before: len(world.heard) > before, 3.0)
        answered = len(set(world.heard))
        outcome.outcomes['answered'] += answered
        outcome.outcomes['lost: the queue holds 100'] += sent - answered
        if len(world.heard) != answered:
            outcome.outcomes['BROKEN answered twice'] += len(world.heard) - answered
        if answered == 0:
            outcome.outcomes['BROKEN none answered'] += 1
        outcome.note = slope.text(60, 'a minute')
    return outcome


def _numbered(one: MultiTierGraph, number: int) -> MultiTierGraph:
    from dataclasses import replace
    return replace(one, sequence=number, stamp_ns=10**9 + number * 10**7)


def killed_by_file(path: Path) -> Outcome:
    """Send a living lcd one payload of a file, and a valid graph after it."""
    outcome = Outcome(f'the payload {path.name} to a living lcd', 'refused; it lives')
    with _world('lcd', (), outcome) as world:
        if world:
            world.publisher.publish(wrap(path.read_bytes()))
            world.publisher.publish(wrap(encode_graph(graph(12, 1, sequence=7))))
            answered = world.until(lambda: 7 in world.heard, _ANSWER_S)
            outcome.outcomes['lived' if answered else 'BROKEN no answer after it'] += 1
    return outcome
