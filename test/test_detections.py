# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects of the user's own detector: the CSV, the message, their way into the graph."""

from dataclasses import replace

import bag_factory as make
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
import numpy as np
import pytest

from adversarial_lcd_ros.config import BuilderConfig, LcdConfig
from adversarial_lcd_ros.errors import CodecError, ConfigError, SequenceError
from adversarial_lcd_ros.graph_sequences.opening import open_graphs
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.sequences.detections import read_detections
from adversarial_lcd_ros.sequences.inspection import identify_payload
from adversarial_lcd_ros.vision.builder import GraphBuilder
from adversarial_lcd_ros.vision.detections import (
    MAX_EARLY,
    MISSED,
    UNMATCHED,
    DetectionInbox,
    class_words,
)
from adversarial_lcd_ros.vision.objects import Detections

HEADER = 'timestamp,class,x,y,w,h,score'
STAMP_NS = make.START_NS
MS = 1_000_000


def line(stamp_ns=STAMP_NS, label=7, box=(10, 20, 30, 25), score=0.5):
    return ','.join(map(str, (make.seconds(stamp_ns), label, *box, score)))


def table(path, *lines, header=HEADER):
    path.write_text('\n'.join([header, *lines]) + '\n')
    return path


@pytest.fixture
def config(vocabulary):
    return BuilderConfig(detector='csv', vocabulary=vocabulary, features=20,
                         detected_features=40)


@pytest.fixture
def folder(tmp_path):
    """Detections of four frames, without their pictures but for one."""
    place = tmp_path / 'office'
    (place / 'rgb').mkdir(parents=True)
    (place / 'rgb' / 'sample.jpg').write_bytes(make.encoded(make.noise(0)))
    table(place / 'detections.csv',
          *(line(stamp, label, (20 + 40 * k, 20, 30, 25))
            for number, stamp in enumerate(make.stamps())
            for k, label in enumerate([5, 5, 8][:number])),
          line(make.stamps()[0], 1, (0, 0, 2, 2)))
    (place / 'groundtruth.txt').write_text('\n'.join(map(make.pose_line, make.stamps())))
    return place


def test_rows_are_read_exactly_and_in_order_of_time(tmp_path):
    found = read_detections(table(
        tmp_path / 'd.csv', line(STAMP_NS + 1, 2, (-5, 0.5, 700, 9), 1), line(STAMP_NS, 3),
        line(STAMP_NS + 1, 4), header=HEADER.replace('class', 'coco_class')))
    assert found.stamp_ns.tolist() == [STAMP_NS, STAMP_NS + 1, STAMP_NS + 1]
    assert found.label.tolist() == [3, 2, 4]
    assert found.box[1].tolist() == [-5, 0.5, 700, 9]
    assert found.frame_stamps_ns.tolist() == [STAMP_NS, STAMP_NS + 1]


@pytest.mark.parametrize(('wrong', 'said'), [
    (line().rsplit(',', 1)[0], 'line 3: 6 fields'),
    (line(label='cup'), 'line 3: invalid literal'),
    (line(label=-1), 'line 3: class -1'),
    (line(label=65536), 'line 3: class 65536; expected 0 to 65535'),
    (line(label=1.5), 'line 3: invalid literal'),
    (line(box=(1, 2, 0, 4)), 'line 3: box'),
    (line(box=('nan', 2, 3, 4)), 'line 3: box'),
    (line(box=(1, 2, 'inf', 4)), 'line 3: box'),
    (line(score=1.01), 'line 3: score'),
    (line(score='nan'), 'line 3: score'),
    ('soon' + line()[4:], 'line 3: .* no number of seconds'),
    ('-1' + line()[20:], 'line 3: .* no time stamp'),
    (line(box=(1e300, 2, 3, 4)), r'line 3: box 1e\+300,.* of at most 1e\+09'),
    ('"' + line(), 'cannot be read as CSV')])
