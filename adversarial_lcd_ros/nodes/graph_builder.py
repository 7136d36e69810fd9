# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The node graph_builder: camera frames in, multi-tier graphs out.

Two frames are under way at once, each with one thread of the network: two threads on one frame
take 36 ms of processor time for its objects, one takes 26. Graphs leave in the order of their
frames. A frame whose detections do not come goes out without objects, counted: a dropped one would
stop lockstep.
"""

from __future__ import annotations

from adversarial_lcd_ros.start import run_node_process

if __name__ == '__main__':  # before the other imports: they take a second, and Ctrl-C may come
    raise SystemExit(run_node_process('graph_builder'))

from array import array
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header, UInt8MultiArray

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages.checks import checked_name, checked_stamp_ns
from adversarial_lcd_ros.messages.codec import decode_detections, encode_graph
from adversarial_lcd_ros.messages.payload import unwrap, wrap
from adversarial_lcd_ros.messages.sealing import Sealer
from adversarial_lcd_ros.nodes.endpoints import (
    MirroredSubscription,
    create_payload_publisher,
    steady_timer,
)
from adversarial_lcd_ros.nodes.images import compressed_pixels, image_pixels
from adversarial_lcd_ros.nodes.parameters import load_key
from adversarial_lcd_ros.nodes.runtime import Manual, PipelineNode, run_node
from adversarial_lcd_ros.nodes.streams import StampWatch
from adversarial_lcd_ros.preloading import load_for_builder
from adversarial_lcd_ros.settings import NODE_CONFIGS
from adversarial_lcd_ros.vision.builder import Building, GraphBuilder
from adversarial_lcd_ros.vision.detections import MISSED, DetectionInbox
from adversarial_lcd_ros.vision.draw import draw_graph
from adversarial_lcd_ros.vision.objects import Detections

IMAGE, COMPRESSED, DETECTIONS = 'image', 'image/compressed', 'detections'
_REMEMBERED_STAMPS = 64
_LOOK_PERIOD_S, _WARNING_PERIOD_S = 0.01, 5.0
# So many frames without an object from the start on are worth a word.
_SUSPICIOUS_FRAMES = 30


@dataclass(frozen=True)
class _Frame:
    building: Building
    header: Header
    image: NDArray[np.uint8]
    arrival_s: float


class GraphBuilderNode(PipelineNode):
    """Runs a GraphBuilder on topics."""

    default_name = 'graph_builder'
    configs = NODE_CONFIGS['graph_builder']
    wakes_itself = True
    manual = Manual(
        'camera frames to multi-tier graphs of objects and visual features',
        subscribes=(f'{IMAGE} (sensor_msgs/Image: any encoding of cv_bridge but depth)',
                    f'{COMPRESSED} (sensor_msgs/CompressedImage: JPEG, PNG or WebP)',
                    f'{DETECTIONS} (std_msgs/UInt8MultiArray, Detections): the objects of each '
                    'frame, under detector:=topic'),
        publishes=('graph (std_msgs/UInt8MultiArray, MultiTierGraph): one for each frame',
                   'overlay (sensor_msgs/Image): the graph over the frame, if anyone listens',
                   '/diagnostics (diagnostic_msgs/DiagnosticArray): counts, rates, latency'))

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        config, node_config, self._limits = self.settings
        key = load_key(node_config.key)
        self._sealer = Sealer(key) if key else None
        self._builder = GraphBuilder(config, node_config.frames_at_once)
        self.say('compiling')
        load_for_builder()
        self._frames_at_once = node_config.frames_at_once
        self._under_way: deque[_Frame] = deque()
        # Publishes in this node's own thread what a thread of the network has finished.
        self._publish_guarded = self.diagnostics.guard('frame', self._publish)
        self._ready = self.create_guard_condition(
            self.diagnostics.guard('frame', self._publish_ready))
        self._looks_for_objects = config.detector != 'none'
        self._sequence = 0
        self._graphs = create_payload_publisher(self, 'graph')
        self._overlays = self.create_publisher(Image, 'overlay', qos_profile_sensor_data)
        self._inputs = {
            topic: MirroredSubscription(
                self, message, topic, 'frame', partial(self._on_frame, topic, pixels),
                depth=node_config.queue_depth)
            for topic, message, pixels in ((IMAGE, Image, image_pixels),
                                           (COMPRESSED, CompressedImage, compressed_pixels))}
        self._stamps: dict[str, deque[int]] = {
            topic: deque(maxlen=_REMEMBERED_STAMPS) for topic in self._inputs}
        self._watches = {topic: StampWatch(self.diagnostics, f'frames on {topic}')
                         for topic in self._inputs}
        self._last_number: dict[str, int] = {}
        self._inbox = (self._open_inbox(config, node_config) if config.detector == 'topic'
                       else None)
        self.say_ready(f'{config.features} features, detector {config.detector}')

    def _open_inbox(self, config: Any, node_config: Any) -> DetectionInbox:
        """Take the objects of frames from a topic; these frames wait for them."""
        inbox = DetectionInbox(
            round(config.detections_tolerance_s * 1e9), node_config.detections_wait_ms / 1e3,
            node_config.queue_depth, self._count_detections)
        self._detections = MirroredSubscription(
            self, UInt8MultiArray, DETECTIONS, 'detections', self._on_detections, raw=True)
        self._expiry = steady_timer(self, _LOOK_PERIOD_S,
                                    lambda: inbox.expire(time.perf_counter()))
        return inbox

    def _on_detections(self, wire: bytes) -> None:
        self.diagnostics.count('received detections')
        found = decode_detections(unwrap(wire, self._limits.max_payload_bytes), self._limits)
        if self._inbox:
            self._inbox.offer(found.stamp_ns, Detections(found.label, found.box, found.score))

    def _count_detections(self, what: str) -> None:
        remedy = ('their graphs have no objects; set detections_wait_ms or '
                  'detections_tolerance_s' if what == MISSED
                  else 'late, or of frames that never came')
        self.diagnostics.worry(what, f'{what}: {remedy}')

    def _on_frame(self, topic: str, pixels: Callable[[Any, int], NDArray[np.uint8]], message: Any,
                  info: Mapping[str, Any]) -> None:
        arrival_s = time.perf_counter()
        self.diagnostics.count('received frames')
        self._count_lost(topic, info['publication_sequence_number'])
        stamp = message.header.stamp
        if self._is_repeat(topic, stamp.sec * 1_000_000_000 + stamp.nanosec):
            return
        # Of a frame that is refused the numbers of the graphs tell that it is missing.
        sequence, self._sequence = self._sequence, self._sequence + 1
        stamp_ns = checked_stamp_ns(stamp.sec, stamp.nanosec)
        frame_id = checked_name(message.header.frame_id, 'frame_id')
        self._watches[topic].note_stamp(stamp_ns)
        image = pixels(message, self._limits.max_pixels)
        frame = (image, stamp_ns, frame_id, sequence)
        building = (self._builder.begin(*frame) if self._inbox is None else
                    self._builder.begin(*frame, self._inbox.expect(stamp_ns, arrival_s)))
        self._under_way.append(_Frame(building, message.header, image, arrival_s))
        building.when_ready(self._ready.trigger)
        # Frames that wait for a message must not be waited for: it comes in this thread.
        while self._inbox is None and len(self._under_way) > self._frames_at_once:
            self._publish_guarded(self._under_way.popleft())

    def _publish_ready(self) -> None:
        while self._under_way and self._under_way[0].building.ready():
            self._publish_guarded(self._under_way.popleft())

    def _publish(self, frame: _Frame) -> None:
        """Publish a graph; waits for it if need be."""
        graph = frame.building.graph()
        payload = encode_graph(graph, self.session)
        self._graphs.publish(wrap(self._sealer.seal(payload) if self._sealer else payload))
        self.diagnostics.count('published graphs')
        self.diagnostics.time(time.perf_counter() - frame.arrival_s)
        self._look_for_objects(graph)
        if self._overlays.get_subscription_count():
            self._publish_overlay(frame.header, frame.image, graph)

    def _look_for_objects(self, graph: MultiTierGraph) -> None:
        """Warn if the detector has never found anything, in frames enough to be suspicious."""
        if graph.found_objects or not self._looks_for_objects:
            self._looks_for_objects = False
            return
        self.diagnostics.count('graphs without objects')
        if self.diagnostics['graphs without objects'] >= _SUSPICIOUS_FRAMES:
            self.get_logger().warning(
                f'no object in any of {self.diagnostics["graphs without objects"]} frames: look '
                'at model, object_score and min_object_area, or set detector',
                throttle_duration_sec=_WARNING_PERIOD_S)

    def _is_repeat(self, topic: str, stamp_ns: int) -> bool:
        """Tell whether the frame came already on the other topic: drivers offer both."""
        self._stamps[topic].append(stamp_ns)
        if any(stamp_ns in stamps for name, stamps in self._stamps.items() if name != topic):
            self.diagnostics.count('dropped repeats')
            return True
        return False

    def _count_lost(self, topic: str, number: int | None) -> None:
        # Frames that gave way to newer ones in a full queue leave a gap in the publisher's count.
        if number is None:
            return
        last = self._last_number.get(topic, number)
        self._last_number[topic] = number
        if number > last + 1 and self.count_publishers(topic) == 1:
            self.diagnostics.worry('lost frames', f'{topic}: frames gave way to newer ones in '
                                   'the queue', number - last - 1)

    def _publish_overlay(self, header: Header, image: NDArray[np.uint8],
                         graph: MultiTierGraph) -> None:
        drawn = draw_graph(image, graph)
        height, width = drawn.shape[:2]
        self._overlays.publish(Image(header=header, height=height, width=width, encoding='bgr8',
                                     step=3 * width, data=array('B', drawn.tobytes())))

    def close(self) -> None:
        """Publish what is under way, and stop the threads of the network."""
        if self._inbox:
            self._inbox.close()
        while self._under_way:
            self._publish_guarded(self._under_way.popleft())
        self._builder.close()


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; return its exit code."""
    return run_node(GraphBuilderNode, args)
