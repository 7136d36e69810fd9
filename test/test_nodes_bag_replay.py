# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node bag_replay: byte for byte, nothing lost in lockstep, honest about what is missing."""

from dataclasses import replace
import time
from types import SimpleNamespace

import cv2
from graph_factory import make_graph
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

from adversarial_lcd_ros.attack.images.posting import Posting
from adversarial_lcd_ros.config import AttackConfig, BuilderConfig, LcdConfig, ReplayConfig
from adversarial_lcd_ros.errors import EvaluationError, SequenceError
from adversarial_lcd_ros.evaluation.replay.offline import run_offline
from adversarial_lcd_ros.files.keys import make_key
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.types import AttackReport
from adversarial_lcd_ros.sequences.bagfile import BagFile
from adversarial_lcd_ros.sequences.frame import decode
from adversarial_lcd_ros.sequences.replay import read_payloads
from adversarial_lcd_ros.vision.builder import GraphBuilder

pytest.importorskip('rclpy', reason='rclpy is not installed')

from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import UInt8MultiArray

from adversarial_lcd_ros.messages.payload import unwrap, wrap
from adversarial_lcd_ros.nodes.attacker import AttackerNode
from adversarial_lcd_ros.nodes.bag_replay import BagReplayNode
from adversarial_lcd_ros.nodes.graph_builder import GraphBuilderNode
from adversarial_lcd_ros.nodes.lcd import LcdNode

PERIOD_NS, FRAMES = 200_000_000, 15
STAMPS = [5_000_000_000 + k * PERIOD_NS for k in range(FRAMES)]
TYPE = 'sensor_msgs/msg/CompressedImage'


def frame(stamp_ns, data):
    store = codec.typestore()
    types = store.types
    header = types['std_msgs/msg/Header'](
        types['builtin_interfaces/msg/Time'](*divmod(stamp_ns, 10**9)), 'camera')
    return bytes(store.serialize_cdr(types[TYPE](header, 'jpeg', data), TYPE))


@pytest.fixture
def frames():
    """Return the CDR of every frame of the bag: the same five views three times."""
    coarse = np.random.default_rng(3).integers(0, 256, (5, 15, 20, 3)).astype(np.uint8)
    views = [cv2.resize(view, (160, 120), interpolation=cv2.INTER_CUBIC) for view in coarse]
    jpeg = [cv2.imencode('.jpg', view)[1].ravel() for view in views]
    return [frame(stamp, jpeg[k % 5]) for k, stamp in enumerate(STAMPS)]


@pytest.fixture
def bag(tmp_path, frames):
    path = tmp_path / 'bag'
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        images = writer.add_connection('/image/compressed', TYPE, typestore=codec.typestore())
        for stamp, cdr in zip(STAMPS, frames, strict=True):
            writer.write(images, stamp, cdr)
    return str(path)


class Pipeline:
    """Builder and detector, with or without the man in the middle."""

    def __init__(self, ros, vocabulary, lcd_model, attack=None):
        self.lcd = ros.start(LcdNode, model=lcd_model, min_gap_s=1)
        remaps = ['graph:=graph_clean'] if attack else []
        self.builder = ros.start(GraphBuilderNode, *remaps, detector='none',
                                 vocabulary=vocabulary, features=60)
        self.attacker = ros.start(AttackerNode, **attack) if attack else None


@pytest.fixture
def pipeline(ros, vocabulary, lcd_model):
    return Pipeline(ros, vocabulary, lcd_model)


def replay(ros, bag, **parameters):
    return ros.start(BagReplayNode, bag=bag, **({'timeout_s': 60} | parameters))


@pytest.mark.parametrize('window', [1, 4])
def test_lockstep_loses_nothing(ros, bag, pipeline, capsys, window):
    node = replay(ros, bag, lockstep=True, window=window)
    assert node.work(ros.spin) == 0
    assert f'{FRAMES} frames, {FRAMES} decisions' in capsys.readouterr().out
    assert pipeline.builder.diagnostics['published graphs'] == FRAMES
    assert pipeline.lcd.detector.keyframe_count == FRAMES
    assert pipeline.lcd.diagnostics['loops declared'] > 0


