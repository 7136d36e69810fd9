# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node graph_builder: every encoding, both transports, any camera's QoS, bad frames."""

from array import array
from concurrent.futures import Future

import cv2
import numpy as np
import pytest

from adversarial_lcd_ros.config import BuilderConfig
from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.files.keys import make_key
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.sealing import is_sealed
from adversarial_lcd_ros.vision.builder import Building, GraphBuilder
from adversarial_lcd_ros.vision.draw import draw_graph

pytest.importorskip('rclpy', reason='rclpy is not installed')

from rclpy.qos import ReliabilityPolicy
from sensor_msgs.msg import CompressedImage, Image

from adversarial_lcd_ros.messages.payload import unwrap
from adversarial_lcd_ros.nodes.graph_builder import GraphBuilderNode
from adversarial_lcd_ros.nodes.lcd import LcdNode


def picture(seed=0, height=120, width=160):
    coarse = np.random.default_rng(seed).integers(0, 256, (height // 8, width // 8, 3))
    return cv2.resize(coarse.astype(np.uint8), (width, height), interpolation=cv2.INTER_CUBIC)


def image_message(pixels, encoding='bgr8', second=5, padding=0):
    height, width = pixels.shape[:2]
    rows = np.pad(pixels.reshape(height, -1), ((0, 0), (0, padding)))
    message = Image(height=height, width=width, encoding=encoding, step=rows.shape[1],
                    data=array('B', rows.tobytes()))
    message.header.stamp.sec, message.header.frame_id = second, 'camera_left'
    return message


def compressed_message(pixels, extension='.jpg', second=5):
    message = CompressedImage(format=extension[1:], data=array(
        'B', cv2.imencode(extension, pixels)[1].tobytes()))
    message.header.stamp.sec, message.header.frame_id = second, 'camera_left'
    return message


@pytest.fixture
def node(ros, vocabulary):
    return ros.start(GraphBuilderNode, detector='none', vocabulary=vocabulary, features=50)


@pytest.fixture
def graphs(ros, node):
    return ros.collect('graph', lambda wire: codec.decode_graph(unwrap(wire)))


@pytest.fixture
def core(vocabulary):
    with GraphBuilder(BuilderConfig(detector='none', vocabulary=vocabulary,
                                    features=50)) as builder:
        yield builder


def publish(ros, publisher, *messages):
    ros.matched(publisher)
    for message in messages:
        publisher.publish(message)


@pytest.mark.parametrize('padding', [0, 13])
@pytest.mark.parametrize('encoding', ['bgr8', 'rgb8', 'bgra8', 'mono8'])
def test_raw_frames_give_the_graph_of_the_core(ros, graphs, core, encoding, padding):
    bgr = picture()
    pixels = {'bgr8': bgr, 'rgb8': bgr[:, :, ::-1], 'bgra8': np.dstack([bgr, bgr[:, :, :1]]),
              'mono8': cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)}[encoding]
    publish(ros, ros.publisher('image', Image), image_message(pixels, encoding, padding=padding))
    ros.until(lambda: graphs)
    assert graphs[0].node_count > 10
    assert graphs[0] == core.build(bgr if encoding != 'mono8' else pixels,
                                   5_000_000_000, 'camera_left', 0)


@pytest.mark.parametrize('extension', ['.jpg', '.png'])
def test_compressed_frames_give_the_graph_of_the_core(ros, graphs, core, extension):
    message = compressed_message(picture(), extension)
    decoded = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)
    publish(ros, ros.publisher('image/compressed', CompressedImage), message)
    ros.until(lambda: graphs)
    assert graphs[0] == core.build(decoded, 5_000_000_000, 'camera_left', 0)


def test_a_best_effort_camera_is_heard(ros, graphs):
    camera = ros.publisher('image', Image, reliability=ReliabilityPolicy.BEST_EFFORT)
    publish(ros, camera, image_message(picture()))
    ros.until(lambda: graphs)


