# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""No message ends a node: refused by cause, defects survived, deadlines kept, trouble said."""

from array import array
from dataclasses import replace
import struct
from threading import Event
import time
import zlib

from graph_factory import make_graph
import numpy as np
import pytest
from test_codec import damaged
from test_nodes_lcd import SECOND, graph

from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.payload import unwrap, wrap

pytest.importorskip('rclpy', reason='rclpy is not installed')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.qos import ReliabilityPolicy
from sensor_msgs.msg import CompressedImage, Image

from adversarial_lcd_ros.nodes.attacker import AttackerNode
from adversarial_lcd_ros.nodes.graph_builder import GraphBuilderNode
from adversarial_lcd_ros.nodes.lcd import LcdNode

HEAVY = wrap(damaged(word_weight=np.full(6, 1e12 / 6, np.float32)))


def wire_of(index, **fields):
    return wrap(codec.encode_graph(replace(graph(index), **fields)))


def query_of(index, number=1):
    return wrap(codec.encode_query(codec.LcdQuery(number, graph(index))))


@pytest.fixture
def lcd(ros, lcd_model):
    return ros.start(LcdNode, model=lcd_model, min_gap_s=2)


@pytest.fixture
def decisions(ros):
    return ros.collect('loop_closures', lambda wire: codec.decode_loop_closure(unwrap(wire)))


def send(ros, topic, *wires, **qos):
    """Publish messages once somebody listens."""
    publisher = ros.publisher(topic, **qos)
    ros.matched(publisher)
    for wire in wires:
        publisher.publish(wire)
    return publisher


@pytest.fixture
def one_status(monkeypatch):
    """Let nodes tell their status when asked alone: another one would take the news away."""
    monkeypatch.setattr('adversarial_lcd_ros.nodes.diagnostics.PERIOD_S', 1e6)
    monkeypatch.setattr('adversarial_lcd_ros.nodes.diagnostics._LATE_S', 1e6)


def status_of(ros, node):
    """Return the level, the line and the values of a node's next status."""
    found = ros.collect('/diagnostics', lambda message: message.status[0], DiagnosticArray,
                        raw=False)
    ros.until(lambda: node.count_subscribers('/diagnostics'))
    name = node.get_name()
    node.diagnostics.publish()
    ros.until(lambda: any(status.name.startswith(name) for status in found))
    status = next(status for status in found if status.name.startswith(name))
    return status.level, status.message, {value.key: value.value for value in status.values}


def test_a_graph_of_heavy_words_ends_no_detector(ros, lcd, decisions):
    query = codec._dump(codec._type('adversarial_lcd_ros/msg/LcdQuery')(
        schema_version=2, id=1, graph=replace(
            codec._graph_message(graph(1)),
            word_weight=np.full(len(graph(1).word), 1e9, np.float32))), 'LcdQuery')
    send(ros, 'query', wrap(query))
    send(ros, 'graph', HEAVY, wire_of(1))
    ros.until(lambda: decisions and lcd.diagnostics['refused query'])
    assert lcd.diagnostics['refused graph: word weights'] == 1
    assert lcd.diagnostics['refused query: word weights'] == 1
    assert lcd.detector.keyframe_count == 1


@pytest.mark.parametrize('error', [OverflowError('x'), MemoryError(), ValueError('y')])
def test_a_defect_of_our_own_is_survived_and_counted(
        ros, one_status, lcd, decisions, monkeypatch, error):
    def broken(*_):
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(lcd.detector, 'detect', broken)
        patch.setattr(lcd.detector, 'answer', broken)
        graphs = send(ros, 'graph', wire_of(1))
        send(ros, 'query', query_of(1))
        ros.until(lambda: lcd.diagnostics['defects'] == 2)
        level, line, _ = status_of(ros, lcd)
        assert level == DiagnosticStatus.ERROR
        assert '2 defects' in line
    graphs.publish(wire_of(2))
    ros.until(lambda: decisions)


