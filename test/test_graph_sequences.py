# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The graphs of a sequence: built once, then read; parts; bags that hold graphs."""

from dataclasses import replace
import logging

import bag_factory as make
import cv2
from graph_factory import make_graph
import numpy as np
import pytest
from walk_factory import walk_folder

from adversarial_lcd_ros.config import BuilderConfig
from adversarial_lcd_ros.errors import CodecError, EvaluationError, SequenceError
from adversarial_lcd_ros.graph_sequences import cache
from adversarial_lcd_ros.graph_sequences import opening as graph_sequences
from adversarial_lcd_ros.graph_sequences.cache import load_graphs, save_graphs
from adversarial_lcd_ros.graph_sequences.opening import open_graphs
from adversarial_lcd_ros.messages.codec import encode_graph
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.sequences.inspection import inspect_bag
from adversarial_lcd_ros.vision.builder import GraphBuilder

PAYLOAD = 'std_msgs/msg/UInt8MultiArray'


@pytest.fixture
def config(vocabulary):
    return BuilderConfig(detector='none', vocabulary=vocabulary, features=20,
                         detected_features=40)


@pytest.fixture
def built(monkeypatch):
    """Return a list that grows by one with each frame that is built anew."""
    calls = []
    begin = GraphBuilder.begin
    monkeypatch.setattr(GraphBuilder, 'begin', lambda *args, **kwargs: (
        calls.append(1), begin(*args, **kwargs))[1])
    return calls


def graph_rows(topic='/graph', count=4):
    types = make.ROS2
    for number, stamp in enumerate(make.stamps(count)):
        payload = encode_graph(make_graph(stamp_ns=stamp, sequence=number, seed=number))
        yield (topic, PAYLOAD, stamp, types.make(
            PAYLOAD, layout=types.make('std_msgs/msg/MultiArrayLayout', dim=[], data_offset=0),
            data=np.frombuffer(payload, np.uint8)))


def test_graphs_are_those_of_the_builder_and_built_once(tmp_path, config, built):
    folder, progress = make.textured_folder(tmp_path / 'desk'), []
    first = open_graphs(str(folder), config, tmp_path / 'cache',
                        lambda *now: progress.append(now))
    assert progress == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert (first.name, first.image_size) == ('desk', (160, 120))
    assert [graph.stamp_ns for graph in first.graphs] == make.stamps()
    assert len(first.trajectory) == 4
    assert first.graphs[0].node_count > 0
    count = len(built)
    again = open_graphs(str(folder), config, tmp_path / 'cache',
                        lambda *now: progress.append(now))
    assert len(built) == count == 4
    assert progress[4:] == [(4, 4)]
    assert again.graphs == first.graphs
    assert len(list((tmp_path / 'cache').iterdir())) == 1
    with GraphBuilder(config) as builder:
        image = cv2.imread(str(next((folder / 'rgb').iterdir())))
        stamp = int(next((folder / 'rgb').iterdir()).stem.replace('.', ''))
        number = make.stamps().index(stamp)
        assert builder.build(image, stamp, sequence=number) == first.graphs[number]


def test_the_default_cache_is_the_users(tmp_path, config, monkeypatch):
    monkeypatch.setenv('ADVERSARIAL_LCD_CACHE', str(tmp_path / 'mine'))
    open_graphs(str(make.textured_folder(tmp_path / 'desk')), config)
    assert len(list((tmp_path / 'mine' / 'graphs').glob('*.npz'))) == 1


def test_a_part_has_its_frames_with_their_numbers(tmp_path, config):
    folder = make.textured_folder(tmp_path / 'desk')
    part = open_graphs(f'{folder}@0.5:1', config, tmp_path / 'cache')
    assert [(graph.sequence, graph.stamp_ns) for graph in part.graphs] == [
        (2, make.stamps()[2]), (3, make.stamps()[3])]
    assert part.name == 'desk, frames 2 to 3 of 4'
    with pytest.raises(SequenceError, match='holds none'):
        open_graphs(f'{folder}@0:0.1', config, tmp_path / 'cache')


def change_picture(folder, config, vocabulary):
    first = sorted((folder / 'rgb').iterdir())[0]
    first.write_bytes(make.encoded(make.noise(99)))
    return config


def change_settings(folder, config, vocabulary):
    return replace(config, feature_neighbours=3)


def change_vocabulary(folder, config, vocabulary):
    with np.load(vocabulary) as arrays:
        changed = dict(arrays) | {'idf': 2 * arrays['idf']}
    np.savez(vocabulary, **changed)
    return config