def test_a_recording_holds_every_graph_decision_and_report(ros, bag, vocabulary, lcd_model,
                                                           tmp_path):
    pipeline = Pipeline(ros, vocabulary, lcd_model, {'ratio': 0.001, 'queries_per_edit': 3})
    node = replay(ros, bag, lockstep=True, record=str(tmp_path / 'record'))
    assert node.work(ros.spin) == 0
    ros.stop(node)
    readers = {'graph_clean': codec.decode_graph, 'graph': codec.decode_graph,
               'loop_closures': codec.decode_loop_closure,
               'attack_report': codec.decode_attack_report}
    records = {topic: [read(payload) for _, payload in read_payloads(tmp_path / 'record', topic)]
               for topic, read in readers.items()}
    for items in records.values():
        assert [item.stamp_ns for item in items] == STAMPS
    for clean, attacked, report in zip(records['graph_clean'], records['graph'],
                                       records['attack_report'], strict=True):
        assert len(clean.flips_to(attacked)) == report.edits
    assert sum(report.queries for report in records['attack_report']) == (
        pipeline.attacker.diagnostics['published queries'])


def test_messages_are_published_byte_for_byte_with_clock(ros, bag, frames):
    heard = ros.collect('image/compressed', bytes, CompressedImage)
    clock = ros.collect('/clock', lambda m: m.clock.sec * 10**9 + m.clock.nanosec, Clock,
                        raw=False)
    node = replay(ros, bag, rate=20)
    assert node.work(ros.spin) == 0
    ros.until(lambda: len(heard) == FRAMES and STAMPS[-1] in clock)
    assert heard == frames
    assert clock == sorted(clock)
    assert set(STAMPS) <= set(clock)


def test_a_clock_that_jumped_is_said(ros, bag):
    ros.collect('image/compressed', bytes, CompressedImage)
    node = replay(ros, bag, rate=0.001)
    stopped = 'stamps that jumped'
    assert node.work(lambda seconds: ros.spin(seconds) and not node.diagnostics[stopped]) == 0
    assert node.diagnostics[stopped] == 1


def test_a_recording_that_cannot_be_written_ends_the_replay(ros, bag, pipeline, tmp_path,
                                                            monkeypatch):
    node = replay(ros, bag, lockstep=True, record=str(tmp_path / 'record'))

    def full(*_):
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(node._recorder, 'write', full)
    with pytest.raises(OSError, match='No space'):
        node.work(ros.spin)


def test_a_restarted_detector_and_answers_nobody_asked_for_are_said(ros, bag):
    node = replay(ros, bag)
    decisions = ros.publisher('loop_closures')
    ros.matched(decisions)
    for session in (3, 3, 4):
        decisions.publish(wrap(codec.encode_loop_closure(
            codec.LoopClosure(1, 'camera', 0, False, 0.1, session=session))))
    ros.until(lambda: node.diagnostics['restarts of lcd'] == 1)
    assert node.diagnostics['decisions not asked for'] == 3


def test_topics_can_be_remapped_and_clock_left_out(ros, bag, frames):
    heard = ros.collect('front/image', bytes, CompressedImage)
    clock = ros.collect('/clock', lambda m: m, Clock, raw=False)
    node = ros.start(BagReplayNode, 'image/compressed:=front/image', bag=bag, clock=False,
                     rate=100, timeout_s=60)
    assert node.work(ros.spin) == 0
    ros.until(lambda: heard == frames)
    assert not clock


def test_without_a_subscriber_the_replay_fails(ros, bag):
    node = replay(ros, bag, start_timeout_s=0.3)
    with pytest.raises(EvaluationError, match='no subscriber of /image/compressed'):
        node.work(ros.spin)


def test_lockstep_without_a_detector_fails(ros, bag, vocabulary):
    ros.start(GraphBuilderNode, detector='none', vocabulary=vocabulary)
    node = replay(ros, bag, lockstep=True, start_timeout_s=0.5)
    ros.until(lambda: ros.probe.count_subscribers('image/compressed'))
    with pytest.raises(EvaluationError, match='no publisher of /loop_closures'):
        node.work(ros.spin)


def test_a_missing_decision_is_named_by_its_stamp(ros, bag, tmp_path, monkeypatch):
    """Somebody takes the frames and decides on all but the fourth."""
    decisions = ros.publisher('loop_closures')

    def decide(message):
        stamp_ns = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        if stamp_ns != STAMPS[3]:
            decisions.publish(wrap(codec.encode_loop_closure(
                codec.LoopClosure(stamp_ns, 'camera', 0, False, 0.0))))

    ros.collect('image/compressed', decide, CompressedImage, raw=False)
    record = tmp_path / 'record'
    node = replay(ros, bag, lockstep=True, record=str(record))
    real_s, ahead_s = time.monotonic, 0.0

    def spin(seconds):
        nonlocal ahead_s
        if (node._published, node._decided) == (4, 3):
            ahead_s += 30.0  # no test waits for a limit
        return ros.spin(seconds)

    monkeypatch.setattr('adversarial_lcd_ros.nodes.bag_replay.time',
                        SimpleNamespace(monotonic=lambda: real_s() + ahead_s))
    with pytest.raises(EvaluationError, match=f'{STAMPS[3]} ns .*4 frames published, 3 decided'):
        node.work(spin)
    assert not record.exists()  # a recording that looks whole is whole