def test_refusals_are_counted_by_cause_and_refusing_all_is_an_error(ros, one_status, lcd):
    send(ros, 'graph', b'junk', HEAVY, HEAVY,
         wrap(damaged(node_size=np.zeros(12, np.float32))))
    ros.until(lambda: lcd.diagnostics['refused graph'] == 4)
    level, line, values = status_of(ros, lcd)
    assert level == DiagnosticStatus.ERROR
    assert '4 refused graph' in line
    assert {name: number for name, number in values.items() if name.startswith('refused')} == {
        'refused graph': '4', 'refused graph: unreadable': '1',
        'refused graph: word weights': '2', 'refused graph: node size': '1'}


def test_limits_are_parameters(ros, lcd_model, decisions):
    lcd = ros.start(LcdNode, model=lcd_model, max_nodes=39, max_payload_bytes=100_000)
    large = wrap(codec.encode_graph(make_graph(nodes=2500)))
    send(ros, 'graph', wire_of(0), large, wrap(codec.encode_graph(make_graph())))
    ros.until(lambda: decisions)
    assert lcd.diagnostics['refused graph: too many nodes'] == 1
    assert lcd.diagnostics['refused graph: bytes'] == 1


def test_graphs_are_decided_before_the_queries_that_wait(ros, lcd, decisions):
    answers = ros.collect('answer', lambda wire: len(decisions))
    queries, graphs = ros.publisher('query'), ros.publisher('graph')
    ros.matched(queries)
    ros.matched(graphs)
    before = []
    decide = lcd._decisions.publish
    lcd._decisions.publish = lambda wire: (
        before.append(lcd.diagnostics['published answers']), decide(wire))
    for number in range(50):
        queries.publish(query_of(5, number))
    graphs.publish(wire_of(0))
    graphs.publish(wire_of(1))
    ros.until(lambda: len(answers) == 50)
    ros.until(lambda: len(decisions) == 2)
    assert max(before) <= 1


def test_queries_have_a_rate(ros, lcd_model):
    lcd = ros.start(LcdNode, model=lcd_model, max_queries_per_s=1)
    began_s = time.monotonic()
    send(ros, 'query', *(query_of(1, number) for number in range(20)))
    ros.until(lambda: lcd.diagnostics['received queries'] == 20)
    answered, refused = (lcd.diagnostics[name] for name in (
        'published answers', 'refused query: rate'))
    assert answered + refused == 20
    assert 1 <= answered <= 2 + time.monotonic() - began_s


@pytest.mark.parametrize(('indices', 'name'), [
    ([0, 1, 4], 'graphs: missing'), ([0, 1, 1], 'graphs: repeated'),
    ([3, 4, 2], 'graphs: out of order'), ([0, 1, 100_000], 'graphs: stamps that jumped')])
def test_what_a_stream_gives_away_is_counted_and_said(
        ros, one_status, lcd, decisions, indices, name):
    send(ros, 'graph', *map(wire_of, indices))
    ros.until(lambda: len(decisions) == 3)
    assert lcd.diagnostics[name] == {'graphs: missing': 2}.get(name, 1)
    level, line, _ = status_of(ros, lcd)
    assert level == DiagnosticStatus.WARN
    assert name in line


@pytest.mark.parametrize(('back', 'name'), [(SECOND, 'graphs: stamps that went back'),
                                            (0, 'graphs: repeated stamps')])
def test_stamps_that_do_not_go_on_are_said(ros, lcd, decisions, back, name):
    send(ros, 'graph', wire_of(3), wire_of(4, stamp_ns=graph(3).stamp_ns - back))
    ros.until(lambda: len(decisions) == 2)
    assert lcd.diagnostics[name] == 1


def test_a_restarted_builder_and_two_at_once_are_told_apart(ros, lcd, decisions):
    send(ros, 'graph', wire_of(5, session=7), wire_of(6, session=7),
         wire_of(7, session=8, sequence=0))
    ros.until(lambda: len(decisions) == 3)
    assert lcd.diagnostics['graphs: restarts'] == 1
    assert lcd.diagnostics['graphs: out of order'] == 0
    assert {decision.session for decision in decisions} == {lcd.session}
    assert decisions[2].match_session == 7
    send(ros, 'graph', wire_of(8, session=7))
    ros.until(lambda: lcd.diagnostics['graphs: of several builders'] == 1)


