# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Decisions as standard messages, for tools that know nothing of payloads."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from rclpy.node import Node
from std_msgs.msg import Bool, Float64, Header

from adversarial_lcd_ros.messages.types import LoopClosure
from adversarial_lcd_ros.nodes.endpoints import overridable, payload_qos


class PlainDecisions:
    """
    Publishes each decision on ``probability``, ``loop`` and ``match``, where somebody listens.

    A match is the header of the best matching keyframe: its stamp, and the frame_id of the graph;
    without a candidate there is none.

    Parameters
    ----------
    node : Node

    """

    def __init__(self, node: Node) -> None:
        self._probability, self._loop, self._match = (
            node.create_publisher(kind, topic, payload_qos(), qos_overriding_options=overridable())
            for kind, topic in ((Float64, 'probability'), (Bool, 'loop'), (Header, 'match')))

    def publish(self, decision: LoopClosure) -> None:
        """Publish a decision."""
        if self._probability.get_subscription_count():
            self._probability.publish(Float64(data=float(decision.probability)))
        if self._loop.get_subscription_count():
            self._loop.publish(Bool(data=bool(decision.is_loop)))
        if decision.match_stamp_ns is not None and self._match.get_subscription_count():
            seconds, nanoseconds = divmod(decision.match_stamp_ns, 1_000_000_000)
            self._match.publish(Header(stamp=Time(sec=seconds, nanosec=nanoseconds),
                                       frame_id=decision.frame_id))