@pytest.mark.parametrize('late', ['graph_clean', 'graph', 'attack_report'])
def test_a_recording_waits_for_what_comes_after_the_last_decision(ros, bag, tmp_path, late):
    """Somebody is the whole pipeline; of the last frame, all but one message come in time."""
    outputs = {topic: ros.publisher(topic) for topic in (
        'graph_clean', 'graph', 'attack_report', 'loop_closures')}
    held = []

    def answer(message):
        stamp_ns = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        graph = codec.encode_graph(make_graph(stamp_ns=stamp_ns))
        payloads = {
            'graph_clean': graph, 'graph': graph,
            'attack_report': codec.encode_attack_report(
                AttackReport(stamp_ns, 'camera', 0, 'skipped')),
            'loop_closures': codec.encode_loop_closure(
                codec.LoopClosure(stamp_ns, 'camera', 0, False, 0.0))}
        for topic, payload in payloads.items():
            if topic == late and stamp_ns == STAMPS[-1]:
                held.append(wrap(payload))
            else:
                outputs[topic].publish(wrap(payload))

    def spin(seconds):
        others = outputs.keys() - {late}
        if held and all(node.diagnostics[f'received {topic}'] == FRAMES for topic in others):
            outputs[late].publish(held.pop())
        return ros.spin(seconds)

    ros.collect('image/compressed', answer, CompressedImage, raw=False)
    # Both are in the middle of a pipeline: somebody hears them besides the recorder.
    for topic in ('graph_clean', 'graph'):
        ros.collect(topic, len)
    record = tmp_path / 'record'
    node = replay(ros, bag, lockstep=True, record=str(record))
    assert node.work(spin) == 0
    ros.stop(node)
    assert {topic: sum(1 for _ in read_payloads(record, topic)) for topic in outputs} == (
        dict.fromkeys(outputs, FRAMES))


@pytest.mark.parametrize('record_frames', [True, False])
def test_a_recording_has_what_was_replayed(ros, bag, frames, pipeline, tmp_path, record_frames):
    record = tmp_path / 'record'
    node = replay(ros, bag, lockstep=True, record=str(record), record_frames=record_frames)
    assert node.work(ros.spin) == 0
    node.close()
    with BagFile(record) as recorded:
        assert recorded.topics == {
            '/graph': 'adversarial_lcd_ros/msg/MultiTierGraph',
            '/loop_closures': 'adversarial_lcd_ros/msg/LoopClosure',
            **({'/image/compressed': TYPE} if record_frames else {})}
        assert [wire for _, _, wire in recorded.messages(['/image/compressed'])] == (
            frames if record_frames else [])


def test_damaged_decisions_are_counted_and_survived(ros, bag, pipeline):
    node = replay(ros, bag, lockstep=True)
    stray = ros.publisher('loop_closures')
    ros.matched(stray)
    stray.publish(b'junk')
    assert node.work(ros.spin) == 0
    assert node.diagnostics['refused loop closure'] == 1


def test_a_bag_of_graphs_is_replayed_too(ros, tmp_path, lcd_model):
    path = tmp_path / 'graphs'
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        graphs = writer.add_connection('/graph', 'std_msgs/msg/UInt8MultiArray',
                                       typestore=codec.typestore())
        for k, stamp in enumerate(STAMPS):
            writer.write(graphs, stamp, wrap(codec.encode_graph(make_graph(
                stamp_ns=stamp, sequence=k))))
    lcd = ros.start(LcdNode, model=lcd_model)
    heard = ros.collect('graph', lambda wire: codec.decode_graph(unwrap(wire)), UInt8MultiArray)
    node = replay(ros, str(path), lockstep=True)
    assert node.work(ros.spin) == 0
    assert lcd.detector.keyframe_count == FRAMES
    ros.until(lambda: [graph.stamp_ns for graph in heard] == STAMPS)


