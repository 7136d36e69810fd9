# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Quality of service: what this package publishes with, and how it adapts to others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
import time
from typing import TYPE_CHECKING, Any

from rclpy.clock import Clock, ClockType
from rclpy.publisher import Publisher
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from std_msgs.msg import UInt8MultiArray

if TYPE_CHECKING:
    from adversarial_lcd_ros.nodes.runtime import PipelineNode

PAYLOAD_DEPTH = 100
# On /diagnostics: how many hear a publisher, as it knows; a topic follows.
LISTENERS = 'listeners of '
_LOOK_PERIOD_S = 0.05
_WATCH_PERIOD_S = 1.0
_STALE_S = 5.0


def payload_qos(depth: int = PAYLOAD_DEPTH) -> QoSProfile:
    """Return the profile of what this package publishes: reliable, volatile, a long queue."""
    return QoSProfile(depth=depth, history=HistoryPolicy.KEEP_LAST,
                      reliability=ReliabilityPolicy.RELIABLE)


def overridable() -> QoSOverridingOptions:
    """Return which policies parameters ``qos_overrides.TOPIC.(publisher|subscription)`` set."""
    return QoSOverridingOptions([QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH,
                                 QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY])


def create_payload_publisher(node: PipelineNode, topic: str,
                             qos: QoSProfile | None = None) -> Publisher:
    """Return a publisher of payloads; give it the bytes of ``payload.wrap``."""
    publisher = node.create_publisher(UInt8MultiArray, topic, qos or payload_qos(),
                                      qos_overriding_options=overridable())
    node.diagnostics.gauges[LISTENERS + publisher.topic_name] = publisher.get_subscription_count
    return publisher


def steady_timer(node: PipelineNode, period_s: float, callback: Callable[[], None]) -> Any:
    """Return a timer of real time, which runs in simulated time too."""
    return node.create_timer(period_s, node.diagnostics.guard('timer', callback),
                             clock=Clock(clock_type=ClockType.STEADY_TIME))


def common_qos(publishers: Sequence[QoSProfile]) -> tuple[Any, Any]:
    """
    Return the reliability and durability that hear every publisher, the strongest such.

    A subscription that asks for more than one of them offers does not hear that one.
    """
    reliable = all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in publishers)
    latched = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in publishers)
    return (ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE)


