# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node attacker: nothing dropped, nothing given away, budgets kept, silence survived."""

from graph_factory import make_graph
import numpy as np
import pytest
from test_nodes_lcd import DAMAGED, EDGES, SECOND, graph

from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.messages import codec

pytest.importorskip('rclpy', reason='rclpy is not installed')

from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from adversarial_lcd_ros.messages.payload import unwrap, wrap
from adversarial_lcd_ros.nodes.attacker import AttackerNode
from adversarial_lcd_ros.nodes.lcd import LcdNode


class Line:
    """A publisher of clean graphs, an attacker, and what comes out of it."""

    def __init__(self, ros, mode='query', qos=None, listeners=1, **parameters):
        self.ros = ros
        self.node = ros.start(AttackerNode, mode=mode, **parameters)
        self.clean = ros.publisher('graph_clean', **(qos or {}))
        self.out = ros.collect('graph', lambda wire: wire, **(qos or {}))
        self.reports = ros.collect('attack_report',
                                   lambda wire: codec.decode_attack_report(unwrap(wire)))
        ros.matched(self.clean)
        ros.matched(self.node._output, listeners)

    def send(self, *wires):
        """Send messages, wait for as many to come out, and return those."""
        start = len(self.out)
        for wire in wires:
            self.clean.publish(wire)
        self.ros.until(lambda: len(self.out) >= start + len(wires))
        return self.out[start:]


def wire_of(index):
    return wrap(codec.encode_graph(graph(index)))


@pytest.mark.parametrize('mode', ['pass', 'query'])
def test_what_cannot_be_attacked_passes_byte_for_byte(ros, mode):
    line = Line(ros, mode, ratio=1e-6)
    wires = [wire_of(index) for index in range(30)]
    assert line.send(*wires) == wires
    ros.until(lambda: len(line.reports) == 30)
    assert [r.sequence for r in line.reports] == list(range(30))
    assert [r.stamp_ns for r in line.reports] == [graph(k).stamp_ns for k in range(30)]
    assert {(r.status, r.edits, r.queries) for r in line.reports} == {('skipped', 0, 0)}


@pytest.mark.parametrize('name', DAMAGED)
def test_what_it_cannot_read_passes_byte_for_byte(ros, name):
    line = Line(ros)
    assert line.send(DAMAGED[name]) == [DAMAGED[name]]
    assert line.node.diagnostics['forwarded unread'] == 1


def test_attacked_graphs_keep_stamp_frame_and_sequence(ros, lcd_model):
    lcd = ros.start(LcdNode, model=lcd_model, min_gap_s=1)
    line = Line(ros, listeners=2, ratio=3 / 40**2, queries_per_edit=10, query_timeout_s=60)
    decisions = ros.collect('loop_closures',
                            lambda wire: codec.decode_loop_closure(unwrap(wire)))
    for index in range(6):
        out = codec.decode_graph(unwrap(line.send(wire_of(index))[0]))
        assert (out.stamp_ns, out.frame_id, out.sequence) == (
            graph(index).stamp_ns, 'camera', index)
        assert len(graph(index).flips_to(out)) <= 3
        ros.until(lambda count=index + 1: len(line.reports) == len(decisions) == count)
    assert sum(report.edits for report in line.reports) > 0
    assert all(report.queries <= report.query_budget == 30 for report in line.reports)
    assert line.node.diagnostics['published queries'] == sum(r.queries for r in line.reports)
    # Queries never enter the database: six graphs came, six are remembered.
    assert lcd.detector.keyframe_count == 6


@pytest.mark.parametrize('listens', [False, True])
def test_without_answers_graphs_are_forwarded_after_the_timeout(ros, listens):
    line = Line(ros, ratio=0.01, query_timeout_s=0.05)
    if listens:
        ros.collect('query', bytes)
    wires = [wire_of(index) for index in range(3)]
    assert line.send(*wires) == wires
    ros.until(lambda: len(line.reports) == 3)
    assert {(r.status, r.reason) for r in line.reports} == {('skipped', 'no answer')}
    assert line.node.diagnostics['queries without answer'] == 3


def test_answers_of_other_queries_and_damaged_answers_are_ignored(ros):
    line = Line(ros, ratio=0.01, query_timeout_s=0.2)
    queries = ros.collect('query', lambda wire: codec.decode_query(unwrap(wire)))
    answers = ros.publisher('answer')
    ros.matched(answers)
    line.clean.publish(wire_of(0))
    ros.until(lambda: queries)
    answers.publish(b'junk')
    answers.publish(wrap(codec.encode_answer(
        codec.LcdAnswer(queries[0].id + 1, True, True, 0.9))))
    ros.until(lambda: line.reports and line.node.diagnostics['refused answer'])
    assert line.reports[0].reason == 'no answer'
    assert line.node.diagnostics['refused answer'] == 1


