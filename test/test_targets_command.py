# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command "targets": figures of detectors before any attack."""

import json

import pytest
from walk_factory import command_on_a_walk

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.evaluation.detectors.defended import defended_table
from adversarial_lcd_ros.evaluation.detectors.recipe import Choices, recipe_sequences
from adversarial_lcd_ros.evaluation.detectors.tables import target_tables
from adversarial_lcd_ros.evaluation.wording import points
from adversarial_lcd_ros.paths import model_path
from adversarial_lcd_ros.training.model_folder import trained_on

NOTHING = Choices({}, {}, {})


@pytest.fixture
def command(tmp_path, vocabulary, monkeypatch):
    """Return a function that runs the command on a short walk, in this process."""
    return command_on_a_walk('targets', tmp_path, vocabulary, monkeypatch, nodes=20, pairs=5,
                             draws=2)


def test_every_target_gets_a_row_for_each_protocol(tmp_path, command, capsys, monkeypatch):
    monkeypatch.setenv('COLUMNS', '80')
    assert command('--targets', 'edges', 'vbow') == 0
    rows = json.loads((tmp_path / 'out' / 'summary.json').read_text())['rows']
    assert [(row['protocol'], row['target']) for row in rows] == [
        ('pairs', 'edges'), ('pairs', 'vbow'), ('live', 'edges'), ('live', 'vbow')]
    pairs, live = rows[0], rows[2]
    assert (pairs['n_pairs'], pairs['positives'], pairs['seeds']) == (20, 10, 2)
    assert (live['n_frames'], live['positives'], live['negatives']) == (12, 6, 2)
    assert pairs['distinct_pairs'] <= pairs['n_pairs']
    assert (pairs['labels']['rule'], pairs['labels']['min_gap_s']) == ('distance', 0.1)
    # Each place is seen twice in nearly the same picture: matching cannot miss that.
    assert pairs['average_precision'] == pytest.approx(1)
    low, high = pairs['ci95']
    assert 0 <= low <= pairs['balanced_accuracy'] <= high <= 1
    line = (tmp_path / 'out' / 'target.md').read_text().splitlines()[2]
    assert line.startswith('| walk, min_gap_s 0.1, map_window 0, detected_features 60, detector '
                           'none; labels by poses alone (rule distance, min_gap_s 0.1) | 20 |')
    # Few pairs, drawn twice, do not look like many.
    assert f'| 20 (10 loops), {pairs["distinct_pairs"]} different |' in line
    printed = capsys.readouterr().out.splitlines()
    assert [text.split()[:2] for text in printed if text.startswith(('edges', 'vbow'))] == [
        ['edges', 'walk'], ['vbow', 'walk']] * 2
    assert max(map(len, printed[:-1])) <= 80


def test_each_target_gets_the_graphs_that_it_needs(tmp_path, command):
    assert command('--targets', 'wl', 'symbio', '--protocols', 'pairs') == 0
    rows = json.loads((tmp_path / 'out' / 'summary.json').read_text())['rows']
    sizes = {row['target']: row['nodes_mean'] for row in rows}
    assert sizes['symbio'] == sizes['wl'] + 1  # no objects here, but the scene


def test_rows_that_are_there_are_not_made_again(tmp_path, command, capsys):
    assert command('--targets', 'vbow') == 0
    before = (tmp_path / 'out' / 'cells.jsonl').read_bytes()
    assert command('--targets', 'vbow', '--protocols', 'live') == 0
    assert '0 of 1 rows to make' in capsys.readouterr().err
    assert (tmp_path / 'out' / 'cells.jsonl').read_bytes() == before


@pytest.mark.parametrize('protocol', ['pairs', 'live'])
def test_rows_of_other_labels_are_not_taken_for_these(command, capsys, protocol):
    # Less in common to be another place: no frame of a replay is labelled otherwise, pairs are.
    for overlap in ('0.1', '0.05'):
        assert command('--targets', 'vbow', '--protocols', protocol, '--label-rule', 'overlap',
                       '--label-negative-overlap', overlap) == 0
        assert '1 of 1 rows to make' in capsys.readouterr().err


def test_a_row_behind_the_geometric_check_says_so(tmp_path, command, capsys, monkeypatch):
    monkeypatch.setenv('COLUMNS', '120')
    # More matches are asked for than there are features: nothing passes.
    assert command('--targets', 'edges', '--lcd-geometric-check',
                   '--lcd-geometric-inliers', '21') == 0
    rows = json.loads((tmp_path / 'out' / 'summary.json').read_text())['rows']
    assert [row['geometric_check'] for row in rows] == [True, True]
    assert [row['recall'] for row in rows] == [0, 0]
    assert '| walk, geometric check, ' in (tmp_path / 'out' / 'target.md').read_text()
    assert 'edges, geometric check  walk' in capsys.readouterr().out


