# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command "evaluate" with a recipe of the protocol "frames"."""

from contextlib import contextmanager
import json

import pytest
from walk_factory import RECIPE, walk_folder

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.evaluation import workers


@pytest.fixture
def command(tmp_path, vocabulary, lcd_model, monkeypatch):
    """Return a function that runs the command on a short walk, in this process."""
    @contextmanager
    def one_process(jobs):
        yield map
    monkeypatch.setattr(workers, 'local_workers', one_process)
    walk_folder(tmp_path / 'walk')
    (tmp_path / 'mine.yaml').write_text(RECIPE)
    settings = {
        'recipe': tmp_path / 'mine.yaml', 'cache': tmp_path / 'cache',
        'output': tmp_path / 'out', 'builder-detector': 'none', 'builder-vocabulary': vocabulary,
        'builder-detected-features': 60, 'lcd-model': lcd_model, 'lcd-min-gap-s': 0.1,
        'lcd-map-window': 0, 'label-rule': 'distance', 'label-min-gap-s': 0.1}

    def run(*more, sources=('walk',)):
        options = [text for name, value in settings.items() for text in (f'--{name}', str(value))]
        return main(['evaluate', *(str(tmp_path / source) for source in sources), *options,
                     *more])
    return run


def test_it_announces_runs_reports_and_goes_on(tmp_path, command, capsys):
    assert command('--seeds', '1') == 0
    said = capsys.readouterr()
    assert 'walk: 6 frames with a loop, 2 at new places, of 12' in said.err
    assert '5 of 5 cells to run' in said.err
    assert str(tmp_path / 'out' / 'report.html') in said.out
    assert 'random_flip, none, query' in said.out
    summary = json.loads((tmp_path / 'out' / 'summary.json').read_text())['rows']
    assert [entry['seeds'] for entry in summary] == [1] * 5
    assert {'sequence', 'target', 'perturbation', 'surrogate', 'oracle', 'mode', 'ratio',
            'nodes_mean', 'accuracy_clean', 'accuracy_attacked', 'decline_pp', 'ci95',
            'share_of_optimum', 'edits_mean', 'queries_mean'} <= set(summary[0])
    setup = json.loads((tmp_path / 'out' / 'configuration.json').read_text())
    assert (setup['sequences'][0]['name'], len(setup['cells'])) == ('walk', 5)
    releases = {json.loads(line)['versions']
                for line in (tmp_path / 'out' / 'cells.jsonl').read_text().splitlines()}
    assert [path.name for path in (tmp_path / 'out').glob('environment-*')] == [
        f'environment-{release}.json' for release in releases]

    assert command() == 0
    assert '5 of 10 cells to run' in capsys.readouterr().err
    assert command() == 0
    assert 'all 10 cells are finished' in capsys.readouterr().err


def test_the_command_line_says_how_many_frames(tmp_path, command, capsys):
    assert command('--search', 'optimum', '--seeds', '1', '--frames', '1') == 0
    entry, = json.loads((tmp_path / 'out' / 'summary.json').read_text())['rows']
    assert entry['frames'] == 2
    assert command('--frames', '0') == 2
    assert '--frames' in capsys.readouterr().err


def test_settings_of_the_command_line_win(tmp_path, command):
    assert command('--search', 'optimum', '--builder-features', '12', '--seeds', '1') == 0
    entry, = json.loads((tmp_path / 'out' / 'summary.json').read_text())['rows']
    assert (entry['search'], entry['nodes'], entry['nodes_mean']) == ('optimum', 12, 12)
    assert (entry['perturbation'], entry['surrogate']) == ('', '')


def test_cells_of_other_settings_are_kept_and_not_reported(tmp_path, command, capsys):
    for candidates in ('5', '4'):
        assert command('--search', 'optimum', '--seeds', '1', '--lcd-candidates',
                       candidates) == 0
    assert 'models or code: 1;' in capsys.readouterr().err
    assert len((tmp_path / 'out' / 'cells.jsonl').read_text().splitlines()) == 2
    entry, = json.loads((tmp_path / 'out' / 'summary.json').read_text())['rows']
    assert entry['seeds'] == 1


def test_an_interruption_says_that_nothing_is_lost(tmp_path, command, capsys, monkeypatch):
    def interrupted(function, tasks):
        yield function(tasks[0])
        raise KeyboardInterrupt

    @contextmanager
    def one_process(jobs):
        yield interrupted
    monkeypatch.setattr(workers, 'local_workers', one_process)
    assert command() == 130
    assert '5 cells are in' in capsys.readouterr().err


@pytest.mark.parametrize(('more', 'said'), [
    (['--rebuild'], '--rebuild'), (['--keep-recordings'], '--keep-recordings'),
    (['--replay-stride', '2'], 'nothing is replayed'), (['--seed', '1'], '--seeds'),
    (['--jobs', '0'], 'expected 1 or more'), (['--seeds', '0'], 'expected 1 or more'),
    (['--jobs', '1', '--scheduler', 'tcp://127.0.0.1:9'], 'one of them')])
