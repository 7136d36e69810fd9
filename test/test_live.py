# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The whole evaluation over real processes, on a thinned embedded tour."""

import json

from graph_factory import make_graph
import pytest

from adversarial_lcd_ros.config import (
    AttackConfig,
    BuilderConfig,
    LabelConfig,
    LcdConfig,
    ReplayConfig,
)
from adversarial_lcd_ros.errors import ConfigError, EvaluationError
from adversarial_lcd_ros.evaluation.methods import used_settings
from adversarial_lcd_ros.evaluation.replay import replays
from adversarial_lcd_ros.evaluation.replay.offline import run_offline
from adversarial_lcd_ros.evaluation.replay.plan import Plan
from adversarial_lcd_ros.evaluation.replay.processes import Recording
from adversarial_lcd_ros.evaluation.replay.recipe import load_recipe
from adversarial_lcd_ros.evaluation.replay.run import evaluate_live
from adversarial_lcd_ros.messages.types import AttackReport
from adversarial_lcd_ros.paths import share_path

SUMMARY_FIELDS = {
    'sequence', 'frames', 'graphs', 'decisions', 'nodes_mean', 'edges_mean', 'positives',
    'negatives', 'clean', 'attacks', 'seed'}
CLEAN_FIELDS = {
    'accuracy', 'balanced_accuracy', 'precision', 'recall', 'recall_at_100_precision', 'mcc'}
ATTACK_FIELDS = {
    'perturbation', 'surrogate', 'ratio', 'mode', 'edits_mean', 'queries_mean', 'unattackable',
    'suppressed', 'invented', 'accuracy', 'decline_pp', 'decline_ci95'}
THIN = ReplayConfig(stride=6, window=2, timeout_s=60.0)
NO_NETWORK = BuilderConfig(detector='none')


@pytest.fixture
def tour():
    pytest.importorskip('rclpy')
    return share_path('bags/flat_tour')


def test_wire_and_offline_agree_decision_by_decision(tour, tmp_path, kept_runs):
    attacks = {
        'recall': AttackConfig(search='recall', max_queries=8),
        'paper': AttackConfig(queries_per_edit=1, max_queries=6)}
    folder, summary = evaluate_live(
        tour, tmp_path / 'results', Plan(NO_NETWORK, LcdConfig(), LabelConfig(), THIN, attacks))

    assert (tmp_path / 'results' / 'latest').resolve() == folder
    for name in ('summary.json', 'per_query.csv', 'report.html', 'configuration.json'):
        assert (folder / name).stat().st_size
    assert len(list((folder / 'pictures').glob('*.jpg'))) == 6
    assert summary['frames'] == summary['graphs'] == summary['decisions'] == 60
    assert SUMMARY_FIELDS <= set(summary)
    assert CLEAN_FIELDS <= set(summary['clean'])
    assert all(ATTACK_FIELDS <= set(attack) for attack in summary['attacks'])
    assert json.loads((folder / 'summary.json').read_text())['frames'] == 60
    assert summary['graphs_rebuilt_differently'] == {'recall': 0, 'paper': 0}

    clean = kept_runs['clean']
    assert run_offline(clean.clean, LcdConfig())[0].decisions == clean.decisions
    for name, attack in attacks.items():
        offline, forwarded = run_offline(clean.clean, LcdConfig(), attack)
        assert forwarded == kept_runs[name].forwarded
        assert offline.decisions == kept_runs[name].decisions
        assert ([(report.status, report.edits, report.queries) for report in offline.reports]
                == [(report.status, report.edits, report.queries)
                    for report in kept_runs[name].reports])


def test_a_node_that_fails_is_told_with_its_own_words(tour, tmp_path):
    plan = Plan(BuilderConfig(model=str(tmp_path / 'none.onnx')), LcdConfig(), LabelConfig(),
                THIN, {})
    with pytest.raises(EvaluationError, match=r'graph_builder ended.*none\.onnx'):
        evaluate_live(tour, tmp_path / 'results', plan)
    assert not (tmp_path / 'results' / 'latest').exists()


GRAPH = make_graph(60)


@pytest.mark.parametrize(('run', 'said'), [
    (Recording([], [GRAPH], [None], []), '0 graphs'),
    (Recording([GRAPH], [GRAPH], [], []), '0 decisions'),
    (Recording([GRAPH], [GRAPH], [None], []), '0 attack reports'),
])
def test_a_lost_message_fails_the_run(run, said):
    with pytest.raises(EvaluationError, match=said):
        replays._check('attack', run, 1)


def test_an_attacker_over_budget_fails_the_run():
    report = AttackReport(0, '', 0, 'success', edit_budget=1)
    run = Recording([GRAPH], [GRAPH.flip([(0, 5), (1, 5)])], [None], [report])
    with pytest.raises(EvaluationError, match='budget of 1'):
        replays._check('attack', run, 1)


def test_the_recipe_that_ships_and_what_overrides_it():
    attacks = load_recipe('quick', {'ratio': 1e-4}).attacks
    assert {attack.search for attack in attacks.values()} == {'recall', 'stepwise'}
    assert {attack.ratio for attack in attacks.values()} == {1e-4}


@pytest.mark.parametrize(('overrides', 'names'), [
    ({'ratio': 1e-4}, ['recall', 'recall, no queries', 'eigencentrality + SVM-RBF',
                       'eigencentrality + SVM-RBF, no queries']),
    # The search of the last two is not the paper's any more, and the last is the second.
    ({'search': 'recall'}, ['recall', 'recall, no queries', 'recall, query-guided']),
    # Recall has no perturbation.
    ({'perturbation': 'random_walk'}, [
        'recall', 'recall, no queries', 'random walk + SVM-RBF, query-guided',
        'random walk + SVM-RBF, surrogate only']),
    ({'search': 'replay', 'mode': 'query'}, [
        'replay, query-guided', 'replay, query-guided (in place of recall, no queries)',
        'replay, query-guided (in place of eigencentrality + SVM-RBF)']),
])
def test_an_attack_is_called_what_it_is(overrides, names):
    attacks = load_recipe('quick', overrides).attacks
    assert list(attacks) == names
    assert len(set(map(used_settings, attacks.values()))) == len(names)


@pytest.mark.parametrize(('text', 'said'), [
    ('attacks: []', 'expected a list'),
    ('nothing: 1', 'expected a list'),
    ('attacks: [{search: recall}]', 'no attack with a name'),
    ('attacks: [{name: a, epsilon: 1}]', 'unknown setting epsilon'),
    ('attacks: [{name: a}, {name: a}]', 'taken'),
    ('{', 'cannot be read as YAML'),
])
def test_a_wrong_recipe_is_refused(tmp_path, text, said):
    path = tmp_path / 'recipe.yaml'
    path.write_text(text)
    with pytest.raises(ConfigError, match=said):
        load_recipe(str(path), {})


def test_an_unknown_recipe_is_refused():
    with pytest.raises(ConfigError, match='quick'):
        load_recipe('nonesuch', {})
