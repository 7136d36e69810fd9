# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The hop through the man in the middle, and the whole pipeline in lockstep, between processes."""

from contextlib import contextmanager
from dataclasses import replace
import os
from pathlib import Path
import re
import signal
import struct
import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='rclpy is not installed')

import rclpy
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import UInt8MultiArray

from adversarial_lcd_ros.evaluation.replay.domain import own_domain
from adversarial_lcd_ros.evaluation.replay.processes import node_environment
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.graph_sequences.bags import _graph_messages
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.payload import unwrap, wrap
from adversarial_lcd_ros.messages.types import LcdAnswer, LcdQuery
from adversarial_lcd_ros.nodes.bag_replay import BagReplayNode
from adversarial_lcd_ros.nodes.endpoints import payload_qos
from adversarial_lcd_ros.nodes.lcd import LcdNode
from adversarial_lcd_ros.nodes.runtime import make_executor
from adversarial_lcd_ros.registry import PERTURBATIONS
from adversarial_lcd_ros.sequences.bagfile import BagWriter

PERIOD_S = 1 / 30
GRAPHS, WARM_UP, HOSTILE = 150, 20, 10
DEADLINE_S = 0.033
TIMEOUT_S = 30.0
ATTACKER, RELAY, LCD, REPLAY = (
    'adversarial_lcd_ros.nodes.attacker', 'relay', 'adversarial_lcd_ros.nodes.lcd',
    'adversarial_lcd_ros.nodes.bag_replay')
SURROGATE = {'mode': 'surrogate'}
QUERY = {'mode': 'query', 'deadline_ms': DEADLINE_S * 1e3}


@pytest.fixture(autouse=True)
def loopback(monkeypatch):
    """Put this process and those that it starts into one domain, on this machine only."""
    with own_domain() as domain:
        for name, value in node_environment(domain).items():
            monkeypatch.setenv(name, value)
        monkeypatch.setenv('PYTHONPATH', os.pathsep.join(
            (str(Path(__file__).parents[1]), str(Path(__file__).parent))))
        yield


@contextmanager
def process(module, **parameters):
    """Run a node as a process of its own."""
    command = [sys.executable, '-m', module, '--ros-args']
    for name, value in parameters.items():
        command += ['-p', f'{name}:={value}']
    running = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        yield running
    finally:
        if running.poll() is None:
            running.send_signal(signal.SIGINT)
        running.communicate()


