# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The node lcd: graphs in, loop closures out; answers queries and forgets them.

Graphs are taken from the subscription before each query, in one thread: the detector needs no
lock, and a decision waits for one query at most.
"""

from __future__ import annotations

from adversarial_lcd_ros.start import run_node_process

if __name__ == '__main__':  # before the other imports: they take a second, and Ctrl-C may come
    raise SystemExit(run_node_process('lcd'))

from collections.abc import Sequence
from dataclasses import replace
import time
from typing import Any

from std_msgs.msg import UInt8MultiArray

from adversarial_lcd_ros.errors import CodecError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.authentic import Gate
from adversarial_lcd_ros.messages.payload import unwrap, wrap
from adversarial_lcd_ros.nodes.decisions import PlainDecisions
from adversarial_lcd_ros.nodes.endpoints import (
    MirroredSubscription,
    create_payload_publisher,
    overridable,
    payload_qos,
)
from adversarial_lcd_ros.nodes.parameters import load_key
from adversarial_lcd_ros.nodes.runtime import Manual, PipelineNode, run_node
from adversarial_lcd_ros.nodes.streams import GraphWatch
from adversarial_lcd_ros.preloading import load_for_detector
from adversarial_lcd_ros.settings import NODE_CONFIGS


class LcdNode(PipelineNode):
    """Runs a LoopClosureDetector on topics."""

    default_name = 'lcd'
    configs = NODE_CONFIGS['lcd']
    manual = Manual(
        'loop closure detection on multi-tier graphs',
        subscribes=('graph (std_msgs/UInt8MultiArray, MultiTierGraph): judged, then remembered',
                    'query (std_msgs/UInt8MultiArray, LcdQuery): judged only'),
        publishes=('loop_closures (std_msgs/UInt8MultiArray, LoopClosure): one for each graph',
                   'probability (std_msgs/Float64), loop (std_msgs/Bool), match (std_msgs/Header: '
                   'stamp of the best matching keyframe): of each decision, for echo and plots',
                   'answer (std_msgs/UInt8MultiArray, LcdAnswer): one for each query, same id',
                   '/diagnostics (diagnostic_msgs/DiagnosticArray): counts, keyframes, latency'))

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        config, node_config, self._limits = self.settings
        key = load_key(node_config.key)
        self._gate = Gate(key, node_config.max_age_s, self._limits) if key else None
        self.detector = LoopClosureDetector(config)
        self.say('compiling')
        load_for_detector(config)
        self._rate = Rate(node_config.max_queries_per_s)
        self._watch = GraphWatch(self.diagnostics)
        self._decisions = create_payload_publisher(self, 'loop_closures')
        self._plain = PlainDecisions(self)
        self._answers = create_payload_publisher(self, 'answer')
        self._graphs = MirroredSubscription(
            self, UInt8MultiArray, 'graph', 'graph', self._on_graph, raw=True)
        self._queries = self.create_subscription(
            UInt8MultiArray, 'query', self.diagnostics.guard('query', self._on_query),
            payload_qos(), raw=True, qos_overriding_options=overridable())
        self.diagnostics.gauges['keyframes'] = lambda: self.detector.keyframe_count
        self.diagnostics.problems.append(lambda: '' if self.detector.has_room else
                                         'no room for further keyframes')
        self.say_ready(f'target {config.target}, threshold {config.threshold:g}, answers '
                       f'{"hard" if config.hard_answers else "soft"}, geometric check '
                       f'{"on" if config.geometric_check else "off"}')

    def _on_graph(self, wire: bytes) -> None:
        arrival_s = time.perf_counter()
        self.diagnostics.count('received graphs')
        payload = unwrap(wire, self._limits.max_payload_bytes)
        graph = (self._gate.take(payload) if self._gate
                 else codec.decode_graph(payload, self._limits))
        self._watch.note(graph)
        self._note_edges(graph)
        decision = replace(self.detector.detect(graph), session=self.session)
        self._decisions.publish(wrap(codec.encode_loop_closure(decision)))
        self._plain.publish(decision)
        self.diagnostics.count('published loop closures')
        self.diagnostics.count('loops declared', int(decision.is_loop))
        self.diagnostics.time(time.perf_counter() - arrival_s)

    def _note_edges(self, graph: MultiTierGraph) -> None:
        strange = self.detector.judging.scoring.unexplained(graph)
        if strange:
            self.diagnostics.count('graphs with unexplained edges')
            self.diagnostics.worry(
                'unexplained edges', f'{strange} of {graph.edge_count} edges do not follow from '
                'the nodes: somebody changed them, or graph_builder has another '
                'feature_neighbours than the defence expects (rederive_neighbours, or more than '
                'nearest_neighbours)', strange)

    def _on_query(self, wire: bytes) -> None:
        # Decisions first: however many queries wait, a graph waits for one of them at most.
        self._graphs.take_waiting()
        self.diagnostics.count('received queries')
        self._rate.take()
        query = codec.decode_query(unwrap(wire, self._limits.max_payload_bytes), self._limits)
        answer = replace(self.detector.answer(query), session=self.session)
        self._answers.publish(wrap(codec.encode_answer(answer)))
        self.diagnostics.count('published answers')


class Rate:
    """
    So many things a second, those of a second at once.

    Parameters
    ----------
    per_s : int

    """

    def __init__(self, per_s: int) -> None:
        self._per_s = per_s
        self._left = float(per_s)
        self._last_s = time.monotonic()

    def take(self) -> None:
        """Count one; raises CodecError where it is one too many."""
        now_s = time.monotonic()
        self._left = min(float(self._per_s),
                         self._left + (now_s - self._last_s) * self._per_s)
        self._last_s = now_s
        if self._left < 1:
            raise CodecError(f'more than {self._per_s} a second (parameter max_queries_per_s)',
                             cause='rate')
        self._left -= 1


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; return its exit code."""
    return run_node(LcdNode, args)