def test_a_restarted_detector_is_noticed_by_whoever_asks(ros):
    node = ros.start(AttackerNode, ratio=0.01, query_timeout_s=5)
    ros.collect('graph', bytes)
    answers = ros.publisher('answer')

    def reply(wire):
        number = codec.decode_query(unwrap(wire)).id
        session = 1 + len(asked) // 3
        answers.publish(wrap(codec.encode_answer(
            codec.LcdAnswer(number, False, True, 0.25, session=session))))
        return number

    asked = []
    ros._endpoint(ros.probe.create_subscription, 'query', None, {},
                  lambda wire: asked.append(reply(wire)), raw=True)
    send(ros, 'graph_clean', wire_of(0))
    ros.until(lambda: node.diagnostics['restarts of lcd'] >= 1)


def test_a_second_publisher_and_a_lost_one_show(ros, one_status, lcd, decisions, monkeypatch):
    monkeypatch.setattr('adversarial_lcd_ros.nodes.endpoints._STALE_S', 1e6)
    first = send(ros, 'graph', wire_of(0))
    ros.until(lambda: decisions)
    assert status_of(ros, lcd)[0] == DiagnosticStatus.OK
    second = ros.publisher('graph')
    ros.until(lambda: lcd._graphs._publishers == 2)
    assert '2 publishers of /graph' in status_of(ros, lcd)[1]
    for publisher in (first, second):
        ros.probe.destroy_publisher(publisher)
    ros.until(lambda: lcd._graphs._publishers == 0)
    level, line, _ = status_of(ros, lcd)
    assert level == DiagnosticStatus.WARN
    assert 'no publisher of /graph' in line


def test_silence_shows(ros, lcd, decisions, monkeypatch):
    send(ros, 'graph', wire_of(0))
    ros.until(lambda: decisions)
    monkeypatch.setattr('adversarial_lcd_ros.nodes.endpoints._STALE_S', -1.0)
    assert 'nothing on /graph' in status_of(ros, lcd)[1]


def test_qos_follows_a_later_publisher(ros, lcd, decisions):
    send(ros, 'graph', wire_of(0))
    ros.until(lambda: decisions)
    weak = ros.publisher('graph', reliability=ReliabilityPolicy.BEST_EFFORT)
    ros.matched(weak)
    weak.publish(wire_of(1))
    ros.until(lambda: len(decisions) == 2)
    ros.probe.destroy_publisher(weak)
    ros.until(lambda: lcd._graphs._wanted[0] == ReliabilityPolicy.RELIABLE)


def test_qos_can_be_overridden(ros, lcd_model):
    ros.start(LcdNode, model=lcd_model,
              **{'qos_overrides./graph.subscription.reliability': 'best_effort',
                 'qos_overrides./loop_closures.publisher.durability': 'transient_local'})
    send(ros, 'graph')
    (mine,) = ros.probe.get_subscriptions_info_by_topic('graph')
    assert mine.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    (mine,) = ros.probe.get_publishers_info_by_topic('loop_closures')
    assert mine.qos_profile.durability.name == 'TRANSIENT_LOCAL'


@pytest.mark.parametrize(('name', 'value', 'said'), [
    ('use_sim_time', 'yes_please', 'true or false'),
    ('qos_overrides./graph.subscription.reliability', 'perhaps', 'best_effort'),
    ('qos_overrides./graph.subscription.depth', 0, 'above 0'),
    ('qos_overrides./graph.subscription.colour', 'red', 'POLICY'),
    ('qos_overrides./graf.subscription.depth', 5, 'no subscription of /graf')])
def test_what_rclpy_would_ignore_is_refused(ros, lcd_model, name, value, said):
    with pytest.raises(ConfigError, match=said):
        ros.start(LcdNode, model=lcd_model, **{name: value})


def test_nodes_speak(ros, lcd_model, decisions, capfd):
    lcd = ros.start(LcdNode, model=lcd_model)
    send(ros, 'graph', wire_of(0), HEAVY)
    ros.until(lambda: decisions and lcd.diagnostics['refused graph'])
    ros.stop(lcd)
    said = capfd.readouterr().err
    for line in ('ready: target wl', 'first message on /graph', 'graph refused: word weights',
                 'published loop closures 1'):
        assert line in said