class Probe:
    """Publishes graphs as a builder would, and hears what the detector would."""

    def __init__(self):
        self._context = Context()
        rclpy.init(args=[], context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node('probe', context=self._context)
        self._executor = make_executor(self._context)
        self._executor.add_node(self._node)
        self.arrived = []
        self.reports = []
        self.answers = []
        self.clean = self._publisher('graph_clean')
        self.queries = self._publisher('query')
        self._hear('graph', lambda _: self.arrived.append(time.perf_counter()))
        self._hear('attack_report', lambda wire: self.reports.append(
            codec.decode_attack_report(unwrap(wire))))
        self.decisions = []
        self.graphs = self._publisher('graph')
        self._hear('loop_closures', lambda _: self.decisions.append(time.perf_counter()))
        self._oracle = self._publisher('answer')
        self._hear('query', self._reply)
        self._hear('answer', lambda _: self.answers.append(time.perf_counter()))

    def _publisher(self, topic):
        return self._node.create_publisher(UInt8MultiArray, topic, payload_qos())

    def _hear(self, topic, callback):
        self._node.create_subscription(UInt8MultiArray, topic, callback, payload_qos(), raw=True)

    def decided_by(self):
        """Tell whether a detector hears the graphs of this probe, and is heard."""
        return (self._node.count_publishers('loop_closures')
                and self._node.count_subscribers('graph') > 1)

    def _reply(self, wire):
        """Answer at once, in place of a detector, where none runs."""
        if self._node.count_publishers('answer') == 1:
            number = struct.unpack_from('<Q', unwrap(wire), 12)[0]
            self._oracle.publish(wrap(codec.encode_answer(LcdAnswer(number, False, True, 0.25))))

    def until(self, condition):
        deadline_s = time.monotonic() + TIMEOUT_S
        while not condition():
            assert time.monotonic() < deadline_s, 'the nodes did not answer'
            self._executor.spin_once(timeout_sec=0.01)

    def round_trips(self, publisher, heard, wires):
        """Publish at 30 Hz, and return the seconds from each to what comes back, shape (k,)."""
        taken = []
        for wire in wires:
            began_s, before = time.perf_counter(), len(heard)
            publisher.publish(wire)
            self.until(lambda: len(heard) > before)  # noqa: B023
            taken.append(heard[-1] - began_s)
            while time.perf_counter() < began_s + PERIOD_S:
                self._executor.spin_once(timeout_sec=0.001)
        return np.array(taken)

    def close(self):
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.shutdown()


@pytest.fixture
def probe(loopback):
    found = Probe()
    yield found
    found.close()


def stream(graphs):
    """Return the graphs of the tour over and over, as they would be published."""
    return [replace(graphs[number % len(graphs)], stamp_ns=round((number + 1) * PERIOD_S * 1e9),
                    sequence=number) for number in range(WARM_UP + GRAPHS)]


def through(probe, module, wires, **parameters):
    """Return the round trips through a node, without the first ones."""
    with process(module, **parameters):
        probe.until(lambda: probe.clean.get_subscription_count())
        taken = probe.round_trips(probe.clean, probe.arrived, wires)[WARM_UP:]
        probe.until(lambda: module == RELAY or len(probe.reports) == len(wires))
    probe.until(lambda: not probe.clean.get_subscription_count())
    return taken


@pytest.mark.parametrize('features', [300, 1000])
def test_surrogate_only(measured, probe, tour_graphs, features):
    graphs = stream(tour_graphs(features))
    wires = [wrap(codec.encode_graph(graph)) for graph in graphs]
    size = f'n = {graphs[0].node_count}, surrogate only'
    relayed = through(probe, RELAY, wires)
    attacked = through(probe, ATTACKER, wires, **SURROGATE)
    assert all(report.edits for report in probe.reports)
    inside = [report.duration_s for report in probe.reports[WARM_UP:]]
    for share, mark in ((50, 5e-3), (99, PERIOD_S)):
        measured('hop', f'{size}, arrival to publication, p{share}',
                 np.percentile(inside, share), mark=mark if features == 300 else None)
        measured('hop', f'{size}, there and back, p{share}', np.percentile(attacked, share),
                 'bare relay of the bytes', np.percentile(relayed, share))


def test_query_guided_keeps_its_deadline(measured, probe, tour_graphs):
    graphs = stream(tour_graphs(300))
    wires = [wrap(codec.encode_graph(graph)) for graph in graphs]
    with process(LCD, min_gap_s=0.5):
        probe.until(lambda: probe.queries.get_subscription_count())
        through(probe, ATTACKER, wires, **QUERY)
        # The first query about a frame is the longest: the detector has not met its nodes.
        asked = probe.round_trips(probe.queries, probe.answers, [
            wrap(codec.encode_query(LcdQuery(number, graph)))
            for number, graph in enumerate(graphs[-50:])])
    reports = probe.reports[WARM_UP:]
    assert any(report.reason == 'deadline' for report in reports)
    measured('hop', f'n = {graphs[0].node_count}, query-guided, deadline {DEADLINE_S * 1e3:g} ms, '
             'longest beside deadline and longest query',
             max(report.duration_s for report in reports), mark=DEADLINE_S + asked.max())


def test_a_flood_of_queries_delays_a_decision_by_one_query(measured, probe, tour_graphs):
    graphs = stream(tour_graphs(300))[:WARM_UP + 60]
    wires = [wrap(codec.encode_graph(graph)) for graph in graphs]
    query = wrap(codec.encode_query(LcdQuery(1, tour_graphs(5000)[-1])))
    with process(LCD, min_gap_s=0.5):
        probe.until(lambda: probe.queries.get_subscription_count() and probe.decided_by())
        alone = probe.round_trips(probe.graphs, probe.decisions, wires[:WARM_UP + 30])[WARM_UP:]
        asked_s = probe.round_trips(probe.queries, probe.answers, [query]).max()
        for _ in range(100):
            probe.queries.publish(query)
        flooded = []
        for wire in wires[WARM_UP + 30:]:
            probe.queries.publish(query)
            flooded += probe.round_trips(probe.graphs, probe.decisions, [wire]).tolist()
    measured('decision', 'n = 303, beside a flood of queries with 5,000 features, p50',
             np.median(flooded), 'without queries', np.median(alone),
             mark=np.median(alone) + asked_s)


def hostile_graphs(size, objects, edges):
    """Return graphs as large as the limits allow, nine seconds apart."""
    rng = np.random.default_rng(size)
    position = (rng.random((size, 2)) * (640, 480)).astype(np.float32)
    ends = (np.stack(np.triu_indices(size, 1), axis=1) if edges is None else
            np.sort(rng.integers(0, size, (edges, 2)), axis=1))
    key = np.unique(ends[ends[:, 0] < ends[:, 1]] @ (size, 1))
    edge = np.stack(np.divmod(key, size), axis=1).astype(np.uint32)
    offset = position[edge[:, 0]] - position[edge[:, 1]]
    tier = (np.arange(size) >= objects).astype(np.uint8)
    descriptor = rng.integers(0, 256, (size, 32)).astype(np.uint8) * tier[:, None]
    word = np.arange(1000, dtype=np.uint32)
    return [MultiTierGraph(
        stamp_ns=round(number * 9e9), frame_id='camera', sequence=number, width=640, height=480,
        tier=tier, label=np.zeros(size, np.uint32), position=position,
        size=np.ones((size, 2), np.float32), score=np.ones(size, np.float32),
        descriptor=descriptor, edge=edge,
        edge_length=(np.hypot(*offset.T) / 800).astype(np.float32),
        word=word, word_weight=np.full(1000, 1e-3, np.float32)) for number in range(HOSTILE)]


LARGEST = {'10,000 nodes, 200,000 edges': (10_000, 0, 190_000),
           '2,000 objects': (10_000, 2_000, 190_000), 'complete graph of 300': (300, 0, None)}


@pytest.mark.parametrize('mode', ['query', 'surrogate'])
@pytest.mark.parametrize('perturbation', [*PERTURBATIONS, 'recall'])
def test_the_largest_graphs_keep_the_deadline(measured, probe, perturbation, mode):
    late = {}
    for name, size in LARGEST.items():
        wires = [wrap(codec.encode_graph(graph)) for graph in hostile_graphs(*size)]
        probe.reports.clear()
        search = ({'search': 'recall'} if perturbation == 'recall' else
                  {'perturbation': perturbation})
        with process(ATTACKER, **search, **QUERY | {'mode': mode}):
            probe.until(lambda: probe.clean.get_subscription_count())
            probe.round_trips(probe.clean, probe.arrived, wires)
            probe.until(lambda: len(probe.reports) == HOSTILE)
        probe.until(lambda: not probe.clean.get_subscription_count())
        late[name] = max(report.duration_s for report in probe.reports)
    print(perturbation, mode, {name: round(value * 1e3) for name, value in late.items()})
    measured('hop', f'{mode}, {perturbation}, deadline {DEADLINE_S * 1e3:g} ms, longest of the '
             'largest graphs allowed, arrival to publication', max(late.values()),
             mark=DEADLINE_S + 20e-3)


@pytest.fixture(scope='module')
def graph_bag(tour, tmp_path_factory):
    """Return a bag with the graphs of all frames of the tour, 300 features each."""
    from adversarial_lcd_ros.config import BuilderConfig
    from adversarial_lcd_ros.vision.builder import GraphBuilder
    path = tmp_path_factory.mktemp('lockstep') / 'graphs'
    with GraphBuilder(BuilderConfig(detector='none')) as builder, BagWriter(path) as bag:
        graphs = [builder.build(frame.image(), frame.stamp_ns, tour.name, number)
                  for number, frame in enumerate(tour.frames())]
        for row in _graph_messages(graphs, '/graph'):
            bag.write(*row)
    return path


def seconds_a_frame(said, frames):
    """Read what bag_replay said of a replay in which nothing was lost."""
    found = re.search(r'(\d+) frames, (\d+) decisions, [\d.]+ s, ([\d.]+) frames/s', said)
    assert found, said
    assert int(found[1]) == int(found[2]) == frames
    return 1 / float(found[3])


@pytest.mark.parametrize(('target', 'mark'), [('vbow', 1 / 300), ('wl', None)])
def test_lockstep_in_one_process(measured, graph_bag, tour, capfd, target, mark):
    from rclpy.parameter import Parameter
    context = Context()
    rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
    executor = make_executor(context)
    nodes = [node_class(context=context, use_global_arguments=False, parameter_overrides=[
        Parameter(name, value=value) for name, value in parameters.items()])
        for node_class, parameters in (
            (LcdNode, {'target': target}),
            (BagReplayNode, {'bag': str(graph_bag), 'lockstep': True}))]
    for node in nodes:
        executor.add_node(node)

    def spin(seconds):
        executor.spin_once(timeout_sec=seconds)
        return True

    assert nodes[1].work(spin) == 0
    for node in reversed(nodes):
        node.close()
        executor.remove_node(node)
        node.destroy_node()
    executor.shutdown()
    context.shutdown()
    measured('lockstep', f'one process, target {target}, a graph',
             seconds_a_frame(capfd.readouterr().out, tour.frame_count), mark=mark)


@pytest.mark.parametrize(('target', 'mark'), [('vbow', 1 / 200), ('wl', None)])
def test_lockstep_across_processes(measured, graph_bag, tour, target, mark):
    with (process(LCD, target=target),
          process(REPLAY, bag=graph_bag, lockstep='true', window=4) as replay):
        said, _ = replay.communicate(timeout=60)
    measured('lockstep', f'two processes, target {target}, a graph',
             seconds_a_frame(said, tour.frame_count), mark=mark)
