# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ROS in one process: a context, an executor and nodes of its own for each test."""

import os
import time

import pytest

# Read by the message classes when they are imported: a wrong type is an error, not garbage.
os.environ.setdefault('ROS_PYTHON_CHECK_FIELDS', '1')

# Generous: the machine may be busy. What hangs would hang for ever.
DEADLINE_S = 60.0


class Ros:
    """Nodes under test and a probe beside them, driven by one executor."""

    def __init__(self):
        import rclpy
        from rclpy.context import Context
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions
        self.context = Context()
        rclpy.init(args=[], context=self.context, signal_handler_options=SignalHandlerOptions.NO)
        self.executor = SingleThreadedExecutor(context=self.context)
        self._nodes = []
        self.probe = self._add(rclpy.create_node('probe', context=self.context,
                                                 use_global_arguments=False))

    def _add(self, node):
        self._nodes.append(node)
        self.executor.add_node(node)
        return node

    def start(self, node_class, *remaps, **parameters):
        """Start a node; remaps are like 'graph:=graph_clean'."""
        from rclpy.parameter import Parameter
        return self._add(node_class(
            context=self.context, use_global_arguments=False,
            cli_args=['--ros-args', *(part for remap in remaps for part in ('-r', remap))],
            parameter_overrides=[Parameter(k, value=v) for k, v in parameters.items()]))

    def stop(self, node):
        """End a node as its process would."""
        self._nodes.remove(node)
        self._end(node)

    def _end(self, node):
        self.executor.remove_node(node)
        if node is not self.probe:
            node.close()
        node.destroy_node()

    def publisher(self, topic, message=None, **qos):
        """Return a publisher of the probe; of payloads unless told otherwise."""
        return self._endpoint(self.probe.create_publisher, topic, message, qos)

    def collect(self, topic, read, message=None, *, raw=True, **qos):
        """Return a list that fills with what read() makes of the topic's messages."""
        found = []
        self._endpoint(self.probe.create_subscription, topic, message, qos,
                       lambda wire: found.append(read(wire)), raw=raw)
        return found

    @staticmethod
    def _endpoint(create, topic, message, qos, *callback, **options):
        from rclpy.qos import QoSProfile
        from std_msgs.msg import UInt8MultiArray
        profile = QoSProfile(**({'depth': 1000} | qos))
        return create(message or UInt8MultiArray, topic, *callback, profile, **options)

    def spin(self, seconds):
        """Run callbacks, as PipelineNode.work expects it."""
        self.executor.spin_once(timeout_sec=seconds)
        return True

    def until(self, condition, deadline_s=DEADLINE_S):
        """Run callbacks until the condition holds; fail at the deadline."""
        end_s = time.monotonic() + deadline_s
        while not condition():
            assert time.monotonic() < end_s, 'the condition did not come true in time'
            self.executor.spin_once(timeout_sec=0.02)

    def matched(self, publisher, subscribers=1):
        """Wait until a publisher has its subscribers."""
        self.until(lambda: publisher.get_subscription_count() >= subscribers)

    def close(self):
        for node in reversed(self._nodes):
            self._end(node)
        self.executor.shutdown()
        self.context.shutdown()


@pytest.fixture
def ros(monkeypatch):
    """Return ROS inside this process, which nothing leaves; skip where rclpy is absent."""
    pytest.importorskip('rclpy', reason='rclpy is not installed: pip install ".[ros]"')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'OFF')
    monkeypatch.delenv('ROS_STATIC_PEERS', raising=False)
    world = Ros()
    yield world
    world.close()


@pytest.fixture
def lcd_model(tmp_path):
    """Return the path of a decision that calls a graph's near copies loop closures."""
    from adversarial_lcd_ros.lcd.decision import Decision
    from adversarial_lcd_ros.lcd.targets import TARGETS
    channels = TARGETS['wl'].channels
    path = tmp_path / 'wl.json'
    Decision('wl', channels, (10.0,) * len(channels), -10.0).save(path)
    return str(path)


@pytest.fixture
def vocabulary(tmp_path):
    """Return the path of a small vocabulary of random words."""
    import numpy as np

    from adversarial_lcd_ros.vision.vocabulary import Vocabulary
    rng = np.random.default_rng(1)
    path = tmp_path / 'vocabulary.npz'
    Vocabulary(rng.integers(0, 256, (8 + 64, 32)).astype(np.uint8), np.ones(64, np.float32),
               8, 2).save(path)
    return str(path)
