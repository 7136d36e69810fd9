# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node bag_replay: a bag's frames in, in real time or in lockstep with the decisions."""

from __future__ import annotations

from adversarial_lcd_ros.start import run_node_process

if __name__ == '__main__':  # before the other imports: they take a second, and Ctrl-C may come
    raise SystemExit(run_node_process('bag_replay'))

from collections.abc import Callable, Sequence
from contextlib import suppress
import importlib
from pathlib import Path
import struct
import time
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from std_msgs.msg import UInt8MultiArray

from adversarial_lcd_ros.attack.images.posting import Posting
from adversarial_lcd_ros.errors import CodecError, ConfigError, EvaluationError, SequenceError
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.authentic import Gate
from adversarial_lcd_ros.messages.payload import WIRE_TYPE, unwrap
from adversarial_lcd_ros.nodes.endpoints import MirroredSubscription, payload_qos
from adversarial_lcd_ros.nodes.parameters import load_key
from adversarial_lcd_ros.nodes.peers import Listening, Strangers, getting_ready
from adversarial_lcd_ros.nodes.progress import progress
from adversarial_lcd_ros.nodes.runtime import EXIT_OK, Manual, PipelineNode, run_node
from adversarial_lcd_ros.nodes.streams import SessionWatch
from adversarial_lcd_ros.sequences.cdr import cdr_stamp_ns
from adversarial_lcd_ros.sequences.replay import BagRecorder, Replay
from adversarial_lcd_ros.settings import NODE_CONFIGS
from adversarial_lcd_ros.start import report

GRAPHS = CLEAN, FORWARDED = 'graph_clean', 'graph'
DECISIONS, REPORTS = 'loop_closures', 'attack_report'
RECORDED = (*GRAPHS, DECISIONS, REPORTS)
_NOUNS = dict.fromkeys(GRAPHS, 'graph') | {DECISIONS: 'loop closure', REPORTS: 'report'}
_DEPTH = 10
_CLOCK_PERIOD_S = 0.025
_SPIN_S = 0.1
# A gap that looks like a replay which hangs.
_LONG_S = 10.0
# The other ends have matched as seen from here; this is for them to see it too, and each other.
# A quarter of a second was too short once on a busy machine: the first graph was lost. Nodes of
# this package say when they do; a listener whose QoS does not fit is never matched.
_SETTLE_S, _LONGEST_SETTLE_S = 1.0, 20.0
# Where nodes that have not found each other yet would lose the first frame, or an answer.
_HEARD = (*RECORDED, 'answer')
_LOOK_PERIOD_S = 1.0
# What a supervisor is told once the other nodes are there.
_PLAYING = 'playing'


class Stopped(Exception):  # noqa: N818
    """The process was asked to stop."""


