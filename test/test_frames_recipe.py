# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recipes of evaluations by frames."""

import pytest

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.evaluation.frames.cells import detector_of
from adversarial_lcd_ros.evaluation.frames.recipe import load_cells, load_labels
from adversarial_lcd_ros.evaluation.replay.recipe import load_recipe


def written(tmp_path, text):
    path = tmp_path / 'mine.yaml'
    path.write_text(text)
    return str(path)


def test_the_paper_recipe_holds_what_the_paper_has_and_leaves_open():
    cells = load_cells('paper', {})
    surrogates = {cell.attack.surrogate for cell in cells
                  if cell.method == 'eigencentrality' and cell.attack.ratio == 3e-4
                  and cell.target == 'wl'}
    assert surrogates == {'svm_rbf', 'svm_linear', 'svm_poly', 'naive_bayes'}
    for perturbation in ('eigencentrality', 'random_walk', 'shortest_path', 'random_flip',
                         'recall', 'optimum'):
        assert {cell.attack.ratio for cell in cells if cell.method == perturbation} == {
            1e-4, 2e-4, 3e-4}
    moved = {(cell.method, cell.asked_target, cell.target) for cell in cells
             if cell.asked_target != cell.target}
    assert moved == {(perturbation, *pair) for perturbation in ('eigencentrality', 'recall')
                     for pair in (('wl', 'anchored'), ('anchored', 'wl'))}
    assert {cell.oracle for cell in cells if cell.target == 'anchored'} == {'soft', 'hard'}
    assert {cell.nodes for cell in cells} == {60, 100, 150, 300, 1000}
    assert {cell.attack.queries_per_edit for cell in cells} == {1, 2, 5, 10, 40}
    assert {cell.method for cell in cells if cell.attack.mode == 'surrogate'} == {
        'eigencentrality', 'recall'}


def test_axes_are_multiplied_and_doubles_run_once(tmp_path):
    cells = load_cells(written(tmp_path, """
protocol: frames
seeds: 3
frames: 2
defaults: {surrogate: none, ratio: 1e-4}
attacks:
  - ratio: [1e-4, 0.0002]
    target: [wl, edges]
  - {frames: 2}
  - {search: optimum, queries_per_edit: [10, 40], oracle: [soft, hard]}
"""), {})
    assert [(cell.method, cell.attack.ratio, cell.target) for cell in cells] == [
        ('eigencentrality', 1e-4, 'wl'), ('eigencentrality', 1e-4, 'edges'),
        ('eigencentrality', 2e-4, 'wl'), ('eigencentrality', 2e-4, 'edges'),
        ('optimum', 1e-4, 'wl')]
    assert {(cell.seeds, cell.frames, cell.asked_target == cell.target) for cell in cells} == {
        (3, 2, True)}


def test_attack_and_defence_are_chosen_apart(tmp_path):
    cells = load_cells(written(tmp_path, """
protocol: frames
attacks:
  - search: [recall, move_nodes]
    aware: [true, false]
    detector: [{}, {defences: geometric_check, geometric_inliers: 30}]
"""), {})
    assert len(cells) == 8
    assert {cell.detector for cell in cells} == {
        (), (('defences', 'geometric_check'), ('geometric_inliers', 30))}
    assert 'defences geometric_check, geometric_inliers 30, unaware' in {
        cell.variant for cell in cells}
    detector = detector_of(LcdConfig(min_gap_s=3.0), cells[1])
    assert (detector.geometric_inliers, detector.min_gap_s) == (30, 3.0)


def test_a_name_says_settings_of_the_attack(tmp_path):
    text = 'protocol: frames\nattacks: [{search: move_nodes, nodes_moved: [5, 9], name: %s}]'
    cells = load_cells(written(tmp_path, text % "'{nodes_moved} nodes'"), {})
    assert [cell.name for cell in cells] == ['5 nodes', '9 nodes']
    with pytest.raises(ConfigError, match='mode is no setting'):
        load_cells(written(tmp_path, text % "'in {mode}'"), {})


@pytest.mark.parametrize(('detector', 'said'), [
    ('{target: wl}', 'stand in the attack itself'), ('[1, 2]', 'settings by name'),
    ('{defences: moat}', 'no defence'), ('{gap: 1}', 'unknown setting')])
def test_a_wrong_detector_is_refused(tmp_path, detector, said):
    with pytest.raises(ConfigError, match=said):
        load_cells(written(tmp_path, f'protocol: frames\nattacks: [{{detector: {detector}}}]'), {})


def test_the_command_line_wins(tmp_path):
    text = 'protocol: frames\nattacks: [{ratio: [1e-4, 2e-4], nodes: 100}, {target: edges}]'
    cells = load_cells(written(tmp_path, text), {'ratio': 3e-4, 'nodes': 50, 'target': 'wl'})
    assert [(cell.attack.ratio, cell.nodes, cell.target) for cell in cells] == [(3e-4, 50, 'wl')]