def test_wrong_lines_are_named(tmp_path, wrong, said):
    with pytest.raises(SequenceError, match=said):
        read_detections(table(tmp_path / 'd.csv', line(), wrong, line()))


def test_blanks_behind_commas_and_blank_lines_do_not_matter(tmp_path):
    found = read_detections(table(tmp_path / 'd.csv', line().replace(',', ', '), '',
                                  line(STAMP_NS + 1), '', header=HEADER.replace(',', ', ')))
    assert found.stamp_ns.tolist() == [STAMP_NS, STAMP_NS + 1]


@pytest.mark.parametrize(('text', 'said'), [
    ('', 'line 1: found nothing'), ('a,b\n', 'line 1: found a,b'), (HEADER + '\n', 'no detection'),
    (line() + '\n', 'expected the header'), ('\xff', 'line 1')])
def test_what_is_no_table_is_refused(tmp_path, text, said):
    (tmp_path / 'd.csv').write_text(text)
    with pytest.raises(SequenceError, match=said):
        read_detections(tmp_path / 'd.csv')


def test_a_missing_table_is_named(tmp_path):
    with pytest.raises(SequenceError, match=r'd\.csv cannot be read'):
        read_detections(tmp_path / 'd.csv')


@settings(deadline=None)
@given(st.lists(st.integers(0, 60), min_size=1, max_size=8), st.integers(-5, 65),
       st.integers(0, 5))
def test_the_nearest_frame_within_the_tolerance_is_taken(tmp_path_factory, stamps, wanted,
                                                         tolerance):
    path = tmp_path_factory.getbasetemp() / 'near.csv'
    found = read_detections(table(path, *(line(STAMP_NS + stamp) for stamp in stamps)))
    rows = found.rows_near(STAMP_NS + wanted, tolerance)
    least = min(abs(stamp - wanted) for stamp in stamps)
    taken = (found.stamp_ns[rows] - STAMP_NS).tolist()
    assert bool(taken) == (least <= tolerance)
    if taken:
        assert len(set(taken)) == 1
        assert abs(taken[0] - wanted) == least
        assert len(taken) == stamps.count(taken[0])


def test_recorded_objects_become_anchors(tmp_path, config):
    path = table(tmp_path / 'd.csv',
                 line(label=1, box=(-10, 20, 50, 40), score=0.6),  # reaches beyond the image
                 line(label=2, box=(60, 30, 30, 30), score=0.9),
                 line(label=3, box=(60, 60, 30, 30), score=0.3),  # not confident enough
                 line(label=4, box=(60, 60, 2, 2), score=0.9),  # too small
                 line(STAMP_NS + 100 * MS, label=5))
    with GraphBuilder(replace(config, detections=str(path))) as builder:
        graph = builder.build(make.noise(1), STAMP_NS + 9 * MS)
        assert graph.label[:graph.object_count].tolist() == [2, 1]
        assert graph.size[:2].tolist() == [[30, 30], [40, 40]]
        assert graph.node_count > graph.object_count
        assert builder.build(make.noise(1), STAMP_NS + 11 * MS).object_count == 0


def test_detections_that_are_not_named_are_asked_for(config):
    with pytest.raises(ConfigError, match='setting "detections"'):
        GraphBuilder(config)


def test_a_topic_is_the_nodes(config):
    with GraphBuilder(replace(config, detector='topic')) as builder, pytest.raises(
            ConfigError, match='only the node'):
        builder.build(make.noise(1), STAMP_NS)


def test_detections_without_pictures_are_a_sequence(folder):
    sequence = open_sequence(folder)
    assert (sequence.name, sequence.image_size, sequence.frame_count) == ('office', (160, 120), 4)
    assert sequence.stamps_ns.tolist() == make.stamps()
    assert len(sequence.trajectory) == 4
    assert open_sequence(folder, ground_truth='none').detections == sequence.detections
    with pytest.raises(SequenceError, match='has no picture'):
        next(sequence.frames()).image()