@pytest.mark.parametrize('change', [change_picture, change_settings, change_vocabulary])
def test_what_a_graph_is_made_of_decides_whether_it_is_built_anew(tmp_path, config, vocabulary,
                                                                  built, change):
    folder = make.textured_folder(tmp_path / 'desk')
    open_graphs(str(folder), config, tmp_path / 'cache')
    open_graphs(str(folder), change(folder, config, vocabulary), tmp_path / 'cache')
    assert len(built) == 8


def test_threads_do_not_matter(tmp_path, config, built):
    folder = make.textured_folder(tmp_path / 'desk')
    for threads in (1, 2):
        open_graphs(str(folder), replace(config, threads=threads), tmp_path / 'cache')
    assert len(built) == 4


@pytest.mark.parametrize('damage', [
    lambda data: data[:100], lambda data: b'', lambda data: data[:-2000] + b'x' * 2000,
    lambda data: data[:3000] + bytes([data[3000] ^ 1]) + data[3001:]])
def test_a_damaged_cache_is_built_again_and_says_so(tmp_path, config, built, caplog, damage):
    folder, cache = make.textured_folder(tmp_path / 'desk'), tmp_path / 'cache'
    before = open_graphs(str(folder), config, cache)
    file, = cache.iterdir()
    whole = file.read_bytes()
    file.write_bytes(damage(whole))
    with caplog.at_level(logging.WARNING):
        assert open_graphs(str(folder), config, cache).graphs == before.graphs
    assert len(built) == 8
    assert str(file) in caplog.text
    assert file.read_bytes() == whole


def test_a_run_that_breaks_off_leaves_nothing(tmp_path, config, monkeypatch):
    def broken(path, graphs):
        raise KeyboardInterrupt
    monkeypatch.setattr(graph_sequences, 'save_graphs', broken)
    with pytest.raises(KeyboardInterrupt):
        open_graphs(str(make.textured_folder(tmp_path / 'desk')), config, tmp_path / 'cache')
    assert not (tmp_path / 'cache').exists()


def test_no_graphs_can_be_kept(tmp_path):
    save_graphs(tmp_path / 'none.npz', [])
    assert load_graphs(tmp_path / 'none.npz') == []


def test_a_cache_that_cannot_be_written_is_said(tmp_path, config):
    (tmp_path / 'cache').write_text('a file')
    with pytest.raises(EvaluationError, match='ADVERSARIAL_LCD_CACHE'):
        open_graphs(str(make.textured_folder(tmp_path / 'desk')), config, tmp_path / 'cache')


def test_graphs_of_a_bag_are_taken_as_they_are(tmp_path, config, built):
    bag = make.write_ros2(tmp_path / 'bag', [*graph_rows(), *make.pose_rows()])
    found = open_graphs(str(bag), config, tmp_path / 'cache')
    assert found.graphs == [make_graph(stamp_ns=stamp, sequence=k, seed=k)
                            for k, stamp in enumerate(make.stamps())]
    assert (found.name, found.image_size, len(found.trajectory)) == ('bag', (640, 480), 4)
    assert [g.sequence for g in open_graphs(f'{bag}@0.25:0.5', config).graphs] == [1]
    assert not built
    assert not (tmp_path / 'cache').exists()


def test_clean_graphs_go_before_attacked_ones(tmp_path, config):
    bag = make.write_ros2(tmp_path / 'bag', [*graph_rows('/graph', 2),
                                             *graph_rows('/graph_clean', 4)])
    found = open_graphs(str(bag), config)
    assert len(found.graphs) == 4
    assert found.trajectory is None


def test_the_key_of_kept_graphs_knows_the_code_that_built_them(tmp_path, config, monkeypatch):
    sequence = open_sequence(walk_folder(tmp_path / 'walk'))
    keys = []
    for code in ('of yesterday', 'of today'):
        monkeypatch.setattr(cache, 'code_digest', lambda *places, code=code: code)
        keys.append(cache.cache_key(sequence, range(2), config))
    assert len(set(keys)) == 2


def test_a_payload_that_is_refused_is_named_by_its_place(tmp_path, config):
    rows = list(graph_rows('/graph', 3))
    topic, kind, stamp, message = rows[1]
    rows[1] = topic, kind, stamp, type(message)(message.layout, message.data[:-8])
    bag = make.write_ros2(tmp_path / 'bag', rows)
    for read in (lambda: open_graphs(str(bag), config), lambda: inspect_bag(bag)):
        with pytest.raises(CodecError, match=r'bag .*/bag, message 1 on /graph: '):
            read()
