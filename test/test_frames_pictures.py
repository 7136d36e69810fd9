# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of frames that the strongest attack of an experiment turned over."""

import logging

import pytest
from walk_factory import LABELS, NODES, builder_config, lcd_config, walk_folder

from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.evaluation.frames.cells import Cell
from adversarial_lcd_ros.evaluation.frames.pictures import attacked_pictures
from adversarial_lcd_ros.evaluation.frames.run import plan_experiment, run_experiment
from adversarial_lcd_ros.evaluation.store import open_store
from adversarial_lcd_ros.evaluation.streams import open_streams

ATTACK = AttackConfig(perturbation='random_flip', surrogate='none', ratio=0.5, queries_per_edit=1)
CELLS = [Cell('stepwise', ATTACK, 'wl', 'wl', 'soft', NODES, 3, 2),
         Cell('optimum', ATTACK, 'wl', 'wl', 'soft', NODES, 3, 2)]


@pytest.fixture
def attacked(tmp_path, vocabulary, lcd_model):
    streams = open_streams([str(walk_folder(tmp_path / 'walk'))], [NODES],
                           builder_config(vocabulary), LABELS, tmp_path / 'cache',
                           lambda *_: None)
    lcd = lcd_config(lcd_model)
    with open_store(tmp_path / 'out') as store:
        rows = run_experiment(plan_experiment(streams, CELLS, lcd), store, map, lambda *_: None)
    return streams, CELLS, rows, lcd


def test_each_picture_shows_another_frame_that_was_turned_over(attacked):
    rows = attacked[2]
    turned = {frame['stamp'] for row in rows if row['perturbation'] == 'random_flip'
              for frame in row['frame_results']
              if (frame['clean'], frame['attacked']) in (('TP', 'FN'), ('TN', 'FP'))}
    assert turned
    pictures = attacked_pictures(*attacked)
    assert len(pictures) == len({picture.title for picture in pictures}) == min(len(turned), 6)
    assert all('by random flip' in picture.title for picture in pictures)
    assert all(picture.image.shape[1] == 1440 for picture in pictures)
    assert len(attacked_pictures(*attacked, count=1)) == 1


def test_a_frame_that_comes_out_differently_has_no_picture(attacked, caplog):
    streams, cells, rows, lcd = attacked
    for row in rows:
        for frame in row['frame_results']:
            frame['queries'] += 1
    with caplog.at_level(logging.WARNING):
        assert attacked_pictures(streams, cells, rows, lcd) == []
    assert 'no picture' in caplog.text


def test_an_attack_without_effect_has_no_picture(attacked):
    streams, cells, rows, lcd = attacked
    rows = [{**row, 'suppressed': 0, 'invented': 0} for row in rows]
    assert attacked_pictures(streams, cells, rows, lcd) == []