def test_the_machine_is_named(ros, lcd):
    import socket
    found = ros.collect('/diagnostics', lambda message: message.status[0], DiagnosticArray,
                        raw=False)
    ros.until(lambda: found)
    assert found[0].hardware_id == socket.gethostname()


def test_a_status_goes_out_between_messages_where_its_timer_does_not_get_a_turn(ros, lcd):
    found = ros.collect('/diagnostics', lambda message: {
        entry.key for entry in message.status[0].values}, DiagnosticArray, raw=False)
    ros.until(lambda: found)
    lcd.diagnostics._timer.cancel()
    lcd.diagnostics.count('seen here alone')
    callback = lcd.diagnostics.guard('message', lambda: None)
    lcd.diagnostics._last_s -= 60
    callback()
    last_s = lcd.diagnostics._last_s
    ros.until(lambda: any('seen here alone' in keys for keys in found))
    callback()  # not with every message
    assert lcd.diagnostics._last_s == last_s


@pytest.mark.parametrize('mode', ['query', 'surrogate'])
def test_a_search_that_does_not_end_keeps_no_graph(ros, monkeypatch, mode):
    node = ros.start(AttackerNode, mode=mode, ratio=0.01, deadline_ms=50.0)
    out = ros.collect('graph', lambda wire: wire)
    reports = ros.collect('attack_report',
                          lambda wire: codec.decode_attack_report(unwrap(wire)))
    release = Event()
    monkeypatch.setattr(node._attacker, 'attack', lambda *_: release.wait(60))
    wires = [wire_of(index) for index in range(3)]
    try:
        send(ros, 'graph_clean', *wires)
        ros.until(lambda: len(reports) == len(out) == 3)
    finally:
        release.set()
    assert out == wires
    assert {(report.status, report.reason) for report in reports} == {('skipped', 'deadline')}
    assert node.diagnostics['searches cut off'] == 3


def test_the_best_so_far_goes_out_at_the_deadline(ros, monkeypatch):
    node = ros.start(AttackerNode, ratio=0.01, deadline_ms=1e6)
    out = ros.collect('graph', lambda wire: codec.decode_graph(unwrap(wire)))
    reports = ros.collect('attack_report',
                          lambda wire: codec.decode_attack_report(unwrap(wire)))
    found, release = Event(), Event()

    def hunt(hunting, rng):
        flipped = hunting.best.flip(hunting.best.edge[:2])
        hunting.keep(flipped, hunting.loss + 1, False)
        found.set()
        release.wait(60)
        return 'too late'

    monkeypatch.setattr(node._attacker._search, 'hunt', hunt)
    # The deadline comes as soon as there is something, however slow the machine is.
    monkeypatch.setattr('adversarial_lcd_ros.nodes.attacker.wait', lambda *_: found.wait(60))
    monkeypatch.setattr(node._oracle, 'ask', lambda _: codec.LcdAnswer(1, False, True, 0.25))
    try:
        send(ros, 'graph_clean', wire_of(0))
        ros.until(lambda: reports and out)
    finally:
        release.set()
    assert len(graph(0).flips_to(out[0])) == reports[0].edits == 2
    assert (reports[0].status, reports[0].reason) == ('failure', 'deadline')
    assert reports[0].loss_after == pytest.approx(reports[0].loss_before + 1)


def test_a_frozen_detector_shows_under_a_deadline_too(ros, one_status):
    node = ros.start(AttackerNode, ratio=0.01, deadline_ms=20.0, max_backlog=100)
    ros.collect('query', bytes)  # hears, and says nothing
    reports = ros.collect('attack_report',
                          lambda wire: codec.decode_attack_report(unwrap(wire)))
    out = ros.collect('graph', bytes)
    clean = ros.publisher('graph_clean')
    ros.matched(clean)
    ros.matched(node._oracle._queries)
    # On a busy machine the deadline may pass before the query goes out.
    for count in range(1, 200):
        clean.publish(wire_of(count))
        ros.until(lambda count=count: len(reports) == len(out) == count)
        if reports[-1].reason != 'deadline':
            break
    assert len(reports) >= 3
    assert reports[-1].reason == 'no answer'
    assert node.diagnostics['queries without answer'] >= 1
    level, line, _ = status_of(ros, node)
    assert level == DiagnosticStatus.WARN
    assert 'queries without answer' in line