def test_pairs_and_live_are_judged_behind_a_defence(tmp_path, command, capsys, monkeypatch):
    monkeypatch.setenv('COLUMNS', '120')
    assert command('--targets', 'edges', '--lcd-defences', 'own_defences:IgnoresEdges') == 0
    rows = json.loads((tmp_path / 'out' / 'summary.json').read_text())['rows']
    assert [row['defences'] for row in rows] == ['own_defences:IgnoresEdges'] * 2
    assert [row['recall'] for row in rows] == [0, 0]
    assert '| walk, own_defences:IgnoresEdges, ' in (tmp_path / 'out' / 'target.md').read_text()
    assert 'edges, own_defences:IgnoresEdges  walk' in capsys.readouterr().out


def test_defences_are_laid_beside_the_detector_without(tmp_path, command, capsys, monkeypatch):
    monkeypatch.setenv('COLUMNS', '120')
    assert command('--targets', 'edges', '--protocols', 'live', '--lcd-geometric-inliers', '21',
                   '--defences', 'none', 'rederive_check', 'geometric_check') == 0
    rows = json.loads((tmp_path / 'out' / 'summary.json').read_text())['rows']
    assert [row['defences'] for row in rows] == ['none', 'rederive_check', 'geometric_check']
    # What only counts changes nothing; more matches are asked for than there are: nothing passes.
    assert rows[0]['outcomes'] == rows[1]['outcomes']
    assert rows[0]['recall'] > 0 == rows[2]['recall']
    found = rows[0]['outcomes'].split(',').count('TP')
    table = (tmp_path / 'out' / 'target.md').read_text().split('| defence |')[1].splitlines()[2:5]
    assert 'edges, rederive_check' in capsys.readouterr().out
    cells = [[cell.strip() for cell in line.strip('|').split('|')] for line in table]
    assert [line[2] for line in cells] == ['none', 'rederive_check', 'geometric_check']
    assert [line[5].split(' (')[0] for line in cells] == ['', '0.0', points(
        100 * (rows[0]['balanced_accuracy'] - rows[2]['balanced_accuracy']))]
    assert [line[8].split(' (')[0] for line in cells] == [
        f'{found} of {found}', f'{found} of {found}', f'0 of {found}']


def outcome_row(defences, outcomes, changed=''):
    outcomes = outcomes.split()
    return {'sequence': 'tour', 'target': 'wl', 'protocol': 'live', 'nodes': 300,
            'defences': defences, 'geometric_check': False, 'changed': changed, 'positives': 4,
            'negatives': 2, 'balanced_accuracy': (outcomes.count('TP') / 4
                                                  + outcomes.count('TN') / 2) / 2,
            'ci95': None, 'precision': None, 'recall': None, 'block': 1,
            'outcomes': ','.join(outcomes)}


def test_true_loops_are_kept_frame_by_frame():
    table, = defended_table([
        outcome_row('none', 'TP TP TP FN TN FP'),
        outcome_row('geometric_check', 'TP TP FN FN TN TN'),
        # One of those past the check is lost; one that had never been found does not count.
        outcome_row('geometric_check', 'TP FN FN TP TN TN', 'geometric_hull 0.1')])
    without, check, hull = ([cell.strip() for cell in line.strip('|').split('|')]
                            for line in table.splitlines()[2:])
    assert [line[5].split(' (')[0] for line in (without, check, hull)] == ['', '-12.5', '-12.5']
    assert (without[8][:6], check[8][:6], hull[8][:6]) == ('3 of 3', '2 of 3', '1 of 3')
    assert (without[9], check[9], hull[9][:6]) == ('', '', '1 of 2')
    assert hull[2] == 'geometric_check, geometric_hull 0.1'
    assert defended_table([outcome_row('none', 'TP TP TP FN TN FP')]) == []


def test_live_and_pairs_see_the_threshold(tmp_path, command):
    assert command('--targets', 'edges', '--lcd-threshold', '0') == 0
    for row in json.loads((tmp_path / 'out' / 'summary.json').read_text())['rows']:
        assert row['recall'] == 1
        assert row['balanced_accuracy'] == 0.5


@pytest.mark.parametrize(('options', 'said'), [
    (('--recipe', 'target'), 'either sequences or --recipe'),
    (('--lcd-target', 'wl'), '--targets'),
    (('--pairs', '0'), '--pairs 0: expected 1 or more')])
