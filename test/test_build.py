# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd build: graphs into a bag, complete or not there; evaluated like images."""

import json

import bag_factory as make
import pytest

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.config import (
    AttackConfig,
    BuilderConfig,
    LabelConfig,
    LcdConfig,
    ReplayConfig,
)
from adversarial_lcd_ros.errors import EvaluationError, ModelError, SequenceError
from adversarial_lcd_ros.evaluation.replay.offline import run_offline
from adversarial_lcd_ros.evaluation.replay.plan import Plan
from adversarial_lcd_ros.evaluation.replay.run import evaluate_live
from adversarial_lcd_ros.graph_sequences.bags import build_graph_bag
from adversarial_lcd_ros.graph_sequences.opening import open_graphs
from adversarial_lcd_ros.paths import share_path
from adversarial_lcd_ros.sequences.bagfile import METADATA
from adversarial_lcd_ros.sequences.replay import Replay
from adversarial_lcd_ros.vision.builder import GraphBuilder


@pytest.fixture
def config(vocabulary):
    return BuilderConfig(detector='none', vocabulary=vocabulary, features=20,
                         detected_features=40)


def test_a_bag_has_the_graphs_the_ground_truth_and_where_they_are_from(tmp_path, config):
    source, bag = make.textured_folder(tmp_path / 'desk'), tmp_path / 'bag'
    (source / 'CREDITS.txt').write_text('made by a test')
    done = build_graph_bag(str(source), bag, config, cache=tmp_path / 'cache')
    again = open_graphs(str(bag), BuilderConfig())
    assert again.graphs == done.graphs.graphs == open_graphs(
        str(source), config, tmp_path / 'cache').graphs
    assert again.trajectory.stamp_ns.tolist() == make.stamps()
    assert (done.poses, done.graphs.name) == (4, 'desk')
    assert (bag / 'CREDITS.txt').read_text() == 'made by a test'
    metadata = (bag / METADATA).read_text()
    assert 'node_descriptor' in metadata
    assert json.dumps(str(source)) in metadata
    rows = [(topic, stamp) for topic, _, stamp, _ in Replay(bag, ReplayConfig())]
    assert rows == [(topic, stamp) for stamp in make.stamps()
                    for topic in ('/ground_truth', '/graph')]


def test_a_part_becomes_a_bag_with_its_poses_only(tmp_path, config):
    source = make.textured_folder(tmp_path / 'desk', 20)
    done = build_graph_bag(f'{source}@0.5:1', tmp_path / 'bag', config, cache=tmp_path / 'cache')
    assert [graph.sequence for graph in done.graphs.graphs] == list(range(10, 20))
    # Those of 0.1 s before the first frame are kept, too.
    assert done.poses == 13


def test_a_bag_that_is_there_stays_unless_it_may_go(tmp_path, config, monkeypatch):
    source, bag = str(make.textured_folder(tmp_path / 'desk')), tmp_path / 'bag'
    build_graph_bag(source, bag, config, cache=tmp_path / 'cache')
    before = GraphBuilder.begin
    monkeypatch.setattr(GraphBuilder, 'begin', lambda *_: pytest.fail('built'))
    with pytest.raises(SequenceError, match='exists already'):
        build_graph_bag(source, bag, config, cache=tmp_path / 'other')
    monkeypatch.setattr(GraphBuilder, 'begin', before)
    build_graph_bag(f'{source}@0:0.5', bag, config, cache=tmp_path / 'cache', overwrite=True)
    assert len(open_graphs(str(bag), config).graphs) == 2


def test_what_breaks_off_leaves_nothing(tmp_path, config, monkeypatch):
    def broken(*_, **__):
        raise ModelError('the network fails')
    monkeypatch.setattr(GraphBuilder, 'begin', broken)
    with pytest.raises(ModelError):
        build_graph_bag(str(make.textured_folder(tmp_path / 'desk')), tmp_path / 'out' / 'bag',
                        config, cache=tmp_path / 'cache')
    assert list((tmp_path / 'out').iterdir()) == []
    assert not (tmp_path / 'cache').exists()


def test_the_command_line(tmp_path, vocabulary, capsys):
    source = make.textured_folder(tmp_path / 'desk')
    command = ['build', str(source), str(tmp_path / 'bag'), '--detector', 'none',
               '--vocabulary', vocabulary, '--features', '20', '--cache', str(tmp_path / 'cache')]
    assert main(command) == 0
    assert 'bag: 4 graphs, 20.0 nodes' in ' '.join(capsys.readouterr().out.split())
    assert main(command) == 2
    assert 'exists already' in capsys.readouterr().err


@pytest.fixture
def graph_bag(tmp_path):
    pytest.importorskip('rclpy')
    bag = tmp_path / 'tour'
    build_graph_bag(f'{share_path("bags/flat_tour")}@0.25:0.75', bag,
                    BuilderConfig(detector='none', features=60), cache=tmp_path / 'cache')
    return bag


def test_a_bag_of_graphs_is_evaluated_like_one_of_images(graph_bag, tmp_path):
    attacks = {'flip': AttackConfig(perturbation='random_flip', queries_per_edit=1)}
    replay = ReplayConfig(stride=6, window=4, timeout_s=60.0)
    said = []
    folder, summary = evaluate_live(
        graph_bag, tmp_path / 'results', Plan(BuilderConfig(), LcdConfig(), LabelConfig(), replay,
                                              attacks), tell=said.append)
    assert summary['frames'] == summary['graphs'] == 30
    assert 'without a graph_builder' in said[0]
    sections = json.loads((folder / 'configuration.json').read_text())['settings']
    assert 'graph_builder' not in [section['section'] for section in sections]
    assert len(list((folder / 'pictures').glob('*.jpg'))) > 0
    offline, _ = run_offline(open_graphs(str(graph_bag), BuilderConfig()).graphs[::6],
                             LcdConfig(), attacks['flip'])
    attack, = (attack for attack in summary['attacks'] if attack['name'] == 'flip')
    queries = [report.queries for report in offline.reports]
    assert attack['queries_mean'] == pytest.approx(sum(queries) / len(queries))


def test_nothing_can_be_rebuilt_from_graphs(graph_bag, tmp_path):
    plan = Plan(BuilderConfig(), LcdConfig(), LabelConfig(), ReplayConfig(), {}, rebuild=True)
    with pytest.raises(EvaluationError, match='nothing can be rebuilt'):
        evaluate_live(graph_bag, tmp_path / 'results', plan)