class BagReplayNode(PipelineNode):
    """
    Publishes the messages of a bag byte for byte, and may record what comes of them.

    With a poster, frames of the spans that it is seen in are changed, and nothing else.
    """

    default_name = 'bag_replay'
    configs = NODE_CONFIGS['bag_replay']
    manual = Manual(
        'replay of a bag, in real time or in lockstep with the decisions',
        subscribes=('loop_closures (std_msgs/UInt8MultiArray, LoopClosure)',
                    'graph_clean, graph, attack_report: only to record them'),
        publishes=("the bag's topics under relative names (/image/compressed: image/compressed)",
                   '/clock (rosgraph_msgs/Clock)',
                   '/diagnostics (diagnostic_msgs/DiagnosticArray): counts, rates, latency'))

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._config, node_config = self.settings
        self._records_frames = bool(node_config.record and node_config.record_frames)
        if not node_config.bag:
            raise ConfigError('parameter bag is empty: give the bag to replay, -p bag:=PATH')
        self._replay = Replay(Path(node_config.bag), self._config)
        self._posting = Posting(self._config, self._replay.first_ns)
        self._outputs = {topic: self._open(topic, message_type)
                            for topic, message_type in self._replay.topics.items()}
        self._clock_output = (self.create_publisher(Clock, '/clock', 10)
                              if self._config.clock else None)
        self._recorder = BagRecorder(Path(node_config.record)) if node_config.record else None
        key = load_key(node_config.key)
        # What lcd refuses is known here, too: it takes the same graphs in the same order.
        self._gate = Gate(key) if key and self._config.lockstep else None
        heard = RECORDED if self._recorder else (DECISIONS, *(FORWARDED,) * bool(self._gate))
        self._inputs = {
            topic: MirroredSubscription(self, UInt8MultiArray, topic, _NOUNS[topic],
                                        self._handler(topic), raw=True)
            for topic in heard}
        self._broken: Exception | None = None
        self._restarts = SessionWatch(self.diagnostics, 'lcd', 'its keyframes are gone')
        self._strangers = Strangers(self, RECORDED)
        self._look_due_s = 0.0
        self._under_way: dict[int, float] = {}
        self._published = self._decided = self._time_ns = 0
        self._origin: tuple[float, int] | None = None
        self._clock_due_s = 0.0
        self._spin: Callable[[float], bool] = lambda seconds: False
        self.say_ready(f'{self._replay.frame_count} frames of {node_config.bag}')

    def _open(self, topic: str, message_type: str) -> Publisher:
        package, _, name = message_type.partition('/msg/')
        try:
            message = getattr(importlib.import_module(f'{package}.msg'), name)
        except (ImportError, AttributeError) as error:
            raise SequenceError(f'{topic} has type {message_type}, which is not installed here: '
                                f'{error}') from error
        return self.create_publisher(message, topic.lstrip('/'), payload_qos(_DEPTH))

    def _handler(self, topic: str) -> Callable[[bytes], None]:
        def on_message(wire: bytes) -> None:
            self.diagnostics.count(f'received {topic}')
            if self._recorder:
                self._strangers.heard(topic, wire)
            self._record(topic, wire)
            if topic == DECISIONS:
                self._on_decision(wire)
            elif topic == FORWARDED and self._gate:
                self._look_at_seal(self._gate, unwrap(wire))
        return on_message

    def _look_at_seal(self, gate: Gate, payload: bytes) -> None:
        """Wait no longer for the decision on a graph that is refused."""
        try:
            gate.take(payload)
        except CodecError:
            with suppress(SequenceError, struct.error):  # no header: it is of no frame
                if self._under_way.pop(cdr_stamp_ns(payload), None) is not None:
                    self.diagnostics.count('refused by lcd')

    def _record(self, topic: str, wire: bytes, message_type: str = WIRE_TYPE) -> None:
        if self._recorder is None or self._broken is not None:
            return
        try:
            self._recorder.write(topic, message_type, self._time_ns, wire)
        except Exception as error:
            # Callbacks survive anything; a recording with holes must not.
            self._broken = error

    def _on_decision(self, wire: bytes) -> None:
        decision = codec.decode_loop_closure(unwrap(wire))
        self._restarts.note(decision.session)
        published_s = self._under_way.pop(decision.stamp_ns, None)
        if published_s is None:
            self.diagnostics.worry('decisions not asked for', 'a decision on a frame that was not '
                                   'published here, or decided twice')
        else:
            self._decided += 1
            self.diagnostics.time(time.monotonic() - published_s)

    def work(self, spin: Callable[[float], bool]) -> int:
        """Replay the bag, then return the exit code; see PipelineNode."""
        self._spin = spin
        try:
            self._await_listeners()
            report(_PLAYING)
            began_s = time.monotonic()
            with progress(self.default_name, self._replay.frame_count) as show:
                self._play(show)
                self._await_rest()
        except EvaluationError:
            if self._recorder:
                self._recorder.abort()
            raise
        except Stopped:
            self.get_logger().info(f'stopped after {self._published} frames')
            return EXIT_OK
        took_s = time.monotonic() - began_s
        refused = self.diagnostics['refused by lcd']
        print(f'{self.default_name}: {self._published} frames, {self._decided} decisions, '
              + (f'{refused} refused, ' if refused else '')
              + f'{took_s:.1f} s, {self._published / took_s:.1f} frames/s', flush=True)
        return EXIT_OK

    def _play(self, show: Callable[[int], None]) -> None:
        for topic, kind, stamp_ns, cdr in self._replay:
            is_frame = topic in self._replay.frame_topics
            self._turn(0.0)
            if not self._config.lockstep:
                self._keep_pace(stamp_ns)
            elif is_frame:
                self._until_decided(self._config.window)
            self._tell_time(stamp_ns)
            self._time_ns = stamp_ns
            if is_frame:
                cdr = self._posting.on_message(kind, stamp_ns, cdr)
                self._under_way[stamp_ns] = time.monotonic()
                self._strangers.sent(stamp_ns)
                self._published += 1
            if self._records_frames and Path(topic).name not in RECORDED:
                self._record(topic, cdr, kind)
            self._outputs[topic].publish(cdr)
            self.diagnostics.count('published messages')
            show(self._published)

    def _turn(self, seconds: float) -> None:
        if not self._spin(seconds):
            raise Stopped
        if self._broken is not None:
            raise self._broken
        if self._recorder:
            self._refuse_strangers()

    def _refuse_strangers(self) -> None:
        """Fail where others are on the topics: what is recorded would be theirs, too."""
        if time.monotonic() >= self._look_due_s:
            self._look_due_s = time.monotonic() + _LOOK_PERIOD_S
            self._strangers.look()
        if self._strangers.found:
            raise EvaluationError(self._strangers.found)

    def _until(self, condition: Callable[[], bool]) -> bool:
        """Run callbacks until the condition holds; False after timeout_s."""
        deadline_s = time.monotonic() + self._config.timeout_s
        while not condition():
            if time.monotonic() >= deadline_s:
                return False
            self._turn(_SPIN_S)
        return True

    def _await_listeners(self) -> None:
        """Wait until the first frame will be heard, all along the pipeline."""
        limit_s = self._config.start_timeout_s
        needs_all = self._config.lockstep or self._recorder
        listening = Listening(self, _HEARD if needs_all else ())
        waited_since_s = settled_since_s = looked_s = time.monotonic()
        while True:
            now_s = time.monotonic()
            self.diagnostics.waiting_for = self._missing()
            if self.diagnostics.waiting_for:
                settled_since_s = now_s
            elif now_s - settled_since_s >= (
                    _LONGEST_SETTLE_S if listening.lacking() else _SETTLE_S):
                listening.close()
                return
            late = bool(limit_s) and now_s - waited_since_s >= limit_s
            if late or now_s - looked_s >= _LOOK_PERIOD_S:
                looked_s = now_s
                # Whoever is loading or compiling is waited for anew: that takes what it takes.
                if getting_ready(self):
                    waited_since_s = now_s
                elif late:
                    raise EvaluationError(
                        f'no {self.diagnostics.waiting_for} within {limit_s:g} s: are the other '
                        'nodes running, and remapped alike?')
            self._turn(_SPIN_S)

    def _missing(self) -> str:
        """Tell what is not there yet; empty when all is."""
        for topic in self._replay.frame_topics:
            if not self._outputs[topic].get_subscription_count():
                return f'subscriber of {self._outputs[topic].topic_name}'
        if not self._config.lockstep and not self._recorder:
            return ''
        decisions = self._inputs[DECISIONS]
        if decisions.subscription is None:
            return f'publisher of {decisions.topic}'
        for topic in GRAPHS:
            name = self.resolve_topic_name(topic)
            mine = topic in self._inputs and self._inputs[topic].subscription is not None
            if self.count_publishers(topic) and self.count_subscribers(topic) <= int(mine):
                return f'subscriber of {name}'
            if topic in self._inputs and self.count_publishers(topic) and not mine:
                return f'publisher of {name}'
        if (REPORTS in self._inputs and self.count_publishers(REPORTS)
                and self._inputs[REPORTS].subscription is None):
            return f'publisher of {self._inputs[REPORTS].topic}'
        return ''

    def _until_decided(self, window: int) -> None:
        """Wait until fewer frames than the window are under way."""
        if self._until(lambda: len(self._under_way) < window):
            return
        stamp_ns = next(iter(self._under_way))
        raise EvaluationError(
            f'no decision on the frame with stamp {stamp_ns} ns within '
            f'{self._config.timeout_s:g} s ({self._published} frames published, {self._decided} '
            'decided): is a node of the pipeline down, or did it refuse the frame?')

    def _keep_pace(self, stamp_ns: int) -> None:
        """Wait until the message is due, with /clock going on at 40 Hz."""
        if self._origin is None:
            self._origin = time.monotonic(), stamp_ns
        origin_s, origin_ns = self._origin
        due_s = origin_s + (stamp_ns - origin_ns) * 1e-9 / self._config.rate
        if due_s - time.monotonic() > _LONG_S:
            self.diagnostics.worry(
                'stamps that jumped', f'the next message, with stamp {stamp_ns} ns, is due in '
                f'{due_s - time.monotonic():.0f} s; start_s leaves out what is before it')
        while (now_s := time.monotonic()) < due_s:
            if now_s >= self._clock_due_s:
                self._tell_time(origin_ns + round((now_s - origin_s) * 1e9 * self._config.rate))
            self._turn(min(due_s - now_s, _CLOCK_PERIOD_S))

    def _tell_time(self, time_ns: int) -> None:
        if self._clock_output is None:
            return
        self._clock_due_s = time.monotonic() + _CLOCK_PERIOD_S
        seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
        self._clock_output.publish(Clock(clock=Time(sec=seconds, nanosec=nanoseconds)))

    def _await_rest(self) -> None:
        """Wait for the decisions and reports that are still under way."""
        if self._config.lockstep:
            self._until_decided(1)
        else:
            self._until(self._all_sent)
        if not self._recorder or self._until(self._all_recorded):
            return
        count = self.diagnostics
        text = (f'{self._published} frames, {count["received " + CLEAN]} clean graphs, '
                f'{count["received " + FORWARDED]} graphs, {count["received " + REPORTS]} attack '
                f'reports, {self._decided} decisions')
        if self._config.lockstep:
            raise EvaluationError(f'the recording is incomplete: {text}')
        self.get_logger().warning(f'frames were lost, as may be in real time: {text}')

    def _all_recorded(self) -> bool:
        """Tell whether all messages are there of each frame that a decision is to come on."""
        attacked = self._inputs[CLEAN].subscription is not None
        # A decision may overtake what it is about: every topic has a path of its own.
        answered = self._decided + self.diagnostics['refused by lcd']
        return not self._under_way and all(
            self.diagnostics[f'received {topic}'] >= answered
            for topic in ((CLEAN, FORWARDED, REPORTS) if attacked else (FORWARDED,)))

    def _all_sent(self) -> bool:
        return all(publisher.wait_for_all_acked(Duration(seconds=0))
                   for publisher in self._outputs.values())

    def close(self) -> None:
        """Finish the recording."""
        if self._recorder:
            self._recorder.close()


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; return its exit code."""
    return run_node(BagReplayNode, args)
