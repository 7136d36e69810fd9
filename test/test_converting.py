# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings as other readers of MCAP see them, and as Foxglove's layout expects them."""

from dataclasses import replace
import json
from pathlib import Path
import re

import bag_factory as make
from bag_factory import HEIGHT, WIDTH, stamps
import cv2
from graph_factory import make_graph
import numpy as np
import pytest

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.config import ReplayConfig
from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.evaluation.replay.recorded import is_recording, read_recording
from adversarial_lcd_ros.graph_sequences.converting import VIEW_TOPIC, convert_recording
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.payload import WIRE_TYPE, wrap
from adversarial_lcd_ros.messages.types import AttackReport, LoopClosure
from adversarial_lcd_ros.sequences.bagfile import BagFile
from adversarial_lcd_ros.sequences.bags import camera_topics
from adversarial_lcd_ros.sequences.replay import BagRecorder, Replay
from adversarial_lcd_ros.vision.views import verdict, why

ROOT = Path(__file__).resolve().parents[1]
COUNT = 6
EDGES = [(0, 1), (0, 2), (1, 3), (2, 4)]


def graph(number, edges=EDGES):
    rng = np.random.default_rng(number)
    return make_graph(6, edges, stamp_ns=stamps(COUNT)[number], sequence=number, width=WIDTH,
                      height=HEIGHT, position=(rng.random((6, 2)) * (WIDTH, HEIGHT)).astype('f4'))


def decision(number):
    match = {'match_stamp_ns': stamps()[0], 'match_sequence': 0} if number else {}
    return LoopClosure(stamps(COUNT)[number], 'camera', number, number == 5, number / 10,
                       candidates=number, vbow_score=0.25, **match)


def report(number):
    return AttackReport(stamps(COUNT)[number], 'camera', number, 'success', edit_budget=3,
                        edits=2, query_budget=9, queries=4)


def messages():
    """Yield (topic, stamp, payload) of a recorded attack; decisions may overtake their graph."""
    for number, stamp in enumerate(stamps(COUNT)):
        said = [('/graph_clean', codec.encode_graph(graph(number))),
                ('/graph', codec.encode_graph(graph(number, [*EDGES[1:], (3, 5)]))),
                ('/loop_closures', codec.encode_loop_closure(decision(number))),
                ('/attack_report', codec.encode_attack_report(report(number)))]
        for topic, payload in said if number % 2 else reversed(said):
            yield topic, stamp, payload


@pytest.fixture
def old(tmp_path):
    """Return what "ros2 bag record" has written: payloads as they went over the wire."""
    store = codec.typestore()
    return make.write_ros2(tmp_path / 'old', [
        *((topic, WIRE_TYPE, stamp, store.deserialize_cdr(wrap(payload), WIRE_TYPE))
          for topic, stamp, payload in messages()), *make.pose_rows(COUNT)])


@pytest.fixture
def frames(tmp_path):
    return make.write_ros2(tmp_path / 'frames', make.jpeg_rows(COUNT) + make.pose_rows(COUNT))


def decoded(bag):
    """Return the messages of a bag by topic, as the decoder of another project reads them."""
    reader = pytest.importorskip('mcap_ros2.reader', reason='no mcap-ros2-support')
    file, = bag.glob('*.mcap')
    found = {}
    for message in reader.read_ros2_messages(str(file)):
        found.setdefault(message.channel.topic, []).append(message.ros_msg)
    return found


def is_red(jpeg):
    blue, green, red = cv2.split(cv2.imdecode(np.frombuffer(jpeg, np.uint8), 1).astype(int))
    return np.count_nonzero((red > 180) & (green < 90) & (blue < 90)) > 20


def test_what_is_recorded_is_read_by_others(tmp_path):
    with BagRecorder(tmp_path / 'new') as recorder:
        for topic, stamp, payload in messages():
            recorder.write(topic, WIRE_TYPE, stamp, wrap(payload))
    found = decoded(tmp_path / 'new')
    assert {topic: len(rows) for topic, rows in found.items()} == dict.fromkeys(
        ('/graph_clean', '/graph', '/loop_closures', '/attack_report'), COUNT)
    for number in range(COUNT):
        ours, theirs = graph(number), found['/graph_clean'][number]
        assert (theirs.sequence, theirs.width) == (number, WIDTH)
        np.testing.assert_array_equal(theirs.node_position, ours.position.ravel())
        np.testing.assert_array_equal(theirs.edge_source, ours.edge[:, 0])
        np.testing.assert_array_equal(list(theirs.node_descriptor), ours.descriptor[2:].ravel())
        assert found['/loop_closures'][number].probability == number / 10
        assert found['/attack_report'][number].status == 'success'


def test_an_old_recording_becomes_typed_and_gets_frames_and_pictures(old, frames, tmp_path):
    done = convert_recording(old, tmp_path / 'new', frames)
    assert done.notes == []
    assert done.messages == dict.fromkeys(
        ('/graph_clean', '/graph', '/loop_closures', '/attack_report', '/ground_truth',
         '/image/compressed', VIEW_TOPIC), COUNT)
    found = decoded(tmp_path / 'new')
    assert [row.is_loop for row in found['/loop_closures']] == [False] * 5 + [True]
    for row, stamp in zip(found[VIEW_TOPIC], stamps(COUNT), strict=True):
        assert row.header.stamp.sec * 10**9 + row.header.stamp.nanosec == stamp
        assert is_red(bytes(row.data))
    with BagFile(tmp_path / 'new') as bag:
        assert WIRE_TYPE not in bag.topics.values()
        # Pictures of decisions are no second camera.
        assert camera_topics(bag) == ['/image/compressed']


