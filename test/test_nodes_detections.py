# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node graph_builder with objects from the topic detections."""

import cv2
import numpy as np
import pytest

from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.payload import unwrap, wrap

pytest.importorskip('rclpy', reason='rclpy is not installed')

from sensor_msgs.msg import CompressedImage

from adversarial_lcd_ros.nodes.graph_builder import GraphBuilderNode

MISSED, UNMATCHED = 'frames without detections', 'unmatched detections'


def frame(second):
    coarse = np.random.default_rng(second).integers(0, 256, (15, 20, 3)).astype(np.uint8)
    pixels = cv2.resize(coarse, (160, 120), interpolation=cv2.INTER_CUBIC)
    message = CompressedImage(format='png', data=cv2.imencode('.png', pixels)[1].tobytes())
    message.header.stamp.sec = second
    return message


def detections(second, *labels, nanoseconds=0):
    count = len(labels)
    return wrap(codec.encode_detections(codec.FrameDetections(
        second * 10**9 + nanoseconds, 'camera', np.array(labels, np.uint32),
        np.tile(np.array([20, 20, 40, 30], np.float32), (count, 1)),
        np.full(count, 0.9, np.float32))))


@pytest.fixture
def world(ros, vocabulary):
    """Start the node; return it, its graphs, and publishers of frames and detections."""
    def start(**parameters):
        node = ros.start(GraphBuilderNode, detector='topic', vocabulary=vocabulary, features=20,
                         **parameters)
        graphs = ros.collect('graph', lambda wire: codec.decode_graph(unwrap(wire)))
        camera = ros.publisher('image/compressed', CompressedImage)
        found = ros.publisher('detections')
        ros.matched(camera)
        ros.matched(found)
        return node, graphs, camera, found
    return start


def test_graphs_wait_for_their_objects_and_keep_their_order(ros, world):
    node, graphs, camera, found = world(detections_wait_ms=1e5)
    found.publish(detections(1, 7))  # before its frame
    ros.until(lambda: node.diagnostics['received detections'] == 1)
    for second in (1, 2, 3):
        camera.publish(frame(second))
    ros.until(lambda: len(graphs) == 1)
    found.publish(detections(3))  # nothing was found in it
    found.publish(detections(2, 8, 9, nanoseconds=5_000_000))
    ros.until(lambda: len(graphs) == 3)
    assert [graph.stamp_ns // 10**9 for graph in graphs] == [1, 2, 3]
    assert [graph.label[:graph.object_count].tolist() for graph in graphs] == [[7], [8, 9], []]
    assert node.diagnostics[MISSED] == node.diagnostics[UNMATCHED] == 0


def test_a_frame_that_waits_in_vain_goes_out_without_objects_and_is_counted(ros, world):
    node, graphs, camera, found = world(detections_wait_ms=20.0)
    camera.publish(frame(1))
    ros.until(lambda: graphs)
    assert graphs[0].object_count == 0
    assert graphs[0].node_count > 0
    found.publish(detections(1, 7))
    ros.until(lambda: node.diagnostics[UNMATCHED] == 1)
    assert node.diagnostics[MISSED] == 1


def test_what_is_no_detections_is_refused(ros, world):
    node, graphs, camera, found = world(detections_wait_ms=1e5)
    found.publish(wrap(b'noise'))
    ros.until(lambda: node.diagnostics['refused detections'] == 1)
    found.publish(detections(4, 7))
    camera.publish(frame(4))
    ros.until(lambda: graphs)
    assert graphs[0].object_count == 1


def test_frames_that_wait_go_out_when_the_node_ends(ros, world):
    node, _, camera, _ = world(detections_wait_ms=1e5)
    camera.publish(frame(1))
    camera.publish(frame(2))
    ros.until(lambda: node.diagnostics['received frames'] == 2)
    ros.stop(node)
    assert node.diagnostics['published graphs'] == 2