def test_options_that_do_not_fit_are_refused(command, capsys, more, said):
    assert command(*more) == 2
    assert said in capsys.readouterr().err


def test_two_sequences_of_one_name_are_refused(tmp_path, command, capsys):
    walk_folder(tmp_path / 'other' / 'walk')
    assert command(sources=('walk', 'other/walk')) == 2
    assert 'two sequences are called walk' in capsys.readouterr().err


def test_a_sequence_without_ground_truth_is_refused(tmp_path, command, capsys):
    (tmp_path / 'walk' / 'groundtruth.txt').unlink()
    assert command() == 2
    assert 'no ground truth' in capsys.readouterr().err


def test_wrong_posters_are_told_before_a_sequence_is_looked_at(tmp_path, capsys):
    recipe = tmp_path / 'rings.yaml'
    recipe.write_text('{protocol: rings, attacks: [{search: recall}], posters: {pairs: 0}}')
    assert main(['evaluate', str(tmp_path / 'none'), '--recipe', str(recipe), '--output',
                 str(tmp_path / 'out')]) == 2
    assert 'posters: PosterConfig.pairs = 0: expected 1' in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize(('arguments', 'said'), [
    (['a', 'b'], 'replays one bag, found 2'), (['a', '--jobs', '2'], '--jobs'),
    (['a', '--seeds', '2'], '--seeds'), (['a', '--scheduler', 'tcp://x:1'], '--scheduler')])
def test_a_recipe_that_replays_has_no_such_options(capsys, arguments, said):
    assert main(['evaluate', *arguments]) == 2
    assert said in capsys.readouterr().err


def test_json_is_all_that_goes_to_standard_output(tmp_path, command, capsys):
    assert command('--perturbation', 'random_flip', '--seeds', '1', '--json') == 0
    found = json.loads(capsys.readouterr().out)
    assert found == {'folder': str(tmp_path / 'out'),
                     **json.loads((tmp_path / 'out' / 'summary.json').read_text())}
    assert found['kind'] == 'frames'


def test_the_report_of_the_folder_is_made_anew_from_its_cells(tmp_path, command, capsys):
    assert command('--seeds', '1') == 0
    report = tmp_path / 'out' / 'report.html'
    before = report.read_bytes()
    report.unlink()
    assert main(['report', str(tmp_path / 'out')]) == 0
    assert report.read_bytes() == before
    assert main(['inspect', str(tmp_path / 'out')]) == 0
    assert 'Decline in balanced accuracy on walk' in capsys.readouterr().out


RINGS = """
protocol: rings
seeds: 1
frames: 2
defaults: {nodes: 30, surrogate: none, target: wl}
attacks:
  - search: [recall, move_nodes, replay]
    ratio: 0.01
    detector: [{}, {defences: rederive}]
  - {search: replay, sealed: true, aware: [true, false]}
posters:
  pairs: 2
  shares: [0.1, 0.3]
  kinds: [cells, noise]
  targets: [wl]
  checks: {check: {defences: geometric_check}}
"""


def test_the_rings_are_run_reported_and_gone_on_with(tmp_path, command, capsys):
    (tmp_path / 'mine.yaml').write_text(RINGS)
    assert command() == 0
    page = (tmp_path / 'out' / 'rings.md').read_text()
    assert str(tmp_path / 'out' / 'rings.md') in capsys.readouterr().out
    summary = json.loads((tmp_path / 'out' / 'summary.json').read_text())
    assert summary['kind'] == 'rings'
    assert {(row['search'], row['defence']) for row in summary['rows']} == {
        *((search, defence) for search in ('recall', 'move_nodes', 'replay')
          for defence in ('none', 'rederive')), ('replay', 'sealed graphs')}
    # Edges that are made again cannot be attacked.
    assert all(row['decline_pp'] == 0 for row in summary['rows']
               if (row['search'], row['defence']) == ('recall', 'rederive'))
    # No poster, two sizes, another texture, two posters, a control; a check or none.
    assert len(summary['posters']) == 6 * 2
    assert {row['pairs'] for row in summary['posters']} == {2}
    assert {(entry['target'], entry['defence']) for entry in summary['prices']} == {
        ('wl', 'none'), ('wl', 'rederive'), ('wl', 'sealed graphs')}
    # What is refused decides nothing, so that no loop is invented.
    refused = [row for row in summary['rows'] if row['refused']]
    assert [row['attack'] for row in refused] == ['replay, unaware']
    assert refused[0]['invented'] == 0
    assert '### Target wl' in page
    assert 'detector wl' in (tmp_path / 'out' / 'report.html').read_text()
    assert main(['report', str(tmp_path / 'out')]) == 0
    assert (tmp_path / 'out' / 'rings.md').read_text() == page
    hung = (tmp_path / 'out' / 'posters.json').read_bytes()
    assert command() == 0
    assert (tmp_path / 'out' / 'posters.json').read_bytes() == hung
