"""The node lcd: graphs in, loop closures out; answers queries and forgets them."""

from __future__ import annotations

from adversarial_lcd_ros.start import run_node_process

if __name__ == '__main__':  # before the other imports: they take a second, and Ctrl-C may come
    raise SystemExit(run_node_process('lcd'))

from collections.abc import Sequence
import time
from typing import Any

from std_msgs.msg import UInt8MultiArray

from adversarial_lcd_ros import codec
from adversarial_lcd_ros.errors import AdversarialLcdError
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.nodes.endpoints import (
    MirroredSubscription,
    create_payload_publisher,
    payload_qos,
)
from adversarial_lcd_ros.nodes.runtime import Manual, PipelineNode, run_node
from adversarial_lcd_ros.payload import unwrap, wrap
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
                   'answer (std_msgs/UInt8MultiArray, LcdAnswer): one for each query, same id',
                   '/diagnostics (diagnostic_msgs/DiagnosticArray): counts, keyframes, latency'))

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.detector = LoopClosureDetector(self.settings[0])
        self.say('compiling')
        load_for_detector(self.settings[0])
        self._decisions = create_payload_publisher(self, 'loop_closures')
        self._answers = create_payload_publisher(self, 'answer')
        self._graphs = MirroredSubscription(
            self, UInt8MultiArray, 'graph', self._on_graph, raw=True)
        self._queries = self.create_subscription(
            UInt8MultiArray, 'query', self._on_query, payload_qos(), raw=True)
        self.diagnostics.gauges['keyframes'] = lambda: self.detector.keyframe_count

    def _on_graph(self, wire: bytes) -> None:
        arrival_s = time.perf_counter()
        self.diagnostics.count('received graphs')
        try:
            decision = self.detector.detect(codec.decode_graph(unwrap(wire)))
        except AdversarialLcdError as error:
            self.diagnostics.refuse('graph', error)
            return
        self._decisions.publish(wrap(codec.encode_loop_closure(decision)))
        self.diagnostics.count('published loop closures')
        self.diagnostics.count('loops declared', int(decision.is_loop))
        self.diagnostics.time(time.perf_counter() - arrival_s)

    def _on_query(self, wire: bytes) -> None:
        self.diagnostics.count('received queries')
        try:
            answer = self.detector.answer(codec.decode_query(unwrap(wire)))
        except AdversarialLcdError as error:
            self.diagnostics.refuse('query', error)
            return
        self._answers.publish(wrap(codec.encode_answer(answer)))
        self.diagnostics.count('published answers')


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; return its exit code."""
    return run_node(LcdNode, args)
