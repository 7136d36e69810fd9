# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The node attacker: a man in the middle on the topic that carries the graphs.

It never drops a graph: what cannot be attacked, or not even decoded, goes on as it came. Edits can
be read off the two graph topics, queries cannot: hence reports, which the detector never sees.
"""

from __future__ import annotations

from adversarial_lcd_ros.start import run_node_process

if __name__ == '__main__':  # before the other imports: they take a second, and Ctrl-C may come
    raise SystemExit(run_node_process('attacker'))

from collections import deque
from collections.abc import Sequence
from concurrent.futures import wait
from dataclasses import replace
from threading import Condition, Thread
import time
from typing import Any

from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from std_msgs.msg import UInt8MultiArray

from adversarial_lcd_ros.attack.attacker import Attacker, AttackResult
from adversarial_lcd_ros.attack.oracle import DEADLINE
from adversarial_lcd_ros.errors import CodecError, ConfigError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.payload import unwrap, wrap
from adversarial_lcd_ros.nodes.endpoints import MirroredSubscription, create_payload_publisher
from adversarial_lcd_ros.nodes.oracle import TopicOracle
from adversarial_lcd_ros.nodes.runtime import Manual, PipelineNode, run_node
from adversarial_lcd_ros.nodes.sideline import Sideline
from adversarial_lcd_ros.nodes.streams import GraphWatch
from adversarial_lcd_ros.preloading import load_for_attacker
from adversarial_lcd_ros.settings import NODE_CONFIGS

INPUT, OUTPUT = 'graph_clean', 'graph'
# A search that looks at the clock ends by itself soon after the deadline.
_GRACE_S = 0.002


class AttackerNode(PipelineNode):
    """
    Runs an Attacker between two topics; whatever comes in goes out, in the same order.

    The executor's thread only queues graphs and takes answers; a worker attacks and publishes.
    """

    default_name = 'attacker'
    configs = NODE_CONFIGS['attacker']
    manual = Manual(
        'man in the middle that perturbs the edges of multi-tier graphs',
        subscribes=(f'{INPUT} (std_msgs/UInt8MultiArray, MultiTierGraph)',
                    'answer (std_msgs/UInt8MultiArray, LcdAnswer)'),
        publishes=(f'{OUTPUT} (std_msgs/UInt8MultiArray, MultiTierGraph): one for each received, '
                   "with the QoS of the input's publisher",
                   'query (std_msgs/UInt8MultiArray, LcdQuery)',
                   'attack_report (std_msgs/UInt8MultiArray, AttackReport): one for each graph',
                   '/diagnostics (diagnostic_msgs/DiagnosticArray): counts, budgets, latency'))

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._config, self._node_config, self._limits = self.settings
        self._refuse_loop()
        self._attacker = Attacker(self._config)
        self.say('compiling')
        load_for_attacker(self._config)
        self._oracle = TopicOracle(self, self.diagnostics, self._node_config.query_timeout_s)
        self._watch = GraphWatch(self.diagnostics)
        self._reports = create_payload_publisher(self, 'attack_report')
        self._output: Publisher | None = None
        self._waiting: deque[tuple[bytes, float]] = deque()
        self._arrived = Condition()
        self._catching_up = False
        self._closing = False
        self.diagnostics.waiting_for = f'a publisher of {self.resolve_topic_name(INPUT)}'
        self.diagnostics.gauges['waiting graphs'] = lambda: len(self._waiting)
        self._search = Sideline('search') if self._config.deadline_ms else None
        self._forward_guarded = self.diagnostics.guard('graph', self._forward)
        self._worker = Thread(target=self._run, name='attack', daemon=True)
        self._worker.start()
        self._input = MirroredSubscription(self, UInt8MultiArray, INPUT, 'graph', self._on_graph,
                                           raw=True, prepare=self._open_output)
        self.say_ready(f'mode {self._config.mode}, {self._config.perturbation}, deadline '
                       f'{self._config.deadline_ms:g} ms', OUTPUT)

    def _refuse_loop(self) -> None:
        topic = self.resolve_topic_name(INPUT)
        if topic == self.resolve_topic_name(OUTPUT):
            raise ConfigError(f'{INPUT} and {OUTPUT} both resolve to {topic}: the attacker would '
                              f'attack its own output; remap one of them')

    def _open_output(self, qos: QoSProfile) -> bool:
        """Publish as the input is published; take graphs in once someone listens to them."""
        if self._output is None:
            self._output = create_payload_publisher(self, OUTPUT, qos)
            self.diagnostics.waiting_for = f'a subscriber of {self.resolve_topic_name(OUTPUT)}'
        if not self._output.get_subscription_count():
            return False
        self.diagnostics.waiting_for = ''
        if self.count_publishers(OUTPUT) > 1:
            self.get_logger().warning(
                f'{self.resolve_topic_name(OUTPUT)} has another publisher: the detector gets '
                f'clean graphs too. Remap the builder: -r {OUTPUT}:={INPUT}')
        return True

    def _on_graph(self, wire: bytes) -> None:
        self.diagnostics.count('received graphs')
        with self._arrived:
            self._waiting.append((wire, time.monotonic()))
            if len(self._waiting) > self._node_config.max_backlog:
                self._catching_up = True
                self._oracle.interrupt()
            self._arrived.notify()

    def _run(self) -> None:
        while True:
            with self._arrived:
                if not self._waiting and self._catching_up and not self._closing:
                    self._catching_up = False
                    self._oracle.interrupt(False)
                self._arrived.wait_for(lambda: self._waiting or self._closing)
                if not self._waiting:
                    return
                wire, arrival_s = self._waiting.popleft()
            self._forward_guarded(wire, arrival_s)

    def _forward(self, wire: bytes, arrival_s: float) -> None:
        """Publish what becomes of one message: attacked, or byte for byte as it came."""
        result, forwarded = None, wire
        try:
            graph = codec.decode_graph(unwrap(wire, self._limits.max_payload_bytes), self._limits)
            self._watch.note(graph)
            result = self._attack(graph, arrival_s)
            if result.perturbed is not result.clean:
                forwarded = wrap(codec.encode_graph(result.perturbed))
        except CodecError as error:
            # Dropping what it cannot read would give the man in the middle away.
            self.diagnostics.worry('forwarded unread', f'graph forwarded unread: {error}',
                                   said_as=error.cause)
            self.diagnostics.count(f'forwarded unread: {error.cause}')
        except Exception:
            # The worker outlives a defect of an attack: graphs must go on flowing.
            self.diagnostics.count('failed attacks')
            self.diagnostics.defect('attack')
        self._publish(forwarded, result, arrival_s)

    def _publish(self, forwarded: bytes, result: AttackResult | None, arrival_s: float) -> None:
        assert self._output is not None
        self._output.publish(forwarded)
        duration_s = time.monotonic() - arrival_s
        self.diagnostics.count('published graphs')
        self.diagnostics.time(duration_s)
        if result is not None:
            self._report(result, duration_s)

    def _attack(self, graph: MultiTierGraph, arrival_s: float) -> AttackResult:
        if self._catching_up or self._closing:
            reason = 'closing' if self._closing else 'backlog'
            return AttackResult(graph, graph, 'skipped', reason)
        result = (self._attacker.process(graph, self._oracle.ask) if self._search is None else
                  self._attack_until(graph, arrival_s + self._config.deadline_ms / 1e3))
        if self._catching_up and result.reason == 'no answer':
            return replace(result, reason='backlog')
        return result

    def _attack_until(self, graph: MultiTierGraph, deadline_s: float) -> AttackResult:
        """Attack a graph in another thread; take what there is at the deadline."""
        assert self._search is not None

        def attack() -> AttackResult:
            self._oracle.end_at(deadline_s)
            return self._attacker.attack(graph, self._oracle.ask, deadline_s)

        found = self._search.do(attack)
        wait([found], max(0.0, deadline_s + _GRACE_S - time.monotonic()))
        if found.done():
            result = found.result()
        else:
            self.diagnostics.count('searches cut off')
            result = (AttackResult(graph, graph, 'skipped', DEADLINE) if found.cancel()
                      else self._attacker.so_far(graph))
        self._search.do(lambda: self._attacker.observe(result.perturbed))
        return result

    def _report(self, result: AttackResult, duration_s: float) -> None:
        report = result.report(duration_s)
        self._reports.publish(wrap(codec.encode_attack_report(report)))
        for name, by in ((f'attacks {report.status}', 1), ('edits spent', report.edits),
                         ('edits granted', report.edit_budget),
                         ('queries granted', report.query_budget),
                         ('skipped for backlog', int(report.reason == 'backlog'))):
            self.diagnostics.count(name, by)

    def close(self) -> None:
        """End the attack under way, forward what waits, stop the worker."""
        with self._arrived:
            self._closing = True
            self._oracle.interrupt()
            self._arrived.notify()
        self._worker.join()
        if self._search is not None:
            self._search.close()

    def destroy_node(self) -> None:
        """Stop the worker before its publishers go."""
        self.close()
        super().destroy_node()


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; return its exit code."""
    return run_node(AttackerNode, args)