def test_a_backlog_is_forwarded_in_order_and_reported(ros):
    line = Line(ros, ratio=0.01, query_timeout_s=60, max_backlog=3)
    queries = ros.collect('query', bytes)  # someone listens, nobody answers
    wires = [wire_of(index) for index in range(5)]
    line.clean.publish(wires[0])
    ros.until(lambda: queries)
    # With the fourth that waits, the attack under way ends and all of them are let go.
    for wire in wires[1:]:
        line.clean.publish(wire)
    ros.until(lambda: len(line.reports) == 5)
    ros.until(lambda: len(line.out) == 5)
    assert line.out == wires
    assert [r.reason for r in line.reports] == ['backlog'] * 5
    assert line.node.diagnostics['skipped for backlog'] == 5
    ros.until(lambda: not line.node._catching_up)
    line.clean.publish(wires[0])
    ros.until(lambda: len(queries) == 2)  # caught up: attacked again


def test_closing_forwards_what_waits(ros):
    line = Line(ros, ratio=0.01, query_timeout_s=60, max_backlog=100)
    ros.collect('query', bytes)
    wires = [wire_of(index) for index in range(5)]
    for wire in wires:
        line.clean.publish(wire)
    ros.until(lambda: line.node.diagnostics['received graphs'] == 5)
    line.node.close()
    ros.until(lambda: len(line.out) == 5)
    assert line.out == wires


def test_a_defect_of_an_attack_stops_no_graph(ros, monkeypatch):
    line = Line(ros, ratio=0.01)
    monkeypatch.setattr(line.node._attacker, 'process', lambda graph, ask: 1 // 0)
    assert line.send(wire_of(0), wire_of(1)) == [wire_of(0), wire_of(1)]
    assert line.node.diagnostics['failed attacks'] == 2


@pytest.mark.parametrize(('reliability', 'durability'), [
    (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE),
    (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL)])
def test_the_qos_of_the_publisher_is_mirrored(ros, reliability, durability):
    qos = {'reliability': reliability, 'durability': durability}
    line = Line(ros, 'pass', qos)
    assert line.send(wire_of(0)) == [wire_of(0)]
    (mine,) = ros.probe.get_publishers_info_by_topic('graph')
    assert (mine.qos_profile.reliability, mine.qos_profile.durability) == (reliability, durability)
    (mine,) = ros.probe.get_subscriptions_info_by_topic('graph_clean')
    assert (mine.qos_profile.reliability, mine.qos_profile.durability) == (reliability, durability)


def test_a_latched_graph_is_passed_on_to_the_latecomer(ros):
    qos = {'durability': DurabilityPolicy.TRANSIENT_LOCAL}
    clean = ros.publisher('graph_clean', **qos)
    clean.publish(wire_of(4))
    ros.start(AttackerNode, mode='pass')
    out = ros.collect('graph', lambda wire: wire, **qos)
    ros.until(lambda: out)
    assert out == [wire_of(4)]


def test_lcd_hears_a_best_effort_publisher(ros, lcd_model):
    lcd = ros.start(LcdNode, model=lcd_model)
    graphs = ros.publisher('graph', reliability=ReliabilityPolicy.BEST_EFFORT)
    ros.matched(graphs)
    graphs.publish(wire_of(0))
    ros.until(lambda: lcd.detector.keyframe_count == 1)


@pytest.mark.parametrize('remap', ['graph:=graph_clean', 'graph_clean:=graph',
                                   'graph_clean:=/graph'])
def test_one_topic_for_input_and_output_is_refused(ros, remap):
    with pytest.raises(ConfigError, match='both resolve to'):
        ros.start(AttackerNode, remap)


def test_the_same_seed_gives_the_same_bytes_over_ros(ros, lcd_model):
    """Node and core agree: what goes out is what Attacker.process makes of the same answers."""
    from adversarial_lcd_ros.attack.attacker import Attacker
    from adversarial_lcd_ros.config import AttackConfig
    lcd = ros.start(LcdNode, model=lcd_model, min_gap_s=1)
    line = Line(ros, listeners=2, ratio=0.002, queries_per_edit=8, query_timeout_s=60)
    core = Attacker(AttackConfig(ratio=0.002, queries_per_edit=8))
    for index in range(0, 6, 2):
        clean = make_graph(40, EDGES, stamp_ns=index * SECOND, sequence=index, seed=index // 4)
        expected = core.process(clean, lambda g: lcd.detector.answer(codec.LcdQuery(1, g)))
        (out,) = line.send(wrap(codec.encode_graph(clean)))
        assert out == wrap(codec.encode_graph(expected.perturbed))
        ros.until(lambda count=index // 2 + 1: lcd.detector.keyframe_count == count)
    assert np.sum([report.edits for report in line.reports]) > 0
