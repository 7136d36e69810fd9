# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Classes of a user's own, from a package outside the tree, through the commands as they are."""

import json
import os
from pathlib import Path
import re
import subprocess
import sys

import pytest
from walk_factory import walk_folder

from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.registry import PERTURBATIONS, SEARCHES, TARGETS

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / 'docs/extending.md').read_text(encoding='utf-8')
LAB = '\n\n'.join(re.findall(r'```python\n(.*?)```', PAGE, re.S))
RECIPE, = re.findall(r'```yaml\n(.*?)```', PAGE, re.S)
WRONG = '''
class Nothing(Search):
    """Gives up."""

    name = 'nothing'

    def hunt(self, hunt, rng):
        return 'gave up'


class Half(Search):
    name = 'half'


class Stranger:
    name = 'stranger'
'''


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """Return the folder of a package outside the tree that Python finds."""
    folder = tmp_path / 'elsewhere'
    (folder / 'lab').mkdir(parents=True)
    (folder / 'lab/__init__.py').write_text('')
    (folder / 'lab/mine.py').write_text(LAB + WRONG)
    (folder / 'lab/broken.py').write_text('import nonesuch\n')
    info = folder / 'lab-1.0.dist-info'
    info.mkdir()
    (info / 'METADATA').write_text('Metadata-Version: 2.1\nName: lab\nVersion: 1.0\n')
    (info / 'entry_points.txt').write_text(
        '[adversarial_lcd_ros.targets]\nclasses = lab.mine:Classes\n'
        '[adversarial_lcd_ros.searches]\nnothing = lab.mine:Nothing\n')
    monkeypatch.syspath_prepend(str(folder))
    yield folder
    for name in [name for name in sys.modules if name.split('.')[0] == 'lab']:
        del sys.modules[name]


@pytest.fixture
def command(tmp_path, lab, vocabulary):
    """Return a function that runs a command on a short walk, in processes of their own."""
    walk_folder(tmp_path / 'walk')
    settings = tmp_path / 'settings.yaml'
    settings.write_text(
        f'graph_builder: {{detector: none, vocabulary: {vocabulary}, detected_features: 60}}\n'
        'lcd: {min_gap_s: 0.1, map_window: 0}\n'
        'labels: {rule: distance, min_gap_s: 0.1}\n')

    def run(name, *more, cached=True):
        options = ['--config', str(settings)]
        if cached:
            options += ['--cache', str(tmp_path / 'cache'), '--jobs', '2']
        done = subprocess.run(
            [sys.executable, '-m', 'adversarial_lcd_ros.cli', name, str(tmp_path / 'walk'),
             *options, *map(str, more)], capture_output=True, text=True, timeout=400, check=False,
            env={**os.environ, 'PYTHONPATH': os.pathsep.join((str(lab), str(ROOT)))})
        assert done.returncode == 0, done.stderr
    return run


def summary(folder):
    return json.loads((folder / 'summary.json').read_text())


def rows_of(folder):
    return [json.loads(line) for line in (folder / 'cells.jsonl').read_text().splitlines()]


def test_a_target_is_trained_measured_behind_a_defence_and_attacked(tmp_path, command):
    models = tmp_path / 'models'
    command('train', '--output', models, '--targets', 'lab.mine:Classes', 'edges',
            '--flips-per-frame', '0', cached=False)
    assert (models / 'target_classes.json').is_file()

    for name, more in (('bare', ()), ('defended', ('--lcd-defences', 'lab.mine:DropsLongEdges'))):
        command('targets', '--targets', 'classes', 'lab.mine:Classes', '--models', models,
                '--nodes', '20', '--pairs', '5', '--draws', '1', '--output', tmp_path / name,
                *more)
    bare, defended = rows_of(tmp_path / 'bare'), rows_of(tmp_path / 'defended')
    assert {row['target'] for row in bare} == {'classes', 'lab.mine:Classes'}
    assert all(row['balanced_accuracy'] > 0.7 for row in bare)
    assert {row['defences'] for row in defended} == {'lab.mine:DropsLongEdges'}

    recipe = tmp_path / 'mine.yaml'
    recipe.write_text('protocol: frames\nseeds: 1\nframes: 2\n'
                      'defaults: {nodes: 20, ratio: 0.02, queries_per_edit: 2, target: edges}\n'
                      'attacks:\n'
                      '  - {perturbation: lab.mine:Degree, surrogate: lab.mine:Mean}\n'
                      '  - {perturbation: lab.mine:Degree, target: classes, surrogate: none}\n'
                      '  - search: [nothing, lab.mine:Climb, optimum]\n')
    losses = []
    for name, more in (('open', ()), ('shut', ('--lcd-defences', 'lab.mine:DropsLongEdges'))):
        command('evaluate', '--recipe', recipe, '--models', models, '--output', tmp_path / name,
                *more)
        rows = {row['search'] + row['perturbation'] + row['target']: row
                for row in rows_of(tmp_path / name)}
        assert set(rows) == {'stepwiselab.mine:Degreeedges', 'stepwiselab.mine:Degreeclasses',
                             'nothingedges', 'lab.mine:Climbedges', 'optimumedges'}
        assert rows['nothingedges']['surrogate'] == ''
        assert rows['nothingedges']['edits_mean'] == 0
        assert rows['lab.mine:Climbedges']['queries_mean'] > 0
        assert rows['stepwiselab.mine:Degreeedges']['edits_mean'] > 0
        losses.append([frame['loss_after'] for frame in rows['optimumedges']['frame_results']])
    assert losses[0] != losses[1]  # the yardstick sees the defence


