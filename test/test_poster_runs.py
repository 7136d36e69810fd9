# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs of a replay in which a poster hangs: recipes, which run starts from what, live."""

import json

import numpy as np
import pytest

from adversarial_lcd_ros.attack.images.posting import spans_in
from adversarial_lcd_ros.config import (
    AttackConfig,
    BuilderConfig,
    LabelConfig,
    LcdConfig,
    ReplayConfig,
)
from adversarial_lcd_ros.errors import ConfigError, EvaluationError
from adversarial_lcd_ros.evaluation.replay import run as live
from adversarial_lcd_ros.evaluation.replay.findings import headline, meaning
from adversarial_lcd_ros.evaluation.replay.plan import Plan
from adversarial_lcd_ros.evaluation.replay.recipe import load_recipe
from adversarial_lcd_ros.evaluation.replay.replays import Replays
from adversarial_lcd_ros.evaluation.replay.run import evaluate_live
from adversarial_lcd_ros.ground_truth.labelling import Views, label_views
from adversarial_lcd_ros.paths import share_path
from adversarial_lcd_ros.sequences import open_sequence

PASS = AttackConfig(mode='pass')
HUNG = {'poster': 'cells', 'poster_share': 0.3, 'poster_spans': '6:8, 18:20'}


def plan(attacks, posters, **more):
    return Plan(BuilderConfig(detector='none'), LcdConfig(), LabelConfig(),
                ReplayConfig(stride=10, window=2, timeout_s=60.0),
                {name: PASS for name in attacks}, posters=posters, **more)


def test_posters_of_the_recipe_that_ships_hang_in_places_that_certainly_differ():
    bag = share_path('bags/flat_tour')
    sequence = open_sequence(bag)
    time_s = (sequence.stamps_ns - sequence.stamps_ns[0]) / 1e9
    recipe = load_recipe('posters', {})
    posters = recipe.posters
    assert list(posters) == list(recipe.attacks)
    spans = {text: spans_in(text) for text in (
        settings['poster_spans'] for settings in posters.values())}
    hung = [[(start <= time_s) & (time_s < stop) for start, stop in each]
            for each in spans.values()]
    seen = np.flatnonzero(np.any(np.concatenate(hung), axis=0))
    elsewhere = label_views(Views(
        sequence.stamps_ns[seen], sequence.image_size, sequence.trajectory, bag, ()),
        LabelConfig()).labels.elsewhere
    for first, second in hung:
        assert elsewhere[np.ix_(second[seen], first[seen])].all()
        # Old enough to be a match of all of the other stretch.
        assert time_s[second].min() - time_s[first].max() >= LcdConfig().min_gap_s
        # Before the first loop.
        assert np.flatnonzero(second).max() < 120


@pytest.mark.parametrize(('replay', 'said'), [
    ('{rate: 2.0}', 'settings of a poster'), ('7', 'settings of a poster'),
    ('{poster: cells}', 'hangs no poster'), ('{poster_spans: "1:2"}', 'hangs no poster'),
    ('{poster: cells, poster_spans: "2:1"}', 'FROM:TO'),
    ('{poster: cloth, poster_spans: "1:2"}', 'cloth'),
    ('{poster: cells, poster_spans: "1:2", poster_sheets: 2, poster_share: 0.4}', 'overlap'),
    ('{poster_size: 3}', 'poster_size')])
def test_wrong_posters_are_refused(tmp_path, replay, said):
    path = tmp_path / 'recipe.yaml'
    path.write_text(f'attacks: [{{name: a, mode: pass, replay: {replay}}}]')
    with pytest.raises(ConfigError, match=said):
        load_recipe(str(path), {})


@pytest.mark.parametrize(('attacks', 'posters', 'built'), [
    ('ab', '', [None, 1]), ('pab', 'p', [None, None, 2]), ('apb', 'p', [None, None, 1]),
    ('pq', 'pq', [None, None])])
def test_runs_start_from_graphs_without_a_poster(tmp_path, attacks, posters, built):
    for rebuild in (False, True):
        runs = Replays(share_path('bags/flat_tour'), None, plan(
            attacks, dict.fromkeys(posters, HUNG), rebuild=rebuild), tmp_path, 0, str)
        assert runs._built_by('clean') is None
        assert [runs._built_by(name) for name in attacks] == (
            [None] * len(attacks) if rebuild else built)


def test_a_bag_of_graphs_has_no_pictures_for_a_poster(tmp_path):
    with pytest.raises(EvaluationError, match='no images to paste a poster into'):
        live._without_builder(tmp_path, plan('p', {'p': HUNG}), str)


def test_a_poster_hangs_in_its_run_alone(tmp_path, kept_runs):
    pytest.importorskip('rclpy', reason='rclpy is not installed')
    folder, summary = evaluate_live(share_path('bags/flat_tour'), tmp_path, plan(
        'pa', {'p': HUNG}))
    clean = kept_runs['clean'].clean
    changed = [(graph.stamp_ns - clean[0].stamp_ns) // 10**9
               for graph, other in zip(clean, kept_runs['p'].clean, strict=True) if graph != other]
    assert changed == [6, 18]  # of a frame each two seconds
    assert kept_runs['a'].clean == clean
    assert summary['graphs_rebuilt_differently'] == {'a': 0}
    assert json.loads((folder / 'configuration.json').read_text())['posters'] == {'p': HUNG}
    row = json.loads((folder / 'summary.json').read_text())['rows'][1]
    assert row['poster'] == {'kind': 'cells', 'share': 0.3, 'sheets': 1,
                             'spans': '6:8, 18:20'}


def test_what_a_poster_takes_is_not_told_as_an_attack_on_messages():
    attack = {'name': 'p', 'mode': 'pass', 'search': '', 'perturbation': '', 'surrogate': '',
              'poster': {'kind': 'cells', 'share': 0.1, 'spans': '6:8, 18:20'},
              'decline_pp': 10.0, 'decline_ci95': (5.0, 15.0), 'balanced_accuracy': 0.8,
              'suppressed': 0, 'invented': 1, 'invented_elsewhere': 1, 'left_out': 0}
    summary = {'sequence': 'tour', 'nodes_mean': 300.0, 'edges_mean': 900.0,
               'clean': {'tp': 5, 'tn': 5, 'balanced_accuracy': 0.9}, 'attacks': [attack]}
    assert 'a poster of 10' in headline(summary)
    assert 'edges flipped' not in headline(summary)
    assert 'no access to any message' in meaning(summary)[-1]
