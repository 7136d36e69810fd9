# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a replay gives, in which order and with which stamps; recording and reading payloads."""

from concurrent.futures import ThreadPoolExecutor

import bag_factory as make
from bag_factory import ROS2, stamps
from graph_factory import make_graph
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
import yaml

from adversarial_lcd_ros.config import ReplayConfig
from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.sequences.bagfile import BagFile
from adversarial_lcd_ros.sequences.cdr import cdr_stamp_ns, with_cdr_stamp
from adversarial_lcd_ros.sequences.replay import BagRecorder, Replay, read_payloads

PAYLOAD = 'std_msgs/msg/UInt8MultiArray'
PERIOD_S = make.PERIOD_NS / 1e9


def wire(message, kind):
    return bytes(codec.typestore().serialize_cdr(message, kind))


def read(cdr, kind):
    return codec.typestore().deserialize_cdr(cdr, kind)


def payload_message(data):
    return ROS2.make(PAYLOAD, layout=ROS2.make('std_msgs/msg/MultiArrayLayout', [], 0),
                     data=np.frombuffer(data, np.uint8))


def graph_rows(topic, count=4):
    return [(topic, PAYLOAD, stamp, payload_message(codec.encode_graph(make_graph(
        stamp_ns=stamp, sequence=k)))) for k, stamp in enumerate(stamps(count))]


@pytest.fixture
def bag(tmp_path):
    return make.write_ros2(tmp_path / 'bag', make.jpeg_rows(12) + make.pose_rows(12))


def frames_of(replay):
    return [stamp for topic, _, stamp, _ in replay if topic in replay.frame_topics]


