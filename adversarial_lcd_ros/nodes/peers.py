# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The other nodes of a pipeline as the replay sees them: getting ready, heard, or none of ours."""

from __future__ import annotations

from collections.abc import Iterable
import struct
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from adversarial_lcd_ros.errors import AdversarialLcdError
from adversarial_lcd_ros.messages.payload import unwrap
from adversarial_lcd_ros.nodes.diagnostics import TOPIC as DIAGNOSTICS
from adversarial_lcd_ros.nodes.endpoints import LISTENERS
from adversarial_lcd_ros.sequences.cdr import cdr_stamp_ns

# What every node has from its first moment on.
_EVERYWHERE = {DIAGNOSTICS, '/rosout', '/parameter_events'}


def getting_ready(node: Node) -> list[str]:
    """Name the nodes that have said hello on /diagnostics and have no topic of the work yet."""
    found = []
    for other in node.get_publishers_info_by_topic(DIAGNOSTICS):
        name, namespace = other.node_name, other.node_namespace
        if name == node.get_name() and namespace == node.get_namespace():
            continue
        try:
            topics = {topic for topic, _ in (
                *node.get_publisher_names_and_types_by_node(name, namespace),
                *node.get_subscriber_names_and_types_by_node(name, namespace))}
        except Exception:  # rclpy's NodeNameNonExistentError: it has just ended
            continue
        if topics <= _EVERYWHERE:
            found.append(name)
    return found


class Listening:
    """
    Tells whether those who publish know of all who want to hear them.

    Two nodes find each other in their own time, whatever a third sees of them; until then what
    one says is lost to the other. How many hear it, a node of this package says on /diagnostics.

    Parameters
    ----------
    node : Node
    topics : iterable of str

    """

    def __init__(self, node: Node, topics: Iterable[str]) -> None:
        self._node = node
        self._topics = [str(node.resolve_topic_name(topic)) for topic in topics]
        self._heard_by: dict[tuple[str, str], int] = {}
        self._statuses = node.create_subscription(DiagnosticArray, DIAGNOSTICS, self._note, 100)

    def _note(self, message: Any) -> None:
        for status in message.status:
            name = '/' + status.name.partition(':')[0]
            for entry in status.values:
                if entry.key.startswith(LISTENERS) and entry.value.isdecimal():
                    topic = entry.key.removeprefix(LISTENERS)
                    self._heard_by[name, topic] = int(entry.value)

    def lacking(self) -> str:
        """Name a topic that somebody is not yet heard on by all; empty where none is known."""
        telling = {_full_name(one) for one in
                   self._node.get_publishers_info_by_topic(DIAGNOSTICS)}
        for topic in self._topics:
            wanted = self._node.count_subscribers(topic)
            for one in self._node.get_publishers_info_by_topic(topic):
                name = _full_name(one)
                if name in telling and self._heard_by.get((name, topic), -1) < wanted:
                    return topic
        return ''

    def close(self) -> None:
        """Listen no longer."""
        self._node.destroy_subscription(self._statuses)


class Strangers:
    """
    Notices that others than the nodes of this replay are on its topics.

    Parameters
    ----------
    node : Node
    topics : iterable of str
        On each of them one node at most publishes, one message for each frame.

    Attributes
    ----------
    found : str
        What is wrong, in words; empty as long as nothing is.

    """

    def __init__(self, node: Node, topics: Iterable[str]) -> None:
        self._node = node
        self._seen: dict[str, set[int]] = {topic: set() for topic in topics}
        self._sent: set[int] = set()
        self.found = ''

    def sent(self, stamp_ns: int) -> None:
        """Note a frame that was published."""
        self._sent.add(stamp_ns)

    def heard(self, topic: str, wire: bytes) -> None:
        """Look at a message: it answers a frame that was sent, and is the only one to do so."""
        try:
            stamp_ns = cdr_stamp_ns(unwrap(wire))
        except (AdversarialLcdError, struct.error):
            return  # whoever reads it refuses it
        if stamp_ns not in self._sent or stamp_ns in self._seen[topic]:
            what = 'a second message' if stamp_ns in self._sent else 'a message'
            frame = 'the frame' if stamp_ns in self._sent else 'a frame never sent, that'
            self._tell(f'{what} on {self._node.resolve_topic_name(topic)} is about {frame} with '
                       f'stamp {stamp_ns} ns')
        self._seen[topic].add(stamp_ns)

    def look(self) -> None:
        """Count the publishers of every topic."""
        for topic in self._seen:
            there = self._node.get_publishers_info_by_topic(topic)
            if len(there) > 1:
                names = ', '.join(sorted(map(_full_name, there)))
                self._tell(f'{self._node.resolve_topic_name(topic)} has {len(there)} publishers '
                           f'({names})')

    def _tell(self, what: str) -> None:
        self.found = self.found or (
            f'there are strangers in ROS domain {self._node.context.get_domain_id()}: {what}. '
            'Another pipeline is running there: end it, or set ROS_DOMAIN_ID to another number')


def _full_name(endpoint: Any) -> str:
    return f'{endpoint.node_namespace.rstrip("/")}/{endpoint.node_name}'
