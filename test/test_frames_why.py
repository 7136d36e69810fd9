# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The picture of why: what attacks ask about, and what targets feel, over one frame."""

import json
from pathlib import Path

import cv2
import numpy as np
from paper_factory import make_row
import pytest
from walk_factory import LABELS, NODES, builder_config, lcd_config, walk_folder

from adversarial_lcd_ros.attack.perturbations import Allowed, make_perturbation
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.frames.cells import Cell
from adversarial_lcd_ros.evaluation.frames.why import ASKED, explain, extremes
from adversarial_lcd_ros.evaluation.frames.why_picture import sentences, write_why
from adversarial_lcd_ros.evaluation.paper.report import write_paper_report
from adversarial_lcd_ros.evaluation.pictures import read_why, write_pictures
from adversarial_lcd_ros.evaluation.streams import load_stream_graphs, open_streams
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector

ATTACK = AttackConfig(ratio=0.02)


@pytest.fixture(params=['frames', 'pairs'])
def experiment(request, tmp_path, vocabulary, lcd_model):
    streams = open_streams([str(walk_folder(tmp_path / 'walk'))], [NODES],
                           builder_config(vocabulary), LABELS, tmp_path / 'cache',
                           lambda *_: None)
    cells = [Cell('stepwise', ATTACK, target, target, 'soft', NODES, 3, 2, judged=request.param)
             for target in ('wl', 'edges')]
    rows = [make_row('walk', target, judged=request.param, power=power)
            for target, power in (('wl', 0.5), ('edges', 0.1))]
    model = json.loads(Path(lcd_model).read_text())
    for target, channels in (('wl', model['channels']), ('edges', ['edges'])):
        (tmp_path / f'target_{target}.json').write_text(json.dumps(
            {**model, 'target': target, 'channels': channels,
             'weights': [10.0] * len(channels), 'bias': -1.0}))
    return streams, cells, rows, lcd_config(str(tmp_path))


def test_it_shows_what_is_asked_about_and_what_each_flip_takes(experiment, tmp_path):
    why = explain(*experiment)
    assert [seen.target for seen in why.targets] == ['wl', 'edges']
    assert why.edits == int(0.02 * why.targets[0].graph.node_count ** 2)
    for seen in why.targets:
        assert seen.margin > 0
        assert len(seen.taken) == seen.graph.node_count * (seen.graph.node_count - 1) // 2
        best = seen.taken_by(seen.strongest)
        assert best == pytest.approx(np.sort(seen.taken)[::-1][:ASKED])
        proposed = make_perturbation('eigencentrality').propose(
            seen.graph, ASKED, Allowed(), np.random.default_rng(0))
        # Flip after flip in its order, unless one turned the decision over and ended it.
        asked = seen.asked['eigencentrality']
        assert np.array_equal(asked, proposed[:len(asked)])
        assert len(asked) == ASKED or seen.taken_by(asked[-1:])[0] > seen.margin
        for pairs in seen.asked.values():
            assert len(np.unique(pairs, axis=0)) == len(pairs) <= ASKED
    write_pictures(tmp_path, [])
    write_why(tmp_path, why)
    found = read_why(tmp_path)
    assert found['sentences'] == sentences(why)
    for name, columns in (('wide', 4), ('narrow', 2)):
        image = cv2.imdecode(np.frombuffer(found[name], np.uint8), cv2.IMREAD_COLOR)
        assert image.shape[1] > 250 * columns
    assert 'Why: what is asked about' in write_paper_report(
        tmp_path, experiment[2]).read_text()
    write_why(tmp_path, None)
    assert read_why(tmp_path) is None


@pytest.mark.parametrize('experiment', ['frames'], indirect=True)
def test_what_is_felt_is_what_the_detector_answers(experiment):
    streams, _, _, lcd = experiment
    why = explain(*experiment)
    seen = why.targets[0]
    detector = LoopClosureDetector(lcd)
    for graph in load_stream_graphs(streams[0].graphs):
        if graph.stamp_ns == seen.graph.stamp_ns:
            break
        detector.remember(graph)
    before = detector.verdict_log_odds(seen.graph)
    for pairs in (seen.strongest[:3], seen.asked['shortest path'][:3]):
        for pair, taken in zip(pairs, seen.taken_by(pairs), strict=True):
            assert before - detector.verdict_log_odds(seen.graph.flip(pair)) == pytest.approx(
                taken, abs=1e-6)


def test_without_loops_or_cells_there_is_no_picture(experiment, tmp_path):
    streams, cells, rows, lcd = experiment
    assert explain(streams, [], rows, lcd) is None
    assert explain(streams, cells, [], lcd) is None
    deaf = [make_row('walk', 'wl', judged=rows[0]['judged'], positives=0)]
    assert explain(streams, cells, deaf, lcd) is None


def test_targets_are_where_the_papers_attack_takes_most_and_least():
    rows = [make_row(target=target, power=power, judged='pairs')
            for target, power in (('wl', 0.1), ('edges', 0.5), ('symbio', 0.9))]
    rows += [make_row(target='anchored', power=1.0, judged='frames'),
             make_row(target='objects', power=1.0, judged='pairs', asked_target='wl'),
             make_row(target='gnn', power=1.0, judged='pairs', perturbation='recall')]
    assert extremes(rows, 'pairs') == ['symbio', 'wl']
    assert extremes(rows, 'frames') == ['anchored']
    assert extremes(rows[:0], 'pairs') == []


def test_a_damaged_text_is_said(tmp_path):
    (tmp_path / 'pictures').mkdir()
    (tmp_path / 'pictures/why.json').write_text('{"caption": 3}')
    with pytest.raises(EvaluationError, match='lacks caption'):
        read_why(tmp_path)