def test_the_image_size_must_be_known(folder):
    (folder / 'rgb' / 'sample.jpg').unlink()
    with pytest.raises(SequenceError, match='to tell the image size'):
        open_sequence(folder)


def test_graphs_of_the_object_tier_alone(folder, config, tmp_path):
    found = open_graphs(str(folder), config, tmp_path / 'cache')
    assert [graph.node_count for graph in found.graphs] == [0, 1, 2, 3]
    assert [graph.object_count for graph in found.graphs] == [0, 1, 2, 3]
    graph = found.graphs[3]
    assert graph.label.tolist() == [5, 5, 8]
    assert graph.position.tolist() == [[35, 32.5], [75, 32.5], [115, 32.5]]
    assert graph.edge.tolist() == [[0, 1], [0, 2], [1, 2]]
    assert graph.word.tolist() == [5, 8]
    np.testing.assert_allclose(graph.word_weight, [2 / 3, 1 / 3])
    assert open_graphs(str(folder), config, tmp_path / 'cache').graphs == found.graphs
    # A changed line is another file, with other graphs.
    table(folder / 'detections.csv', *(line(stamp) for stamp in make.stamps()))
    assert open_graphs(str(folder), config, tmp_path / 'cache').graphs[0].node_count == 1


def test_a_network_cannot_look_at_no_picture(folder, config, tmp_path):
    with pytest.raises(ConfigError, match='expected the detector "csv", found "none"'):
        open_graphs(str(folder), replace(config, detector='none'), tmp_path)


def test_the_detections_of_another_sequence_are_refused(tmp_path, config):
    tum = make.tum_folder(tmp_path / 'desk')
    wrong = table(tmp_path / 'd.csv', line(STAMP_NS + 10**12))
    with pytest.raises(SequenceError, match='another sequence'):
        open_graphs(str(tum), replace(config, detections=str(wrong)), tmp_path / 'cache')


def test_detections_that_nobody_looks_at_are_refused(tmp_path, vocabulary):
    with pytest.raises(ConfigError, match='set the detector to "csv"'):
        GraphBuilder(BuilderConfig(detector='none', detections=str(tmp_path / 'found.csv'),
                                   vocabulary=vocabulary))


def test_a_detector_finds_loops_by_objects_alone(folder, config, lcd_model, tmp_path):
    graphs = open_graphs(str(folder), config, tmp_path / 'cache').graphs
    detector = LoopClosureDetector(LcdConfig(model=lcd_model, min_gap_s=0.0, map_window=0))
    for graph in graphs:
        detector.detect(replace(graph, stamp_ns=graph.stamp_ns - 10**10))
    for graph in graphs[1:]:
        found = detector.judge(graph)
        assert found.vbow_score == pytest.approx(1)
        assert graphs[found.match_sequence].word.tolist() == graph.word.tolist()
    assert 0 <= detector.judge(graphs[0]).probability <= 1


def test_class_words_are_frequencies():
    word, weight = class_words(np.array([9, 2, 9, 9], np.uint32))
    assert (word.tolist(), weight.tolist()) == ([2, 9], [0.25, 0.75])
    assert [len(part) for part in class_words(np.zeros(0, np.uint32))] == [0, 0]


def message(count=2, **fields):
    rng = np.random.default_rng(count)
    values = {'stamp_ns': 5, 'frame_id': 'left', 'label': np.arange(count, dtype=np.uint32),
              'box': (rng.random((count, 4)) + 1).astype(np.float32),
              'score': rng.random(count).astype(np.float32)}
    return codec.FrameDetections(**values | fields)


