# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The node viewer: what the others say of a frame, as one picture for people.

It only listens: whether there is an attacker it knows from graph_clean, which the detector does
not hear.
"""

from __future__ import annotations

from adversarial_lcd_ros.start import run_node_process

if __name__ == '__main__':  # before the other imports: they take a second, and Ctrl-C may come
    raise SystemExit(run_node_process('viewer'))

from array import array
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from builtin_interfaces.msg import Time
import numpy as np
from numpy.typing import NDArray
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header, UInt8MultiArray

from adversarial_lcd_ros.messages.checks import checked_stamp_ns
from adversarial_lcd_ros.messages.codec import (
    decode_attack_report,
    decode_graph,
    decode_loop_closure,
)
from adversarial_lcd_ros.messages.payload import unwrap
from adversarial_lcd_ros.nodes.endpoints import MirroredSubscription
from adversarial_lcd_ros.nodes.images import compressed_pixels, image_pixels
from adversarial_lcd_ros.nodes.runtime import Manual, PipelineNode, run_node
from adversarial_lcd_ros.sequences.frame import Frame
from adversarial_lcd_ros.settings import NODE_CONFIGS
from adversarial_lcd_ros.vision.views import Views

VIEW = 'view/compressed'
_CLEAN = 'graph_clean'


class ViewerNode(PipelineNode):
    """Runs Views on topics."""

    default_name = 'viewer'
    configs = NODE_CONFIGS['viewer']
    manual = Manual(
        'pictures of decisions: frame, graph, flipped edges, match, verdict and why',
        subscribes=('image (sensor_msgs/Image), image/compressed (sensor_msgs/CompressedImage)',
                    f'{_CLEAN}, graph (std_msgs/UInt8MultiArray, MultiTierGraph)',
                    'loop_closures (std_msgs/UInt8MultiArray, LoopClosure)',
                    'attack_report (std_msgs/UInt8MultiArray, AttackReport)'),
        publishes=(f'{VIEW} (sensor_msgs/CompressedImage, JPEG): one for each decision, if anyone '
                   'listens',
                   '/diagnostics (diagnostic_msgs/DiagnosticArray): counts, rates'))

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._limits, = self.settings
        self._views = Views()
        self._output = self.create_publisher(CompressedImage, VIEW, qos_profile_sensor_data)
        for topic, message, pixels in (('image', Image, image_pixels),
                                       ('image/compressed', CompressedImage, compressed_pixels)):
            MirroredSubscription(self, message, topic, 'frame', partial(self._on_frame, pixels))
        views = self._views
        for topic, noun, read, note in (
                (_CLEAN, 'graph', partial(decode_graph, limits=self._limits), views.note_clean),
                ('graph', 'graph', partial(decode_graph, limits=self._limits), views.note_graph),
                ('loop_closures', 'loop closure', decode_loop_closure, views.note_decision),
                ('attack_report', 'report', decode_attack_report, views.note_report)):
            MirroredSubscription(self, UInt8MultiArray, topic, noun,
                                 partial(self._on_payload, read, note), raw=True)
        self.say_ready('draws where somebody listens')

    def _is_wanted(self) -> bool:
        return bool(self._output.get_subscription_count())

    def _on_frame(self, pixels: Callable[[Any, int], NDArray[np.uint8]], message: Any) -> None:
        # Kept also where nobody looks yet: a later frame may be matched with it.
        stamp = message.header.stamp
        self.diagnostics.count('received frames')
        self._views.note_frame(Frame.of_pixels(
            checked_stamp_ns(stamp.sec, stamp.nanosec), pixels(message, self._limits.max_pixels)))

    def _on_payload(self, read: Callable[[bytes], Any], note: Callable[[Any], Frame | None],
                    wire: bytes) -> None:
        self.diagnostics.count('received messages')
        if not self._is_wanted():
            return
        self._views.attacked = bool(self.count_publishers(_CLEAN))
        view = note(read(unwrap(wire, self._limits.max_payload_bytes)))
        if view is None:
            return
        seconds, nanoseconds = divmod(view.stamp_ns, 1_000_000_000)
        self._output.publish(CompressedImage(
            header=Header(stamp=Time(sec=seconds, nanosec=nanoseconds)), format=view.encoding,
            data=array('B', view.data)))
        self.diagnostics.count('published views')


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; return its exit code."""
    return run_node(ViewerNode, args)