class MirroredSubscription:
    """
    A subscription with the QoS that hears all publishers of its topic, once there is one.

    A reliable subscription hears no best-effort camera; a best-effort one loses frames of a
    reliable replay; a volatile one misses what a latched publisher holds ready. Depth and
    history do not travel over DDS and are ours. Where publishers come that ask for another QoS,
    the subscription is made anew; ``qos_overrides`` parameters win.

    Parameters
    ----------
    node : PipelineNode
    message : type
        Message class.
    topic : str
    what : str
        What a message is called that its callback refuses.
    callback : callable
        As of ``create_subscription``; what it raises is counted and survived.
    depth : int
        Messages that may wait.
    raw : bool
        Hand over the bytes of the message.
    prepare : callable, optional
        Called with the publisher's QoS every 50 ms from the time it is known; the subscription
        is made when it returns True.

    Attributes
    ----------
    subscription : Subscription or None
        None before the first publisher.

    """

    def __init__(self, node: PipelineNode, message: Any, topic: str, what: str,
                 callback: Callable[..., None], *, depth: int = PAYLOAD_DEPTH, raw: bool = False,
                 prepare: Callable[[QoSProfile], bool] = lambda qos: True) -> None:
        self._node, self._message, self._topic = node, message, topic
        self._depth, self._raw, self._prepare = depth, raw, prepare
        self._callback = self._noting(node.diagnostics.guard(what, callback))
        self._publishers = 0
        self._heard_s = 0.0
        self._wanted: tuple[Any, Any] | None = None
        self.qos: QoSProfile | None = None
        self.subscription: Subscription | None = None
        node.inputs.append(self.topic)
        node.diagnostics.problems.append(self._problem)
        self._timer = steady_timer(node, _LOOK_PERIOD_S, self._look)
        self._look()

    @property
    def topic(self) -> str:
        """Name of the topic after remapping."""
        return str(self._node.resolve_topic_name(self._topic))

    def take_waiting(self) -> None:
        """Call back for messages that have arrived, before the executor gets to them."""
        for _ in range(self._depth if self.subscription is not None else 0):
            assert self.subscription is not None
            with self.subscription.handle:
                taken = self.subscription.handle.take_message(self._message, self._raw)
            if taken is None:
                return
            self._callback(taken[0])

    def _noting(self, callback: Callable[..., None]) -> Callable[..., None]:
        @wraps(callback)
        def heard(*arguments: Any) -> None:
            if not self._heard_s:
                self._node.get_logger().info(f'first message on {self.topic}')
            self._heard_s = time.monotonic()
            callback(*arguments)
        return heard

    def _look(self) -> None:
        publishers = self._node.get_publishers_info_by_topic(self._topic)
        if self.qos is None:
            if not publishers:
                return
            self.qos = publishers[0].qos_profile
            self.qos.history, self.qos.depth = HistoryPolicy.KEEP_LAST, self._depth
        if not self._prepare(self.qos):
            return
        self._publishers = len(publishers)
        self._subscribe(common_qos([found.qos_profile for found in publishers] or [self.qos]))
        self._node.destroy_timer(self._timer)
        self._timer = steady_timer(self._node, _WATCH_PERIOD_S, self._watch)

    def _subscribe(self, wanted: tuple[Any, Any]) -> None:
        """Make the subscription, in place of one with another QoS."""
        # Lifespan concerns publishers only. The deadline and the liveliness are the publisher's
        # promises; asking for none of them matches any.
        if self.subscription is not None:
            self._node.destroy_subscription(self.subscription)
        self._wanted = wanted
        mine = QoSProfile(depth=self._depth, reliability=wanted[0], durability=wanted[1])
        self.subscription = self._node.create_subscription(
            self._message, self._topic, self._callback, mine, raw=self._raw,
            qos_overriding_options=self._overrides())

    def _overrides(self) -> QoSOverridingOptions:
        """Return the policies that were overridden; the others must stay free to follow."""
        given = self._node.get_parameters_by_prefix(f'qos_overrides.{self.topic}.subscription')
        return QoSOverridingOptions([policy for policy in overridable().policy_kinds
                                     if policy.name.lower() in given])

    def _watch(self) -> None:
        publishers = self._node.get_publishers_info_by_topic(self._topic)
        before, self._publishers = self._publishers, len(publishers)
        log = self._node.get_logger()
        if before and not publishers:
            log.info(f'{self.topic}: its publisher is gone')
        elif publishers and not before:
            log.info(f'{self.topic}: publisher back, node {publishers[0].node_name}')
        elif len(publishers) > max(before, 1):
            names = ', '.join(sorted(found.node_name for found in publishers))
            log.warning(f'{self.topic} has {len(publishers)} publishers: {names}')
        wanted = common_qos([found.qos_profile for found in publishers])
        if publishers and wanted != self._wanted:
            log.info(f'{self.topic}: publishers are {wanted[0].name.lower()} and '
                     f'{wanted[1].name.lower()} now, subscribed anew')
            self._subscribe(wanted)

    def _problem(self) -> str:
        """Return what is wrong with whoever publishes here."""
        if self.subscription is None:
            return ''
        if not self._publishers:
            return f'no publisher of {self.topic}'
        if self._publishers > 1:
            return f'{self._publishers} publishers of {self.topic}'
        silent_s = time.monotonic() - self._heard_s
        if self._heard_s and silent_s > _STALE_S:
            return f'nothing on {self.topic} for {silent_s:.0f} s'
        return ''