@given(st.integers(0, 5), st.integers(0, 2**62))
def test_the_message_round_trips(count, stamp_ns):
    sent = message(count, stamp_ns=stamp_ns % (2**31 * 10**9))
    payload = codec.encode_detections(sent)
    found = codec.decode_detections(payload)
    assert (found.stamp_ns, found.frame_id) == (sent.stamp_ns, 'left')
    for name in ('label', 'box', 'score'):
        np.testing.assert_array_equal(getattr(found, name), getattr(sent, name))


def test_the_message_is_told_from_the_others():
    payload = codec.encode_detections(message(stamp_ns=STAMP_NS))
    assert identify_payload(payload)[0] == 'Detections'


@pytest.mark.parametrize(('fields', 'said'), [
    ({'score': np.array([0.5, 1.5], np.float32)}, 'score'),
    ({'score': np.array([0.5, np.nan], np.float32)}, 'score'),
    ({'label': np.array([3, 65536], np.uint32)}, 'class 65536'),
    ({'score': np.zeros(3, np.float32)}, '3 scores'),
    ({'box': np.ones((1, 4), np.float32)}, '4 values of box'),
    ({'box': np.array([[0, 0, 1, 1], [0, 0, 0, 1]], np.float32)}, 'without width'),
    ({'box': np.array([[0, 0, 1, 1], [0, np.inf, 1, 1]], np.float32)}, 'not finite')])
def test_a_message_that_contradicts_itself_is_refused(fields, said):
    with pytest.raises(CodecError, match=said):
        codec.decode_detections(codec.encode_detections(message(**fields)))


@given(hnp.arrays(np.uint8, st.integers(0, 200)))
def test_noise_is_no_message(noise):
    with pytest.raises(CodecError):
        codec.decode_detections(noise.tobytes())


@pytest.fixture
def inbox():
    counted = []
    box = DetectionInbox(10, wait_s=1.0, capacity=3, count=counted.append)
    box.counted = counted
    return box


def objects(label):
    return Detections(np.array([label], np.uint32), np.ones((1, 4), np.float32),
                      np.ones(1, np.float32))


def test_frames_and_detections_meet_whichever_come_first(inbox):
    first = inbox.expect(100, 0.0)
    assert not first.done()
    inbox.offer(95, objects(1))
    inbox.offer(200, objects(2))
    assert first.result(0).label.tolist() == [1]
    assert inbox.expect(210, 0.1).result(0).label.tolist() == [2]
    assert inbox.counted == []


def test_the_nearest_frame_gets_the_detections(inbox):
    early, late = inbox.expect(100, 0.0), inbox.expect(112, 0.0)
    inbox.offer(108, objects(1))
    assert late.done()
    assert not early.done()


def test_a_frame_waits_only_so_long(inbox):
    first, second = inbox.expect(100, 0.0), inbox.expect(200, 0.5)
    inbox.expire(1.0)
    assert len(first.result(0)) == 0
    assert not second.done()
    inbox.offer(100, objects(1))  # too late
    assert inbox.counted == [MISSED, UNMATCHED]


def test_only_so_many_frames_wait(inbox):
    waiting = [inbox.expect(100 * k, 0.0) for k in range(5)]
    assert [frame.done() for frame in waiting] == [True, True, False, False, False]
    inbox.close()
    assert all(frame.done() for frame in waiting)
    assert inbox.counted == [MISSED] * 5


def test_detections_without_a_frame_are_counted_not_kept(inbox):
    for k in range(MAX_EARLY + 2):
        inbox.offer(1000 + k, objects(k))
    assert inbox.counted == [UNMATCHED] * 2
    inbox.expect(10_000, 0.0)
    assert inbox.counted == [UNMATCHED] * (MAX_EARLY + 2)


def test_the_real_detections(shared_data):
    sequence = open_sequence(shared_data('rgbd_dataset_freiburg3_long_office_household'))
    assert (sequence.frame_count, sequence.image_size) == (2585, (640, 480))
    assert sequence.stamps_ns[0] == 1_341_847_980_722_988_000
    assert len(read_detections(sequence.detections).label) == 17225