@pytest.mark.parametrize('plugin', [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_messages_are_replayed_byte_for_byte(tmp_path, plugin):
    rows = make.jpeg_rows() + make.pose_rows()
    replay = Replay(make.write_ros2(tmp_path / 'bag', rows, plugin), ReplayConfig())
    assert replay.topics == {'/image/compressed': make.COMPRESSED, '/ground_truth': make.POSE}
    assert (replay.frame_topics, replay.frame_count) == (('/image/compressed',), 4)
    found = list(replay)
    assert sorted(found, key=lambda row: row[0]) == sorted(
        ((topic, kind, stamp, wire(message, kind)) for topic, kind, stamp, message in rows),
        key=lambda row: row[0])
    assert [row[2] for row in found] == sorted(stamps() * 2)
    assert list(replay) == found


@pytest.mark.parametrize(('settings', 'kept'), [
    ({}, range(12)), ({'stride': 5}, (0, 5, 10)), ({'start_s': 2.5 * PERIOD_S}, range(3, 12)),
    ({'duration_s': 4 * PERIOD_S}, range(4)), ({'duration_s': 1e6}, range(12)),
    ({'start_s': 2 * PERIOD_S, 'duration_s': 5.5 * PERIOD_S, 'stride': 2}, (2, 4, 6)),
])
def test_start_duration_and_stride(bag, settings, kept):
    replay = Replay(bag, ReplayConfig(**settings))
    assert frames_of(replay) == [stamps(12)[k] for k in kept]
    assert replay.frame_count == len(kept)


def test_stride_leaves_out_frames_but_no_poses(bag):
    poses = [row for row in Replay(bag, ReplayConfig(stride=5)) if row[0] == '/ground_truth']
    assert len(poses) == 12


@pytest.mark.parametrize('settings', [
    {}, {'stride': 5}, {'start_s': 0.1, 'duration_s': 0.2}, {'duration_s': 0.001}])
def test_stamps_go_on_rising_from_loop_to_loop(bag, settings):
    once = list(Replay(bag, ReplayConfig(**settings)))
    replay = Replay(bag, ReplayConfig(loop=3, **settings))
    found = list(replay)
    frames = frames_of(replay)
    assert len(frames) == replay.frame_count == 3 * len(frames_of(Replay(
        bag, ReplayConfig(**settings))))
    assert (np.diff(frames) > 0).all()
    assert (np.diff([row[2] for row in found]) >= 0).all()
    assert found[:len(once)] == once
    for (topic, kind, stamp, cdr), (_, _, _, original) in zip(found, once * 3, strict=True):
        message, first = read(cdr, kind), read(original, kind)
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp
        message.header.stamp = first.header.stamp
        assert wire(message, kind) == original, topic


def detections(stamp_ns):
    return codec.FrameDetections(stamp_ns, 'camera', np.array([3], np.uint32),
                                 np.array([[1, 2, 30, 40]], np.float32),
                                 np.array([0.75], np.float32))


def test_detections_are_replayed_before_their_frame(tmp_path):
    found_by_user = [('/robot/detections', PAYLOAD, stamp + 40_000_000,
                      payload_message(codec.encode_detections(detections(stamp))))
                     for stamp in stamps(4)]
    ours = [('/loop_closures', PAYLOAD, 1, payload_message(b'of an earlier run'))]
    bag = make.write_ros2(tmp_path / 'bag', make.jpeg_rows(4) + found_by_user + ours)
    replay = Replay(bag, ReplayConfig(loop=2))
    assert replay.frame_topics == ('/image/compressed',)
    rows = list(replay)
    assert [row[0] for row in rows] == ['/robot/detections', '/image/compressed'] * 8
    assert rows[0][3] == wire(found_by_user[0][3], PAYLOAD)
    for topic, kind, stamp, cdr in rows:
        if topic == '/robot/detections':
            read_back = codec.decode_detections(bytes(read(cdr, kind).data))
            assert (read_back.stamp_ns, read_back.box.tolist()) == (stamp, [[1, 2, 30, 40]])


def test_graphs_are_frames_where_there_are_no_images(tmp_path):
    others = [('/loop_closures', PAYLOAD, stamp, payload_message(b'x')) for stamp in stamps()]
    rows = graph_rows('/graph') + graph_rows('/graph_clean') + others
    replay = Replay(make.write_ros2(tmp_path / 'both', rows), ReplayConfig(loop=2))
    assert (replay.topics, replay.frame_count) == ({'/graph_clean': PAYLOAD}, 8)
    for _, kind, stamp, cdr in replay:
        assert codec.decode_graph(bytes(read(cdr, kind).data)).stamp_ns == stamp
    alone = make.write_ros2(tmp_path / 'alone', graph_rows('/graph'))
    assert Replay(alone, ReplayConfig()).frame_topics == ('/graph',)
    with_images = make.write_ros2(tmp_path / 'images', rows + make.jpeg_rows())
    assert list(Replay(with_images, ReplayConfig()).topics) == ['/image/compressed']


def test_bags_that_cannot_be_replayed_are_refused(tmp_path, bag):
    with pytest.raises(SequenceError, match=r'there is no bag'):
        Replay(tmp_path / 'gone', ReplayConfig())
    with pytest.raises(SequenceError, match=r'no frame of .* is left'):
        Replay(bag, ReplayConfig(start_s=77.0))
    poses = make.write_ros2(tmp_path / 'poses', make.pose_rows())
    with pytest.raises(SequenceError, match=r'neither images of a camera nor graphs'):
        Replay(poses, ReplayConfig())
    two = make.write_ros2(tmp_path / 'two', make.raw_rows(topic='/a') + make.raw_rows(topic='/b'))
    with pytest.raises(SequenceError, match=r'images on /a, /b'):
        Replay(two, ReplayConfig())
    store, ros1 = make.ros1_messages()
    make.write_ros1(tmp_path / 'old.bag', [
        ('/image', make.IMAGE, stamp, ros1.image(stamp, make.picture())) for stamp in stamps()],
        store)
    with pytest.raises(SequenceError, match=r'bag of ROS 1'):
        Replay(tmp_path / 'old.bag', ReplayConfig())


@given(st.integers(0, 2**31 * 10**9 - 1), st.booleans())
def test_a_stamp_is_rewritten_where_it_is(stamp_ns, little_endian):
    store = codec.typestore()
    for kind, message in ((make.COMPRESSED, ROS2.compressed(7, b'data')),
                          (make.IMAGE, ROS2.image(7, make.picture(), padding=3)),
                          (make.POSE, ROS2.pose(7, (1.0, 2.0, 3.0)))):
        before = bytes(store.serialize_cdr(message, kind, little_endian=little_endian))
        after = with_cdr_stamp(before, stamp_ns)
        assert cdr_stamp_ns(before) == 7
        assert cdr_stamp_ns(after) == stamp_ns
        message.header = ROS2.header(stamp_ns, message.header.frame_id)
        assert bytes(store.serialize_cdr(message, kind, little_endian=little_endian)) == after


@pytest.mark.parametrize('cdr', [b'', b'\0\1\0\0\1\0\0\0', b'\7' * 20, b'\0\1\0\0' + b'\xff' * 8])
def test_bytes_without_a_stamp_are_refused(cdr):
    with pytest.raises(SequenceError, match=r'are no CDR|nanoseconds'):
        cdr_stamp_ns(cdr)


def test_stamps_end_where_those_of_ros_end():
    with pytest.raises(SequenceError, match=r'2038'):
        with_cdr_stamp(wire(ROS2.pose(7, (0.0, 0.0, 0.0)), make.POSE), 2**31 * 10**9)


def test_what_is_recorded_is_read(tmp_path):
    path = tmp_path / 'record'
    payloads = [codec.encode_graph(make_graph(stamp_ns=stamp)) for stamp in stamps()]
    recorder = BagRecorder(path)
    for stamp, payload in zip(stamps(), payloads, strict=True):
        recorder.write('graph', PAYLOAD, stamp, wire(payload_message(payload), PAYLOAD))
        recorder.write('/loop_closures', PAYLOAD, 0, wire(payload_message(b'yes'), PAYLOAD))
        assert not path.exists()
    recorder.close()
    recorder.close()
    assert list(read_payloads(path, 'graph')) == list(zip(stamps(), payloads, strict=True))
    assert [data for _, data in read_payloads(path, '/loop_closures')] == [b'yes'] * 4
    with pytest.raises(SequenceError, match=r'on /query; topics with payloads: /graph'):
        list(read_payloads(path, 'query'))
    with pytest.raises(SequenceError, match=r'closed'):
        recorder.write('graph', PAYLOAD, 0, b'')
    with pytest.raises(SequenceError, match=r'exists already'):
        BagRecorder(path)


def test_a_recording_explains_its_payloads(tmp_path):
    graph = make_graph(stamp_ns=stamps()[0])
    with BagRecorder(tmp_path / 'record') as recorder:
        recorder.write('graph', PAYLOAD, 0, wire(payload_message(codec.encode_graph(graph)),
                                                 PAYLOAD))
    with (tmp_path / 'record' / 'record.mcap').open('rb') as file:
        reader = make_reader(file)
        (schema, _, message), = reader.iter_messages()
        texts = yaml.safe_load(next(reader.iter_metadata()).metadata['serialized_metadata'])
    # Nothing of ours from here on: a reader of MCAP, and the message definitions of ROS.
    store = get_typestore(Stores.ROS2_JAZZY)
    name = 'adversarial_lcd_ros/msg/MultiTierGraph'
    assert (schema.name, schema.encoding) == (name, 'ros2msg')
    # The texts have the comments, which say units and ranges.
    store.register(get_types_from_msg(texts['custom_data'][name], name))
    found = store.deserialize_cdr(message.data, name)
    assert (found.width, found.height) == (graph.width, graph.height)
    np.testing.assert_array_equal(found.node_label, graph.label)
    np.testing.assert_array_equal(found.edge_length, graph.edge_length)


def test_an_aborted_recording_leaves_nothing(tmp_path):
    def interrupted():
        with BagRecorder(tmp_path / 'record') as recorder:
            recorder.write('graph', PAYLOAD, 0, wire(payload_message(b'x'), PAYLOAD))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert list(tmp_path.iterdir()) == []


def test_recording_from_several_threads_loses_nothing(tmp_path):
    def write(thread):
        for k in range(200):
            recorder.write(f'topic{thread}', PAYLOAD, k, wire(
                payload_message(bytes([thread, k])), PAYLOAD))

    with BagRecorder(tmp_path / 'record') as recorder, ThreadPoolExecutor(4) as pool:
        list(pool.map(write, range(4)))
    for thread in range(4):
        found = [data for _, data in read_payloads(tmp_path / 'record', f'topic{thread}')]
        assert found == [bytes([thread, k]) for k in range(200)]


def test_order_of_arrival_survives_stamps_that_stand_still(tmp_path):
    big = b'\1' * 300_000  # several chunks of MCAP
    with BagRecorder(tmp_path / 'record') as recorder:
        for k in range(12):
            recorder.write('graph', PAYLOAD, 5 - k % 2, wire(
                payload_message(bytes([k]) + big), PAYLOAD))
    assert [data[0] for _, data in read_payloads(tmp_path / 'record', 'graph')] == list(range(12))


def test_an_empty_recording_can_be_opened(tmp_path):
    BagRecorder(tmp_path / 'record').close()
    with BagFile(tmp_path / 'record') as bag:
        assert bag.topics == {}