def test_under_a_key_frames_whose_graph_is_refused_are_not_waited_for(ros, bag, vocabulary,
                                                                     lcd_model, tmp_path, capsys):
    make_key(tmp_path / 'key')
    key = {'key': str(tmp_path / 'key')}
    attack, detector = {'search': 'recall', 'ratio': 0.003}, {'model': lcd_model, 'min_gap_s': 1.0}
    lcd = ros.start(LcdNode, **detector, **key)
    ros.start(GraphBuilderNode, 'graph:=graph_clean', detector='none', vocabulary=vocabulary,
              features=60, **key)
    ros.start(AttackerNode, **attack)
    node = replay(ros, bag, lockstep=True, record=str(tmp_path / 'record'), **key)
    assert node.work(ros.spin) == 0
    ros.stop(node)
    clean, sent, decisions = (
        [read(payload) for _, payload in read_payloads(tmp_path / 'record', topic)]
        for topic, read in (('graph_clean', codec.decode_graph), ('graph', codec.decode_graph),
                            ('loop_closures', codec.decode_loop_closure)))
    run, forwarded = run_offline(clean, LcdConfig(**detector), AttackConfig(**attack), sealed=True)
    assert sent == forwarded
    assert decisions == list(run.decisions)
    refused = sum(one != other for one, other in zip(clean, sent, strict=True))
    assert 0 < refused == FRAMES - len(decisions) < FRAMES
    ros.until(lambda: lcd.diagnostics['refused graph: unsealed'] == refused)
    assert node.diagnostics['refused by lcd'] == refused
    assert f'{len(decisions)} decisions, {refused} refused, ' in capsys.readouterr().out


def test_stopping_ends_the_replay_with_exit_code_0(ros, bag, pipeline):
    node = replay(ros, bag, rate=0.01)
    turns = iter(range(60))
    assert node.work(lambda seconds: ros.spin(min(seconds, 0.01)) and next(turns, None) is not None
                     ) == 0


def test_a_missing_bag_is_an_error(ros, tmp_path):
    with pytest.raises(SequenceError, match='nowhere'):
        replay(ros, str(tmp_path / 'nowhere'))


@pytest.mark.parametrize(('sheets', 'share'), [(1, 0.3), (2, 0.2)])
def test_a_poster_is_in_the_graphs_of_its_span_as_offline(ros, bag, frames, pipeline, vocabulary,
                                                          tmp_path, sheets, share):
    settings = {'poster': 'cells', 'poster_share': share, 'poster_sheets': sheets,
                'poster_spans': '0.3:0.9'}
    node = replay(ros, bag, lockstep=True, record=str(tmp_path / 'record'), **settings)
    assert node.work(ros.spin) == 0
    ros.stop(node)
    live = [codec.decode_graph(payload)
            for _, payload in read_payloads(tmp_path / 'record', 'graph')]
    posting = Posting(ReplayConfig(**settings), STAMPS[0])
    config = BuilderConfig(detector='none', vocabulary=vocabulary, features=60)
    pictures = [decode(codec.typestore().deserialize_cdr(cdr, TYPE).data.tobytes(), 'frame')
                for cdr in frames]
    with GraphBuilder(config) as builder:
        plain, posted = ([builder.build(change(pixels, stamp), stamp, 'camera', number)
                          for number, (pixels, stamp) in enumerate(
                              zip(pictures, STAMPS, strict=True))]
                         for change in (lambda pixels, _: pixels, posting.on_pixels))
    assert live == posted
    assert [one != other for one, other in zip(plain, posted, strict=True)] == [
        300_000_000 <= stamp - STAMPS[0] < 900_000_000 for stamp in STAMPS]


@pytest.mark.parametrize(('attack', 'defences'), [
    ({'search': 'recall', 'ratio': 0.003}, 'rederive'),
    ({'search': 'recall', 'ratio': 0.003, 'lengths': True}, 'length_check'),
    ({'search': 'move_nodes', 'nodes_moved': 20}, 'rederive,length_check'),
    ({'search': 'replay'}, 'geometric_check')])
def test_attacks_behind_defences_come_out_as_offline(ros, bag, vocabulary, lcd_model, tmp_path,
                                                     attack, defences):
    detector = {'model': lcd_model, 'min_gap_s': 1.0, 'defences': defences}
    ros.start(LcdNode, **detector)
    ros.start(GraphBuilderNode, 'graph:=graph_clean', detector='none', vocabulary=vocabulary,
              features=60)
    ros.start(AttackerNode, **attack)
    node = replay(ros, bag, lockstep=True, record=str(tmp_path / 'record'))
    assert node.work(ros.spin) == 0
    ros.stop(node)
    clean, sent, decisions, reports = (
        [read(payload) for _, payload in read_payloads(tmp_path / 'record', topic)]
        for topic, read in (('graph_clean', codec.decode_graph), ('graph', codec.decode_graph),
                            ('loop_closures', codec.decode_loop_closure),
                            ('attack_report', codec.decode_attack_report)))
    run, forwarded = run_offline(clean, LcdConfig(**detector), AttackConfig(**attack))
    assert sent == forwarded
    assert decisions == list(run.decisions)
    assert [replace(report, duration_s=0.0) for report in reports] == [
        replace(report, duration_s=0.0) for report in run.reports]
    assert any(report.queries > 1 for report in reports)