def test_the_same_is_read_of_both(old, frames, tmp_path):
    convert_recording(old, tmp_path / 'new', frames)
    assert is_recording(tmp_path / 'new')
    before, after = (read_recording(path).run for path in (old, tmp_path / 'new'))
    assert before.decisions == after.decisions
    assert before.reports == after.reports
    for one, other in zip(before.forwarded, after.forwarded, strict=True):
        assert codec.encode_graph(one) == codec.encode_graph(other)


def test_typed_graphs_go_over_the_wire_as_before(old, tmp_path):
    convert_recording(old, tmp_path / 'new')
    for loop in (1, 2):
        before, after = (list(Replay(path, ReplayConfig(loop=loop)))
                         for path in (old, tmp_path / 'new'))
        assert before == after
        assert len(before) == 2 * COUNT * loop


def test_a_conversion_of_a_conversion_is_the_same(old, frames, tmp_path):
    convert_recording(old, tmp_path / 'once', frames)
    again = convert_recording(tmp_path / 'once', tmp_path / 'twice')
    assert again.messages[VIEW_TOPIC] == COUNT
    with BagFile(tmp_path / 'once') as one, BagFile(tmp_path / 'twice') as other:
        assert one.topics == other.topics
        graphs = [[wire for _, _, wire in bag.messages(['/graph'])] for bag in (one, other)]
    assert graphs[0] == graphs[1]


def test_messages_of_an_earlier_version_become_the_newest(tmp_path):
    name = 'adversarial_lcd_ros/msg/LoopClosure'
    now = codec.typestore().deserialize_cdr(codec.encode_loop_closure(decision(5)), name)
    earlier = codec.typestore(1)
    fields = earlier.types[name].__dataclass_fields__
    values = {field: getattr(now, field) for field in fields if field != '__msgtype__'}
    first = earlier.serialize_cdr(
        earlier.types[name](**{**values, 'schema_version': 1}), name)
    store = codec.typestore()
    bag = make.write_ros2(tmp_path / 'old', [
        ('/loop_closures', WIRE_TYPE, 1, store.deserialize_cdr(wrap(bytes(first)), WIRE_TYPE))])
    convert_recording(bag, tmp_path / 'new')
    found, = decoded(tmp_path / 'new')['/loop_closures']
    assert (found.schema_version, found.is_loop, found.session) == (2, True, 0)


def test_what_is_no_recording_is_refused_in_a_line(frames, tmp_path, capsys):
    with pytest.raises(SequenceError, match=r'no recording of the nodes: .* /image/compressed'):
        convert_recording(frames, tmp_path / 'new')
    assert main(['convert', str(frames), str(tmp_path / 'new')]) == 2
    assert len(capsys.readouterr().err.splitlines()[-1:]) == 1
    assert not (tmp_path / 'new').exists()


def test_damaged_messages_are_left_out_and_counted(tmp_path, capsys):
    store = codec.typestore()
    rows = [('/graph', WIRE_TYPE, stamp, store.deserialize_cdr(wrap(payload), WIRE_TYPE))
            for topic, stamp, payload in messages() if topic == '/graph']
    rows.append(('/graph', WIRE_TYPE, rows[-1][2] + 1,
                 store.deserialize_cdr(wrap(b'junk'), WIRE_TYPE)))
    bag = make.write_ros2(tmp_path / 'old', rows)
    assert main(['convert', str(bag), str(tmp_path / 'new')]) == 0
    said = capsys.readouterr()
    assert 'left out: 1 messages on /graph (unreadable)' in said.err
    assert '--frames' in said.err
    assert f'{COUNT} on /graph' in said.out


def layout_topics():
    """Yield (topic, field) of every panel of the layout; the field is '' for a whole message."""
    layout = json.loads((ROOT / 'config/foxglove.json').read_text())
    for panel in layout['configById'].values():
        yield panel.get('imageMode', {}).get('imageTopic', panel.get('topicPath')), ''
        for path in panel.get('paths', ()):
            topic, _, field = path['value'].partition('.')
            yield topic, field


def test_the_layout_shows_what_a_recording_has(old, frames, tmp_path):
    convert_recording(old, tmp_path / 'new', frames)
    found = decoded(tmp_path / 'new')
    shown = {entry for entry in layout_topics() if entry[0]}
    assert {topic for topic, _ in shown} == {
        VIEW_TOPIC, '/image/compressed', '/loop_closures', '/attack_report'}
    for topic, field in shown:
        assert topic in found
        assert not field or hasattr(found[topic][0], field), f'{topic}.{field}'


def test_every_panel_has_its_place():
    layout = json.loads((ROOT / 'config/foxglove.json').read_text())
    placed = re.findall(r'"(?:first|second)": "([^"]+)"', json.dumps(layout['layout']))
    assert sorted(placed) == sorted(layout['configById'])


def test_a_verdict_says_what_and_why():
    assert verdict(decision(0)) == 'no loop: no earlier frame to compare with'
    assert verdict(decision(5)).startswith('LOOP of frame 5 with frame 0, 0.2 s before: probab')
    assert verdict(decision(3)).startswith('no loop: probability 0.300')
    attacked = graph(5, [*EDGES[1:], (3, 5), (1, 5)])
    assert why(decision(5), graph(5), attacked, report(5)) == (
        '5 candidates, words alike by 0.250; attacker added 2 edges and deleted 1; asked 4 of 9 '
        'queries: success')
    assert why(replace(decision(5), candidates=1), None, attacked, None) == (
        '1 candidates, words alike by 0.250')
