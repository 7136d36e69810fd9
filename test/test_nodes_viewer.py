# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node viewer: one picture a decision, of what the other nodes have said."""

import cv2
from graph_factory import make_graph
import numpy as np
import pytest

from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.types import AttackReport, LoopClosure

pytest.importorskip('rclpy', reason='rclpy is not installed')

from builtin_interfaces.msg import Time
from rclpy.qos import ReliabilityPolicy
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header

from adversarial_lcd_ros.messages.payload import wrap
from adversarial_lcd_ros.nodes.viewer import ViewerNode

STAMPS = [1_000_000_000, 9_000_000_000]
EDGES = [(0, 1), (0, 2), (1, 3), (2, 4)]
NAMES = ('graph_clean', 'graph', 'loop_closures', 'attack_report')


def frame(stamp_ns):
    picture = np.full((480, 640, 3), 90, np.uint8)
    return CompressedImage(header=Header(stamp=Time(sec=stamp_ns // 10**9), frame_id='camera'),
                           format='jpeg', data=cv2.imencode('.jpg', picture)[1].tobytes())


def said(number):
    """Yield topic and message of one frame under attack, in the order of ``NAMES``."""
    stamp = STAMPS[number]
    clean = make_graph(stamp_ns=stamp, sequence=number)
    forwarded = make_graph(edges=[*EDGES[1:], (3, 5)], stamp_ns=stamp, sequence=number)
    match = {'match_stamp_ns': STAMPS[0], 'match_sequence': 0} if number else {}
    payloads = (
        codec.encode_graph(clean), codec.encode_graph(forwarded),
        codec.encode_loop_closure(LoopClosure(stamp, 'camera', number, bool(number), number / 2,
                                              **match)),
        codec.encode_attack_report(AttackReport(stamp, 'camera', number, 'success',
                                               edit_budget=3, edits=2)))
    yield from zip(NAMES, map(wrap, payloads), strict=True)


def red(message):
    picture = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)
    blue, green, red = cv2.split(picture.astype(int))
    return np.count_nonzero((red > 180) & (green < 90) & (blue < 90))


@pytest.fixture
def world(ros):
    node = ros.start(ViewerNode)
    views = ros.collect('view/compressed', lambda message: message, CompressedImage, raw=False,
                        reliability=ReliabilityPolicy.BEST_EFFORT)
    publishers = {name: ros.publisher(name) for name in NAMES}
    publishers['frame'] = ros.publisher('image/compressed', CompressedImage)
    for publisher in publishers.values():
        ros.matched(publisher)
    ros.until(node._is_wanted)
    return node, views, publishers


@pytest.mark.parametrize('backwards', [False, True])
def test_each_decision_has_its_picture_in_whatever_order_messages_come(ros, world, backwards):
    node, views, publishers = world
    for number, stamp in enumerate(STAMPS):
        publishers['frame'].publish(frame(stamp))
        ros.until(lambda count=number + 1: node.diagnostics['received frames'] == count)
        messages = list(said(number))
        for name, wire in reversed(messages) if backwards else messages:
            publishers[name].publish(wire)
        ros.until(lambda count=number + 1: len(views) == count)
    assert [view.header.stamp.sec for view in views] == [1, 9]
    assert all(view.format == 'jpeg' and red(view) > 20 for view in views)


def test_without_a_frame_there_is_no_picture_and_damage_is_survived(ros, world):
    node, views, publishers = world
    publishers['graph'].publish(wrap(b'junk'))
    for name, wire in said(0):
        publishers[name].publish(wire)
    ros.until(lambda: node.diagnostics['received messages'] == 5)
    assert node.diagnostics['refused graph'] == 1
    publishers['frame'].publish(replace_stamp(frame(STAMPS[1]), -1))
    ros.until(lambda: node.diagnostics['refused frame'] == 1)
    assert views == []


def replace_stamp(message, seconds):
    message.header.stamp.sec = seconds
    return message


def test_nothing_is_drawn_where_nobody_looks(ros):
    node = ros.start(ViewerNode)
    publishers = {name: ros.publisher(name) for name in NAMES}
    for publisher in publishers.values():
        ros.matched(publisher)
    for name, wire in said(0):
        publishers[name].publish(wire)
    ros.until(lambda: node.diagnostics['received messages'] == len(NAMES))
    assert node.diagnostics['published views'] == 0