def test_of_attacks_made_equal_by_the_command_line_the_first_counts():
    cells = load_cells('paper', {'nodes': 100, 'target': 'wl'}, ['tables', 'sizes'])
    usual, = (cell for cell in cells if cell.attack.surrogate == 'naive_bayes')
    assert {cell.frames for cell in cells if cell.asked_target == 'wl'} == {usual.frames}


@pytest.mark.parametrize(('text', 'said'), [
    ('protocol: frames\nattacks: [{epsilon: 1}]', 'unknown epsilon'),
    ('protocol: frames\nattacks: [{seed: 1}]', 'unknown seed'),
    ('protocol: frames\ncolour: red\nattacks: [{}]', 'unknown colour'),
    ('protocol: frames\ndefaults: [1]\nattacks: [{}]', 'NAME: VALUE'),
    ('protocol: frames\nattacks: [recall]', 'NAME: VALUE'),
    ('protocol: frames\nattacks: [{ratio: []}]', 'empty list'),
    ('protocol: frames\nattacks: [{ratio: much}]', r'mine\.yaml.*ratio'),
    ('protocol: frames\nattacks: [{perturbation: best}]', r'mine\.yaml.*perturbation'),
    ('protocol: frames\nattacks: [{perturbation: recall}]', 'write "search: recall" instead'),
    ('protocol: frames\nattacks: [{perturbation: [optimum]}]', 'write "search: optimum" instead'),
    ('attacks: [{name: a, search: optimum}]', 'protocol "live"'),
    ('protocol: frames\nattacks: [{oracle: loud}]', r'mine\.yaml.*oracle'),
    ('protocol: frames\nattacks: [{frames: 2}, {frames: 3}]', 'there twice'),
    ('protocol: frames\nseeds: 0\nattacks: [{}]', 'seeds'),
    ('protocol: dream\nattacks: [{}]', 'protocol'),
    ('attacks: [{name: a}]', 'protocol "live"'),
])
def test_a_wrong_recipe_is_refused(tmp_path, text, said):
    with pytest.raises(ConfigError, match=said):
        load_cells(written(tmp_path, text), {})


def test_parts_of_a_recipe_can_be_taken_alone(tmp_path):
    recipe = written(tmp_path, """
protocol: frames
attacks:
  - {part: mine, target: edges}
  - &yours {part: yours, surrogate: none}
  - {<<: *yours, search: recall}
  - {search: optimum}
""")
    assert [cell.method for cell in load_cells(recipe, {})] == [
        'eigencentrality', 'eigencentrality', 'recall', 'optimum']
    assert [cell.method for cell in load_cells(recipe, {}, ['yours'])] == [
        'eigencentrality', 'recall']
    assert [cell.target for cell in load_cells(recipe, {}, ['yours', 'mine'])] == [
        'edges', 'wl', 'wl']
    with pytest.raises(ConfigError, match='no part ours; there are: mine, yours'):
        load_cells(recipe, {}, ['ours'])


def test_a_part_of_the_paper_recipe_has_the_cells_that_the_whole_has():
    whole = [repr(cell) for cell in load_cells('paper', {})]
    parts = ('tables', 'answers', 'thresholds', 'transfer', 'targets', 'sizes', 'pairs', 'retry',
             'symbio', 'queries', 'surrogates', 'small', 'rivals')
    found = [repr(cell) for part in parts for cell in load_cells('paper', {}, [part])]
    assert set(found) == set(whole)
    pairs = load_cells('paper', {}, ['pairs'])
    assert {cell.judged for cell in pairs} == {'pairs'}
    assert {(cell.target, cell.attack.retry) for cell in pairs if cell.search == 'stepwise'} >= {
        ('wl', 'never'), ('wl', 'gained'), ('wl', 'set'), ('edges', 'gained')}


def test_a_recipe_of_frames_does_not_replay():
    with pytest.raises(ConfigError, match='protocol is "live"'):
        load_recipe('paper', {})


def test_sequences_may_have_labels_of_their_own(tmp_path):
    recipe = written(tmp_path, """
protocol: frames
labels: {desk: {rule: overlap, min_gap_s: 3}}
attacks: [{search: recall}]
""")
    desk = load_labels(recipe, {'min_gap_s': 4.0})['desk']
    assert (desk.rule, desk.min_gap_s) == ('overlap', 4.0)
    assert list(load_labels('paper', {})) == ['rgbd_dataset_freiburg3_long_office_household']
    for labels in ('[desk]', '{desk: overlap}', '{desk: {rule: guess}}'):
        with pytest.raises(ConfigError, match=r'mine\.yaml'):
            load_labels(written(tmp_path, f"""
protocol: frames
labels: {labels}
attacks: [{{search: recall}}]
"""), {})
