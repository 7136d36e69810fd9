"""Quality of service: what this package publishes with, and how it adapts to others."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from std_msgs.msg import UInt8MultiArray

PAYLOAD_DEPTH = 100
_LOOK_PERIOD_S = 0.05
_WATCH_PERIOD_S = 1.0


def payload_qos(depth: int = PAYLOAD_DEPTH) -> QoSProfile:
    """Return the profile of what this package publishes: reliable, volatile, a long queue."""
    return QoSProfile(depth=depth, history=HistoryPolicy.KEEP_LAST,
                      reliability=ReliabilityPolicy.RELIABLE)


def create_payload_publisher(node: Node, topic: str, qos: QoSProfile | None = None) -> Publisher:
    """Return a publisher of payloads; give it the bytes of ``payload.wrap``."""
    return node.create_publisher(UInt8MultiArray, topic, qos or payload_qos())


def steady_timer(node: Node, period_s: float, callback: Callable[[], None]) -> Any:
    """Return a timer of real time, which runs in simulated time too."""
    return node.create_timer(period_s, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))


def _policies(qos: QoSProfile) -> tuple[Any, ...]:
    return (qos.reliability, qos.durability, qos.deadline, qos.lifespan, qos.liveliness,
            qos.liveliness_lease_duration)


class MirroredSubscription:
    """
    A subscription made with the QoS of the topic's first publisher, once there is one.

    A reliable subscription hears no best-effort camera; a best-effort one loses frames of a
    reliable replay; a volatile one misses what a latched publisher holds ready. Depth and
    history do not travel over DDS and are ours. A later publisher with another QoS is warned
    about.

    Parameters
    ----------
    node : Node
    message : type
        Message class.
    topic : str
    callback : callable
        As of ``create_subscription``.
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

    def __init__(self, node: Node, message: Any, topic: str, callback: Callable[..., None], *,
                 depth: int = PAYLOAD_DEPTH, raw: bool = False,
                 prepare: Callable[[QoSProfile], bool] = lambda qos: True) -> None:
        self._node, self._message, self._topic = node, message, topic
        self._callback, self._depth, self._raw = callback, depth, raw
        self._prepare = prepare
        self._warned: set[bytes] = set()
        self.qos: QoSProfile | None = None
        self.subscription: Subscription | None = None
        self._timer = steady_timer(node, _LOOK_PERIOD_S, self._look)
        self._look()

    @property
    def topic(self) -> str:
        """Name of the topic after remapping."""
        return str(self._node.resolve_topic_name(self._topic))

    def _look(self) -> None:
        if self.qos is None:
            publishers = self._node.get_publishers_info_by_topic(self._topic)
            if not publishers:
                return
            self.qos = publishers[0].qos_profile
            self.qos.history, self.qos.depth = HistoryPolicy.KEEP_LAST, self._depth
        if not self._prepare(self.qos):
            return
        # Lifespan concerns publishers only. The deadline and the liveliness are the publisher's
        # promises; asking for none of them matches any.
        mine = QoSProfile(depth=self._depth, reliability=self.qos.reliability,
                          durability=self.qos.durability)
        self.subscription = self._node.create_subscription(
            self._message, self._topic, self._callback, mine, raw=self._raw)
        self._node.destroy_timer(self._timer)
        self._timer = steady_timer(self._node, _WATCH_PERIOD_S, self._watch)

    def _watch(self) -> None:
        for publisher in self._node.get_publishers_info_by_topic(self._topic):
            gid = bytes(publisher.endpoint_gid)
            if (self.qos is None or gid in self._warned
                    or _policies(publisher.qos_profile) == _policies(self.qos)):
                continue
            self._warned.add(gid)
            self._node.get_logger().warning(
                f'{self.topic}: publisher of node {publisher.node_name} has another QoS than the '
                'first one, which was mirrored; its messages may be lost. Start this node again '
                'once the first publisher is gone')