def test_a_defence_gets_onto_the_leaderboard(tmp_path, command):
    recipe = tmp_path / 'mine.yaml'
    recipe.write_text(RECIPE.replace('defaults:\n', 'defaults:\n  nodes: 20\n'))
    command('evaluate', '--recipe', recipe, '--frames', '2', '--ratio', '0.02', '--max-queries',
            '8', '--output', tmp_path / 'rings')
    found = summary(tmp_path / 'rings')
    assert {row['defence'] for row in found['worst']} == {
        'none', 'length_check', 'lab.mine:DropsLongEdges'}
    attacks = {(row['attack'], row['defence']) for row in found['rows']}
    assert ('recall, unaware', 'lab.mine:DropsLongEdges') in attacks
    assert ('optimum', 'lab.mine:DropsLongEdges') in attacks
    assert 'lab.mine:DropsLongEdges' in (tmp_path / 'rings/report.html').read_text()


@pytest.mark.parametrize(('settings', 'said'), [
    ({'perturbation': 'lab.mine:Nonesuch'}, "'lab.mine' has no class 'Nonesuch'; there are: Deg"),
    ({'perturbation': 'lab.gone:Degree'}, "'lab.gone' cannot be imported"),
    ({'perturbation': 'lab.broken:Degree'}, "ModuleNotFoundError: No module named 'nonesuch'"),
    ({'perturbation': 'lab.mine:Stranger'}, 'expected a subclass of .*Perturbation'),
    ({'perturbation': 'lab.mine:Mean'}, 'expected a subclass of .*Perturbation'),
    ({'search': 'lab.mine:Half'}, 'search lab.mine:Half lacks hunt'),
    ({'search': 'optimum'}, 'recipes of the protocol "frames" alone'),
    ({'perturbation': 'recall'}, 'it is a search, write "search: recall" instead'),
    ({'search': 'nonesuch'}, 'there are: stepwise, recall, .*, nothing, or one of your own')])
def test_what_is_wrong_is_said_in_one_line(lab, settings, said):
    with pytest.raises(ConfigError, match=said) as caught:
        AttackConfig(**settings)
    assert '\n' not in str(caught.value)


def test_several_defences_are_each_looked_for(lab):
    LcdConfig(defences='lab.mine:DropsLongEdges, geometric_check')
    with pytest.raises(ConfigError, match=r'LcdConfig\.defences .*no defence'):
        LcdConfig(defences='geometric_check, nonesuch')


def test_an_entry_point_and_a_reference_are_one_class(lab):
    assert TARGETS.find('classes') is TARGETS.find('lab.mine:Classes')


@pytest.mark.parametrize('table', [TARGETS, SEARCHES, PERTURBATIONS])
def test_what_ships_is_what_its_table_says(table):
    assert [table.find(name).name for name in table] == list(table)


def test_the_page_says_how_much_each_took():
    """Lines of the class and of the imports that it uses; all of it is one file."""
    blocks = re.findall(r'```python\n(.*?)```', PAGE, re.S)
    imports = [line for line in blocks[0].splitlines() if line]
    took = {}
    for block in blocks[1:]:
        used = [line for line in imports if re.search(rf'\b{line.split()[-1]}\b(?!=)', block)]
        took[re.search(r'class (\w+)', block)[1]] = len(
            used + [line for line in block.splitlines() if line])
    table = re.findall(r'^\| (\w+), a \w+ \| (\d+) \| 1 \| 0 \|$', PAGE, re.M)
    assert {name: int(lines) for name, lines in table} == took


def test_commands_of_the_page_name_its_classes_and_known_options():
    named = set(re.findall(r'lab\.mine:(\w+)', PAGE))
    assert named == {'Degree', 'Mean', 'Climb', 'Classes', 'DropsLongEdges'}
    assert named <= set(re.findall(r'^class (\w+)', LAB, re.M))
    done = subprocess.run([sys.executable, '-m', 'adversarial_lcd_ros.cli', 'evaluate', '--help'],
                          capture_output=True, text=True, cwd=ROOT, check=True)
    for option in re.findall(r'evaluate bags/flat_tour (--[\w-]+)', PAGE):
        assert option in done.stdout
