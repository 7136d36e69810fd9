# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command "certify": which decisions of a sequence no few flips can turn over."""

import json

import pytest
from walk_factory import command_on_a_walk

from adversarial_lcd_ros.evaluation.certificates.page import certificates_page, draw_certificates


@pytest.fixture
def command(tmp_path, vocabulary, monkeypatch):
    """Return a function that runs the command on a short walk, in this process."""
    return command_on_a_walk('certify', tmp_path, vocabulary, monkeypatch, budget=5,
                             **{'builder-features': 20})


def test_a_row_for_each_detector_with_a_share_that_falls(tmp_path, command, capsys, monkeypatch):
    monkeypatch.setenv('COLUMNS', '80')
    assert command('--targets', 'edges', 'vbow', '--defences', 'none', 'rederive') == 0
    rows = json.loads((tmp_path / 'out' / 'summary.json').read_text())['rows']
    assert [(row['target'], row['defences']) for row in rows] == [
        ('edges', 'none'), ('edges', 'rederive'), ('vbow', 'none'), ('vbow', 'rederive')]
    for row in rows:
        loops = row['classes']['loops']
        assert loops['frames'] == 6
        assert len(loops['certified']) == 6
        assert loops['certified'] == sorted(loops['certified'], reverse=True)
        assert loops['certified'][0] <= loops['right'] <= loops['frames']
        accuracy = row['accuracy']
        assert accuracy == [(one / 2 + other / 6) / 2 for one, other in zip(
            row['classes']['new places']['certified'], loops['certified'], strict=True)]
        assert row['ci95'][0] <= accuracy[-1] <= row['ci95'][1]
    # What edges cannot reach stands whatever the number of flips.
    assert all(len(set(row['classes']['loops']['certified'])) == 1 for row in rows[1:])
    page = (tmp_path / 'out' / 'certificates.md').read_text()
    assert sum(line.startswith('|') for line in page.splitlines()) == 2 + 2 * 4 + 2 + 4
    printed = capsys.readouterr().out.splitlines()
    assert [line.split('  ')[0].strip() for line in printed[2:6]] == [
        'edges', 'edges, rederive', 'vbow', 'vbow, rederive']
    assert max(map(len, printed[:-1])) <= 80
    assert '| walk | poses alone | `edges, rederive' in page
    assert (tmp_path / 'out' / 'certificates.svg').read_bytes().startswith(b'<?xml')


def test_frames_are_spread_over_the_sequence(tmp_path, command):
    assert command('--targets', 'edges', '--defences', 'none', '--frames', '2') == 0
    row, = json.loads((tmp_path / 'out' / 'summary.json').read_text())['rows']
    assert [row['classes'][name]['frames'] for name in ('new places', 'loops')] == [2, 2]


def test_each_target_gets_the_graphs_that_it_needs(tmp_path, command):
    assert command('--targets', 'symbio', 'edges', '--defences', 'none', '--frames', '2') == 0
    rows = json.loads((tmp_path / 'out' / 'summary.json').read_text())['rows']
    # No objects here, but the scene.
    assert [(row['target'], row['nodes']) for row in rows] == [('symbio', 21), ('edges', 20)]


def test_frames_that_are_there_are_not_certified_again(tmp_path, command, capsys):
    options = '--targets', 'edges', '--defences', 'none'
    assert command(*options) == 0
    assert '8 of 8 certificates to make' in capsys.readouterr().err
    cells = (tmp_path / 'out' / 'cells.jsonl').read_bytes()
    page = (tmp_path / 'out' / 'certificates.md').read_bytes()
    assert command(*options) == 0
    assert '0 of 8 certificates to make' in capsys.readouterr().err
    assert (tmp_path / 'out' / 'cells.jsonl').read_bytes() == cells
    assert (tmp_path / 'out' / 'certificates.md').read_bytes() == page
    # Another line is another detector.
    assert command(*options, '--lcd-threshold', '0.9') == 0
    assert '8 of 8 certificates to make' in capsys.readouterr().err


@pytest.mark.parametrize(('options', 'error'), [
    (('--targets', 'anchored'), 'nothing is proven of target anchored'),
    (('--targets', 'edges', '--defences', 'own_defences:DropsLongEdges'),
     'nothing is proven of a defence that makes other edges of a graph'),
    (('--budget', '0'), '--budget 0: expected 1 or more'),
    (('--lcd-target', 'wl'), 'here --targets says which')])
def test_what_cannot_be_certified_is_said_at_once(command, capsys, options, error):
    assert command(*options) == 2
    assert error in capsys.readouterr().err


def test_the_page_says_what_made_it_and_not_where():
    rows = [{'sequence': 'tour', 'target': 'wl', 'defences': 'none', 'changed': '',
             'told_by': 'audit', 'nodes': 300.0, 'budget': 1, 'certify_ms': 9.0,
             'accuracy': [1.0, 0.5], 'ci95': None,
             'classes': {'new places': {'frames': 2, 'right': 2, 'certified': [2, 1]},
                         'loops': {'frames': 0, 'right': 0, 'certified': [0, 0]}}}]
    page = certificates_page(rows, ['/bin/adversarial-lcd', 'certify', '/data/tour', '--jobs', '2',
                                    '--output', '/tmp/x', '--targets', 'wl'])
    assert page.startswith('Made by `adversarial-lcd certify tour --targets wl`.')
    assert '| tour | audit | `wl` | new places | 2 | 2 | 1 (50' in page
    assert '| tour | audit | `wl` | loops | 0 | 0 | n/a |' in page
    assert draw_certificates(rows).startswith(b'<?xml')