@pytest.fixture
def builder(ros, vocabulary):
    return ros.start(GraphBuilderNode, detector='none', vocabulary=vocabulary, features=50)


def frame(second=5, nanoseconds=0, name='camera', **fields):
    """Return a small grey image."""
    message = Image(height=120, width=160, step=160, encoding='mono8',
                    data=array('B', bytes(range(160)) * 120))
    message.header.stamp.sec, message.header.stamp.nanosec = second, nanoseconds
    message.header.frame_id = name
    for field, value in fields.items():
        setattr(message, field, value)
    return message


def png(width, height):
    """Return a PNG of a few bytes whose header declares any size."""
    def chunk(kind, data):
        return (struct.pack('>I', len(data)) + kind + data
                + struct.pack('>I', zlib.crc32(kind + data)))
    return (b'\x89PNG\r\n\x1a\n'
            + chunk(b'IHDR', struct.pack('>IIBBBBB', width, height, 8, 0, 0, 0, 0))
            + chunk(b'IDAT', zlib.compress(b'\0' * 1000)) + chunk(b'IEND', b''))


def jpeg(width, height):
    """Return the beginning of a JPEG whose header declares any size."""
    return (b'\xff\xd8\xff\xe0\x00\x10JFIF\0' + bytes(9) + b'\xff\xc0\x00\x0b\x08'
            + struct.pack('>HH', height, width) + b'\x01\x01\x11\x00\xff\xda' + bytes(100))


def webp(width, height):
    """Return the beginning of an extended WebP whose header declares any size."""
    return (b'RIFF' + struct.pack('<I', 100) + b'WEBPVP8X' + struct.pack('<I', 10) + bytes(4)
            + (width - 1).to_bytes(3, 'little') + (height - 1).to_bytes(3, 'little') + bytes(50))


def compressed(data):
    return CompressedImage(format='png', data=array('B', data))


@pytest.mark.parametrize(('topic', 'message', 'cause'), [
    ('image', frame(2**31 - 1, 10**9), 'stamp'), ('image', frame(-1), 'stamp'),
    ('image', frame(1, 2**32 - 1), 'stamp'), ('image', frame(name='a\x1b[2J'), 'name'),
    ('image', frame(step=159), 'step'), ('image', frame(width=2**31, height=2**31), 'image size'),
    ('image', frame(encoding='h264'), 'encoding'), ('image', frame(height=0), 'image size'),
    ('image/compressed', compressed(png(20_000, 20_000)), 'image size'),
    ('image/compressed', compressed(jpeg(20_000, 20_000)), 'image size'),
    ('image/compressed', compressed(webp(16_000, 16_000)), 'image size'),
    ('image/compressed', compressed(jpeg(64, 64)), 'format'),
    ('image/compressed', compressed(b'BM' + bytes(200)), 'format'),
    ('image/compressed', compressed(b'\xff\xd8\xff\xff'), 'format')])
def test_no_frame_ends_the_builder(ros, builder, topic, message, cause):
    graphs = ros.collect('graph', lambda wire: codec.decode_graph(unwrap(wire)))
    publisher = ros.publisher(topic, type(message))
    ros.matched(publisher)
    publisher.publish(message)
    ros.until(lambda: builder.diagnostics['refused frame'])
    assert builder.diagnostics[f'refused frame: {cause}'] == 1
    good = ros.publisher('image', Image)
    ros.matched(good)
    good.publish(frame(9))
    ros.until(lambda: graphs)
    assert (graphs[0].sequence, graphs[0].session) == (1, builder.session)


def test_the_latest_stamp_there_is_goes_through(ros, builder):
    graphs = ros.collect('graph', lambda wire: codec.decode_graph(unwrap(wire)))
    camera = ros.publisher('image', Image)
    ros.matched(camera)
    for stamp in ((2**31 - 1, 10**9 - 1), (0, 0)):
        camera.publish(frame(*stamp))
    ros.until(lambda: len(graphs) == 2)
    assert graphs[0].stamp_ns == 2**31 * SECOND - 1
    assert builder.diagnostics['frames on image: stamps that went back'] == 1