def test_wrong_options_are_refused_in_one_line(command, capsys, options, said):
    assert command(*options) == 2
    assert said in capsys.readouterr().err


def write(path, setting):
    path.write_text(f'sequences:\n  - source: a\n    {setting}\n')
    return str(path)


def test_a_recipe_gives_each_sequence_its_settings(tmp_path):
    one, two = tmp_path / 'one.yaml', tmp_path / 'two.yaml'
    one.write_text('sequences:\n  - {source: a@0.5:1, nodes: [100, 300], lcd: {min_gap_s: 3}}\n'
                   '  - {source: b, targets: [vbow]}\n')
    first, second = recipe_sequences(str(one), tmp_path, Choices({}, {'candidates': 3}, {}))
    assert first.source == str(tmp_path / 'a@0.5:1')
    assert (first.nodes, first.lcd.min_gap_s, first.lcd.candidates) == ((100, 300), 3.0, 3)
    assert (second.targets, second.nodes, second.lcd.min_gap_s) == (('vbow',), (300,), 8.0)
    third, = recipe_sequences(write(two, 'detectors: [{}, {defences: length_check}]'), tmp_path,
                              Choices({}, {'threshold': 0.9}, {}))
    assert [(lcd.defences, lcd.threshold) for lcd in third.detectors] == [
        ('none', 0.9), ('length_check', 0.9)]
    with pytest.raises(ConfigError, match='expected a list of settings of the detector'):
        recipe_sequences(write(two, 'detectors: length_check'), tmp_path, NOTHING)
    two.write_text('sequences:\n  - {source: b, target: vbow}\n')
    with pytest.raises(ConfigError, match=r'unknown key target.*; there are: source'):
        recipe_sequences(str(two), tmp_path, NOTHING)
    with pytest.raises(ConfigError, match='there is no folder'):
        recipe_sequences('target', tmp_path / 'nowhere', NOTHING)


def test_the_recipes_that_ship_are_some(tmp_path):
    sequences = recipe_sequences('target', tmp_path, NOTHING)
    assert len({sequence.source for sequence in sequences}) == len(sequences) == 7
    sequences = recipe_sequences('defences', tmp_path, NOTHING)
    assert {len(sequence.detectors) for sequence in sequences} == {7}


SHIPPED = model_path('target_wl.json')


@pytest.mark.parametrize(('source', 'seen'), [
    ('x/flat_train', True), ('x/flat_tour', False), ('rgbd_dataset_freiburg1_rpy', True),
    ('rgbd_dataset_freiburg1_rpy@0.5:1', False), ('rgbd_dataset_freiburg1_rpy@0.4:1', True)])
def test_the_card_tells_what_was_trained_on(source, seen):
    assert trained_on(SHIPPED, source) is seen


def test_without_a_card_nobody_knows(tmp_path):
    assert trained_on(tmp_path / 'target_wl.json', 'x/flat_train') is None


def test_a_map_may_be_trained_on_where_the_queries_are_not():
    source = 'rgbd_dataset_freiburg1_rpy'
    assert not trained_on(SHIPPED, source, (0.5, 1))
    assert trained_on(SHIPPED, source, (0, 1))
    row = {'sequence': source, 'target': 'wl', 'protocol': 'pairs', 'nodes': 300,
           'nodes_mean': 305.0, 'scored': [0.5, 1], 'trained_on': False,
           'references_trained_on': True, 'geometric_check': False, 'n_pairs': 0,
           'ci95': None, **dict.fromkeys(('positives', 'balanced_accuracy', 'average_precision',
                                          'recall_at_100_precision', 'mcc'))}
    line = target_tables([row]).splitlines()[2]
    assert line.startswith(f'| {source}, scored from 0.5 to 1 (references seen in training) |')
    assert '| 0 (0 loops) | - | - | - | - | - |' in line


def test_json_is_all_that_goes_to_standard_output(tmp_path, command, capsys):
    assert command('--targets', 'vbow', '--json') == 0
    found = json.loads(capsys.readouterr().out)
    assert found == {'folder': str(tmp_path / 'out'),
                     **json.loads((tmp_path / 'out' / 'summary.json').read_text())}
    assert [row['target'] for row in found['rows']] == ['vbow', 'vbow']
    assert main(['report', str(tmp_path / 'out')]) == 0


def test_a_training_without_the_target_is_told_by_what_it_has(tmp_path, command, capsys):
    (tmp_path / 'models').mkdir()
    (tmp_path / 'models' / 'target_edges.json').write_text('{}')
    assert command('--targets', 'wl', '--lcd-model', str(tmp_path / 'models')) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert 'no decision for the target wl; those trained there: edges' in said
