# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node lcd: one decision for each graph, answers that leave no trace, damage survived."""

from dataclasses import replace
import struct

from graph_factory import make_graph
import numpy as np
import pytest

from adversarial_lcd_ros.edge_rule import joined_pairs
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.files.keys import make_key, read_key
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.sealing import Sealer

pytest.importorskip('rclpy', reason='rclpy is not installed')

from std_msgs.msg import Bool, Float64, Header

from adversarial_lcd_ros.messages.payload import unwrap, wrap
from adversarial_lcd_ros.nodes.lcd import LcdNode

SECOND = 1_000_000_000
EDGES = [(0, 1), *((0, k) for k in range(2, 12)), *((k, k + 1) for k in range(2, 39))]


def graph(index):
    return make_graph(40, EDGES, stamp_ns=index * SECOND + 7, sequence=index)


def damaged():
    """Yield messages that must be refused: broken outside, inside, or in what they say."""
    good = codec.encode_graph(graph(1))
    wire = wrap(good)
    yield 'empty message', b''
    yield 'no encapsulation', b'\xff' * 40
    yield 'outer length 2 GB', wire[:12] + struct.pack('<I', 2**31 - 1) + wire[16:]
    yield 'outer cut', wire[:-5]
    yield 'empty payload', wrap(b'')
    yield 'payload cut', wrap(good[:len(good) // 2])
    yield 'random payload', wrap(np.random.default_rng(0).bytes(500))
    tiers = good.index(struct.pack('<I', 40) + bytes(2) + b'\x01' * 38)
    yield 'inner length 2 GB', wrap(good[:tiers] + struct.pack('<I', 2**31 - 1)
                                    + good[tiers + 4:])
    position = graph(1).position.tobytes()
    nan = np.full(80, np.nan, np.float32).tobytes()
    yield 'not finite', wrap(good.replace(position, nan))
    target = graph(1).edge[:, 1].tobytes()
    nowhere = np.full(len(EDGES), 4000, np.uint32).tobytes()
    yield 'edge to nowhere', wrap(good.replace(target, nowhere))


DAMAGED = dict(damaged())


def test_decisions_are_said_in_standard_messages_too(ros, lcd):
    decisions = ros.collect('loop_closures', lambda wire: codec.decode_loop_closure(unwrap(wire)))
    found = {topic: ros.collect(topic, lambda message: message, kind, raw=False)
             for topic, kind in (('probability', Float64), ('loop', Bool), ('match', Header))}
    graphs = ros.publisher('graph')
    ros.matched(graphs)
    ros.until(lambda: all(ros.probe.count_publishers(topic) for topic in found))
    for index in range(6):
        graphs.publish(wrap(codec.encode_graph(graph(index))))
    ros.until(lambda: len(decisions) == len(found['loop']) == len(found['probability']) == 6)
    matched = [decision for decision in decisions if decision.match_stamp_ns is not None]
    ros.until(lambda: len(found['match']) == len(matched))
    assert 0 < len(matched) < 6
    assert [row.data for row in found['probability']] == [row.probability for row in decisions]
    assert [row.data for row in found['loop']] == [row.is_loop for row in decisions]
    assert any(row.data for row in found['loop'])
    assert [row.stamp.sec * SECOND + row.stamp.nanosec for row in found['match']] == [
        decision.match_stamp_ns for decision in matched]
    assert {row.frame_id for row in found['match']} == {'camera'}


@pytest.fixture
def lcd(ros, lcd_model):
    return ros.start(LcdNode, model=lcd_model, min_gap_s=2)


def test_every_graph_gets_one_decision(ros, lcd):
    decisions = ros.collect('loop_closures', lambda wire: codec.decode_loop_closure(unwrap(wire)))
    graphs = ros.publisher('graph')
    ros.matched(graphs)
    for index in range(6):
        graphs.publish(wrap(codec.encode_graph(graph(index))))
    ros.until(lambda: len(decisions) == 6)
    assert [(d.stamp_ns, d.sequence, d.frame_id) for d in decisions] == [
        (graph(k).stamp_ns, k, 'camera') for k in range(6)]
    assert [d.is_loop for d in decisions] == [False, False, True, True, True, True]
    assert lcd.detector.keyframe_count == 6


def test_queries_are_answered_and_forgotten(ros, lcd):
    answers = ros.collect('answer', lambda wire: codec.decode_answer(unwrap(wire)))
    graphs, queries = ros.publisher('graph'), ros.publisher('query')
    ros.matched(graphs)
    ros.matched(queries)
    graphs.publish(wrap(codec.encode_graph(graph(0))))
    ros.until(lambda: lcd.detector.keyframe_count == 1)
    for number in range(20):
        queries.publish(wrap(codec.encode_query(codec.LcdQuery(2**40 + number, graph(5)))))
    ros.until(lambda: len(answers) == 20)
    assert [answer.id for answer in answers] == [2**40 + number for number in range(20)]
    assert {answer.probability for answer in answers} == {
        lcd.detector.judge(graph(5)).probability}
    assert lcd.detector.keyframe_count == 1


@pytest.mark.parametrize('name', DAMAGED)
def test_damaged_messages_are_refused_counted_and_survived(ros, lcd, name):
    decisions = ros.collect('loop_closures', lambda wire: codec.decode_loop_closure(unwrap(wire)))
    graphs, queries = ros.publisher('graph'), ros.publisher('query')
    ros.matched(graphs)
    ros.matched(queries)
    for publisher in (graphs, queries):
        publisher.publish(DAMAGED[name])
    ros.until(lambda: lcd.diagnostics['refused graph'] and lcd.diagnostics['refused query'])
    graphs.publish(wrap(codec.encode_graph(graph(1))))
    ros.until(lambda: decisions)
    assert decisions[0].sequence == 1
    assert lcd.detector.keyframe_count == 1


def test_graphs_without_nodes_words_or_edges_are_decided(ros, lcd):
    decisions = ros.collect('loop_closures', lambda wire: codec.decode_loop_closure(unwrap(wire)))
    graphs = ros.publisher('graph')
    ros.matched(graphs)
    bare = codec.MultiTierGraph(SECOND, 'camera', 0, 640, 480)
    wordless = replace(graph(9), word=bare.word, word_weight=bare.word_weight)
    sent = [bare, replace(bare, stamp_ns=9 * SECOND), wordless,
            make_graph(40, [], stamp_ns=20 * SECOND), graph(30)]
    for one in sent:
        graphs.publish(wrap(codec.encode_graph(one)))
    ros.until(lambda: len(decisions) == len(sent))
    assert [d.stamp_ns for d in decisions] == [one.stamp_ns for one in sent]


def test_diagnostics_tell_keyframes_and_refusals(ros, lcd):
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
    found = ros.collect('/diagnostics', lambda message: message.status[0], DiagnosticArray,
                        raw=False)
    graphs = ros.publisher('graph')
    ros.matched(graphs)
    graphs.publish(wrap(codec.encode_graph(graph(0))))
    graphs.publish(b'junk')
    ros.until(lambda: lcd.diagnostics['refused graph'])
    lcd.diagnostics.publish()
    ros.until(lambda: any(status.level == DiagnosticStatus.WARN for status in found))
    status = next(status for status in found if status.level == DiagnosticStatus.WARN)
    values = {value.key: value.value for value in status.values}
    assert (values['keyframes'], values['received graphs'], values['refused graph']) == (
        '1', '2', '1')
    assert status.name.startswith('lcd: ')


def test_under_a_key_only_sealed_graphs_count(ros, lcd_model, tmp_path):
    make_key(tmp_path / 'key')
    lcd = ros.start(LcdNode, model=lcd_model, min_gap_s=2, key=str(tmp_path / 'key'))
    decisions = ros.collect('loop_closures', lambda wire: codec.decode_loop_closure(unwrap(wire)))
    graphs = ros.publisher('graph')
    ros.matched(graphs)
    sealer = Sealer(read_key(tmp_path / 'key'))
    sealed = [sealer.seal(codec.encode_graph(graph(index), 5)) for index in range(4)]
    changed = sealed[2].replace(graph(2).edge_length.tobytes(),
                                (graph(2).edge_length + np.float32(1e-6)).tobytes())
    for payload in (sealed[0], sealed[1], codec.encode_graph(graph(2)), changed, sealed[1],
                    Sealer(bytes(32)).seal(sealed[2]), sealed[3], sealed[2]):
        graphs.publish(wrap(payload))
    ros.until(lambda: lcd.diagnostics['refused graph'] == 5 and len(decisions) >= 3)
    assert [decision.sequence for decision in decisions] == [0, 1, 3]
    assert {cause: lcd.diagnostics[f'refused graph: {cause}'] for cause in (
        'unsealed', 'seal', 'replayed', 'reordered')} == {
            'unsealed': 1, 'seal': 2, 'replayed': 1, 'reordered': 1}


def test_a_key_that_cannot_be_used_ends_the_start(ros, lcd_model, tmp_path):
    with pytest.raises(ConfigError, match=r'parameter key: .*nowhere cannot be read'):
        ros.start(LcdNode, model=lcd_model, key=str(tmp_path / 'nowhere'))


def test_edges_that_nodes_do_not_explain_are_counted(ros, lcd_model):
    lcd = ros.start(LcdNode, model=lcd_model, defences='rederive_check')
    graphs = ros.publisher('graph')
    ros.matched(graphs)
    nodes = graph(0)
    clean = nodes.with_edges(*(lambda edge: (edge, nodes.length_between(edge)))(
        joined_pairs(nodes.position, nodes.size, nodes.object_count, 6)))
    graphs.publish(wrap(codec.encode_graph(clean)))
    graphs.publish(wrap(codec.encode_graph(replace(
        clean.flip([(5, 6), (0, 7), (30, 31)]), stamp_ns=SECOND, sequence=1))))
    ros.until(lambda: lcd.diagnostics['published loop closures'] == 2)
    assert lcd.diagnostics['unexplained edges'] == 3
    assert lcd.diagnostics['graphs with unexplained edges'] == 1
