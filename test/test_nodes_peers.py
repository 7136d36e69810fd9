# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The replay waits for nodes that get ready, and notices those that are none of its own."""

import time
from types import SimpleNamespace

import pytest

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.payload import wrap

pytest.importorskip('rclpy', reason='rclpy is not installed')

from test_nodes_bag_replay import (  # noqa: F401
    STAMPS,
    CompressedImage,
    Pipeline,
    bag,
    frames,
    pipeline,
    replay,
)

from adversarial_lcd_ros.nodes.lcd import LcdNode
from adversarial_lcd_ros.nodes.peers import getting_ready
from adversarial_lcd_ros.nodes.runtime import Manual, PipelineNode


class Starting(PipelineNode):
    """A node that is still loading: it has said hello, and has no topic yet."""

    default_name = 'starting'
    configs = ()
    manual = Manual('something slow')


def test_nodes_that_get_ready_are_told_from_those_that_are(ros, lcd_model, bag):  # noqa: F811
    node = replay(ros, bag)
    slow = ros.start(Starting)
    ros.start(LcdNode, model=lcd_model)
    ros.until(lambda: getting_ready(node) == ['starting'])
    ros.stop(slow)
    ros.until(lambda: getting_ready(node) == [])


def test_a_node_that_gets_ready_is_waited_for_beyond_the_limit(
        ros, bag, vocabulary, lcd_model, monkeypatch):  # noqa: F811
    node = replay(ros, bag, lockstep=True, start_timeout_s=60)
    slow = ros.start(Starting)
    ros.until(lambda: getting_ready(node))
    real_s, ahead_s = time.monotonic, 0.0

    def spin(seconds):
        nonlocal ahead_s
        if ahead_s < 600.0:
            ahead_s += 30.0  # no test waits for a limit
            if ahead_s == 600.0:
                Pipeline(ros, vocabulary, lcd_model)
                ros.stop(slow)
        return ros.spin(seconds)

    monkeypatch.setattr('adversarial_lcd_ros.nodes.bag_replay.time',
                        SimpleNamespace(monotonic=lambda: real_s() + ahead_s))
    assert node.work(spin) == 0
    assert ahead_s == 600.0


@pytest.mark.parametrize('is_told', [True, False])
def test_a_replay_waits_until_the_others_know_who_hears_them(
        ros, bag, pipeline, monkeypatch, is_told):  # noqa: F811
    """A listener that is not matched in twenty seconds never will be: its QoS does not fit."""
    status, name = pipeline.lcd.diagnostics, 'listeners of /loop_closures'
    known = status.gauges[name]
    status.gauges[name] = lambda: 0
    node = replay(ros, bag, lockstep=True)
    ros.until(lambda: not node._missing())
    real_s, ahead_s, turns, published = time.monotonic, 0.0, iter(range(10**6)), []

    def spin(seconds):
        nonlocal ahead_s
        turn = next(turns)
        if turn < 100:
            status.publish()
            ahead_s = 10.0 * (turn > 50)
        elif turn == 100:
            published.append(node._published)
            if is_told:
                status.gauges[name] = known
                status.publish()
            else:
                ahead_s = 30.0
        return ros.spin(min(seconds, 0.01))

    monkeypatch.setattr('adversarial_lcd_ros.nodes.bag_replay.time',
                        SimpleNamespace(monotonic=lambda: real_s() + ahead_s))
    assert node.work(spin) == 0
    assert published == [0]


def test_a_second_detector_fails_a_recording_and_is_named(
        ros, bag, pipeline, lcd_model, tmp_path):  # noqa: F811
    ros.start(LcdNode, '__ns:=/other', 'loop_closures:=/loop_closures', model=lcd_model)
    record = tmp_path / 'record'
    node = replay(ros, bag, lockstep=True, record=str(record))
    with pytest.raises(EvaluationError, match=r'strangers in ROS domain \d+: /loop_closures has 2 '
                       r'publishers \(/lcd, /other/lcd\)\. .*ROS_DOMAIN_ID'):
        node.work(ros.spin)
    assert not record.exists()


@pytest.mark.parametrize(('stamp_ns', 'said'), [
    (STAMPS[0] - 1, 'a message on /loop_closures is about a frame never sent'),
    (STAMPS[0], 'a second message on /loop_closures is about the frame')])
def test_a_message_that_answers_no_frame_fails_a_recording(
        ros, bag, tmp_path, stamp_ns, said):  # noqa: F811
    decisions = ros.publisher('loop_closures')

    def decide(message):
        stamp = message.header.stamp
        for about_ns in (stamp.sec * 10**9 + stamp.nanosec, stamp_ns):
            decisions.publish(wrap(codec.encode_loop_closure(
                codec.LoopClosure(about_ns, 'camera', 0, False, 0.0))))

    ros.collect('image/compressed', decide, CompressedImage, raw=False)
    node = replay(ros, bag, lockstep=True, record=str(tmp_path / 'record'))
    with pytest.raises(EvaluationError, match=said):
        node.work(ros.spin)