def test_a_frame_offered_raw_and_compressed_is_used_once(ros, node, graphs):
    raw = ros.publisher('image', Image)
    compressed = ros.publisher('image/compressed', CompressedImage)
    ros.matched(raw)
    ros.matched(compressed)
    for second in range(4):
        raw.publish(image_message(picture(second), second=second))
        compressed.publish(compressed_message(picture(second), second=second))
    ros.until(lambda: node.diagnostics['received frames'] == 8)
    ros.until(lambda: len(graphs) == 4)
    assert sorted(graph.stamp_ns // 10**9 for graph in graphs) == [0, 1, 2, 3]
    assert node.diagnostics['dropped repeats'] == 4


def test_graphs_leave_in_the_order_of_their_frames(ros, node, graphs, core, monkeypatch):
    sought = [Future() for _ in range(3)]

    def begin(image, stamp_ns, frame_id, sequence):
        graph = core.build(image, stamp_ns, frame_id, sequence)
        return Building(sought[sequence], lambda _: graph)

    monkeypatch.setattr(node._builder, 'begin', begin)
    camera = ros.publisher('image', Image)
    publish(ros, camera, image_message(picture(), second=0), image_message(picture(), second=1))
    ros.until(lambda: node.diagnostics['received frames'] == 2)
    sought[1].set_result(None)
    ros.until(lambda: len(node._under_way) == 2)
    assert not graphs
    sought[0].set_result(None)
    ros.until(lambda: len(graphs) == 2)
    assert [graph.sequence for graph in graphs] == [0, 1]
    camera.publish(image_message(picture(), second=2))
    sought[2].set_exception(ModelError('the network fails'))
    ros.until(lambda: node.diagnostics['refused frame'] == 1)
    assert len(graphs) == 2


def bad_frames():
    good = image_message(picture())
    yield 'encoding', image_message(picture(), '32FC1')
    yield 'no pixels', Image(encoding='bgr8')
    yield 'data cut', Image(height=120, width=160, step=480, encoding='bgr8', data=good.data[:-1])
    yield 'step too small', Image(height=120, width=160, step=479, encoding='bgr8',
                                  data=good.data)
    yield 'huge', Image(height=2**32 - 1, width=2**32 - 1, step=2**32 - 1, encoding='mono8')


def bad_compressed_frames():
    good = compressed_message(picture())
    yield 'empty', CompressedImage(format='jpeg')
    yield 'noise', CompressedImage(format='jpeg', data=array('B', bytes(range(200))))
    yield 'header only', CompressedImage(format='jpeg', data=good.data[:20])


@pytest.mark.parametrize(('topic', 'message'), [
    *(pytest.param('image', m, id=name) for name, m in bad_frames()),
    *(pytest.param('image/compressed', m, id=name) for name, m in bad_compressed_frames())])
def test_a_bad_frame_is_refused_counted_and_survived(ros, node, graphs, topic, message):
    good = image_message(picture()) if topic == 'image' else compressed_message(picture())
    publish(ros, ros.publisher(topic, type(message)), message, good)
    ros.until(lambda: graphs)
    assert node.diagnostics['refused frame'] == 1
    assert graphs[0].sequence == 1  # the gap shows that one is missing


def test_frames_that_give_way_in_a_full_queue_are_counted(ros, vocabulary):
    node = ros.start(GraphBuilderNode, detector='none', vocabulary=vocabulary, queue_depth=2)
    graphs = ros.collect('graph', lambda wire: codec.decode_graph(unwrap(wire)))
    camera = ros.publisher('image', Image)
    publish(ros, camera, image_message(picture(), second=0))
    ros.until(lambda: graphs)
    publish(ros, camera, *(image_message(picture(), second=second) for second in range(1, 8)))
    ros.until(lambda: graphs[-1].stamp_ns == 7 * 10**9)
    assert node.diagnostics['lost frames'] == 8 - len(graphs) > 0


def test_the_overlay_is_drawn_for_whoever_listens(ros, graphs):
    overlays = ros.collect('overlay', lambda message: message, Image, raw=False,
                           reliability=ReliabilityPolicy.BEST_EFFORT)
    pixels = picture()
    publish(ros, ros.publisher('image', Image), image_message(pixels))
    ros.until(lambda: overlays and graphs)
    drawn = np.frombuffer(overlays[0].data, np.uint8).reshape(120, 160, 3)
    assert overlays[0].encoding == 'bgr8'
    assert overlays[0].header.stamp.sec == 5
    np.testing.assert_array_equal(drawn, draw_graph(pixels, graphs[0]))


def test_frames_become_decisions(ros, node, lcd_model):
    ros.start(LcdNode, model=lcd_model, min_gap_s=4)
    decisions = ros.collect('loop_closures',
                            lambda wire: codec.decode_loop_closure(unwrap(wire)))
    ros.matched(node._graphs)
    publish(ros, ros.publisher('image', Image),
            *(image_message(picture(second % 5), second=second) for second in range(10)))
    ros.until(lambda: len(decisions) == 10)
    assert [d.stamp_ns // 10**9 for d in decisions] == list(range(10))
    assert [d.match_sequence for d in decisions[5:]] == [0, 1, 2, 3, 4]


def test_a_builder_and_a_detector_with_one_key_take_each_others_graphs(ros, vocabulary, lcd_model,
                                                                       core, tmp_path):
    make_key(tmp_path / 'key')
    key = str(tmp_path / 'key')
    wires = ros.collect('graph', bytes)
    decisions = ros.collect('loop_closures', lambda wire: codec.decode_loop_closure(unwrap(wire)))
    builder = {'detector': 'none', 'vocabulary': vocabulary, 'features': 50, 'key': key}
    lcd = ros.start(LcdNode, model=lcd_model, key=key)
    first = ros.start(GraphBuilderNode, **builder)
    publish(ros, ros.publisher('image', Image), *(
        image_message(picture(second), second=second) for second in (1, 2)))
    ros.until(lambda: len(decisions) == 2)
    ros.stop(first)
    ros.start(GraphBuilderNode, **builder)
    publish(ros, ros.publisher('image', Image), image_message(picture(3), second=3))
    ros.until(lambda: len(decisions) == 3)
    assert all(is_sealed(unwrap(wire)) for wire in wires)
    assert codec.decode_graph(unwrap(wires[0])) == core.build(picture(1), 10**9, 'camera_left')
    replay = ros.publisher('graph')
    ros.until(lambda: replay.get_subscription_count() == 2)  # lcd's, and that of this test
    replay.publish(wires[1])
    ros.until(lambda: lcd.diagnostics['refused graph: run'] == 1)
    assert [decision.sequence for decision in decisions] == [0, 1, 0]
