# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results folders of every kind: report, inspect and compare; what is damaged is said."""

from functools import partial
import json
import xml.etree.ElementTree

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
import pytest
from results_factory import (
    KINDS,
    MAKERS,
    certificates_folder,
    frames,
    labels_folder,
    map_folder,
    replay,
    rings_folder,
    targets_folder,
)

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.config import LabelConfig, LcdConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.comparison import compare
from adversarial_lcd_ros.evaluation.kinds import KINDS as KNOWN
from adversarial_lcd_ros.evaluation.kinds import open_results
from adversarial_lcd_ros.evaluation.replay.summary import as_document, from_document

CHANGED = {'replay': partial(replay, found=range(33, 60)), 'frames': partial(frames, power=0.6),
           'targets': partial(targets_folder, accuracy=0.5),
           'labels': partial(labels_folder, positive=10), 'map': partial(map_folder, off_m=2.0),
           'rings': partial(rings_folder, lost=4),
           'certificates': partial(certificates_folder, held=2)}
REPORT = {**dict.fromkeys(KINDS, 'report.html'), 'targets': 'target.md', 'rings': 'rings.md',
          'certificates': 'certificates.md'}
every_kind = pytest.mark.parametrize('kind', KINDS)


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_every_kind_is_tested():
    assert set(KNOWN) == set(KINDS)


@every_kind
def test_a_folder_follows_the_contract(tmp_path, kind):
    folder = MAKERS[kind](tmp_path / 'a')
    document = json.loads((folder / 'summary.json').read_text())
    assert (document['kind'], document['schema']) == (kind, KNOWN[kind].schema)
    assert document['rows']
    assert json.loads((folder / 'environment.json').read_text())['code']
    assert open_results(folder)[0].name == kind


@every_kind
def test_report_makes_it_anew(tmp_path, capsys, kind):
    folder = MAKERS[kind](tmp_path / 'a')
    report = folder / REPORT[kind]
    before = report.read_bytes() if report.exists() else None
    report.unlink(missing_ok=True)
    assert main(['report', str(folder)]) == 0
    assert capsys.readouterr().out == f'{report}\n'
    assert before in (None, report.read_bytes())


def test_a_report_is_of_the_cells_of_its_summary(tmp_path):
    folder = frames(tmp_path / 'a')
    before = (folder / 'summary.json').read_bytes()
    assert main(['report', str(folder)]) == 0
    assert (folder / 'summary.json').read_bytes() == before
    (folder / 'cells.jsonl').write_text('')
    with pytest.raises(EvaluationError, match='4 cells that are not in'):
        KNOWN['frames'].report(open_results(folder)[1])


@every_kind
def test_inspect_shows_what_is_in_it(tmp_path, capsys, kind):
    folder = MAKERS[kind](tmp_path / 'a')
    assert main(['inspect', str(folder)]) == 0
    said = capsys.readouterr().out
    assert f'results of the kind "{kind}"' in said
    assert {'labels': '700', 'map': 'Absolute error'}.get(kind, 'balanced') in said
    assert main(['inspect', str(folder), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['rows'] == json.loads((folder / 'summary.json').read_text())['rows']
    assert {'configuration', 'environment', 'folder', 'kind', 'schema'} <= set(found)


@every_kind
def test_a_run_is_like_itself(tmp_path, kind):
    folders = [MAKERS[kind](tmp_path / name) for name in 'ab']
    found = compare(folders)
    assert found.figures
    assert not any(line.changed for line in found.figures)
    assert (found.settings, found.versions, found.warnings) == ((), (), ())


@every_kind
def test_compare_tells_what_changed(tmp_path, capsys, kind):
    folders = [MAKERS[kind](tmp_path / 'a'), CHANGED[kind](tmp_path / 'b')]
    assert main(['compare', *map(str, folders), '--json']) == 0
    said = capsys.readouterr()
    found = json.loads(said.out)
    assert (found['kind'], found['runs'], found['warnings']) == (kind, [*map(str, folders)], [])
    main_figures = [line for line in found['figures'] if line['figure'] == found['main']]
    assert any(line['differences'][1] for line in main_figures)
    for line in main_figures:
        first, second = line['values']
        assert line['differences'] == [0, second - first]
    assert main(['compare', *map(str, folders)]) == 0
    said = capsys.readouterr().out
    assert 'Figures that changed' in said
    assert 'Settings are the same' in said
    xml.etree.ElementTree.parse(tmp_path / 'results' / 'comparison.svg')


def test_a_report_tells_what_differs_elsewhere(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    first, second = replay(tmp_path / 'a'), replay(tmp_path / 'b', found=range(40, 60))
    assert main(['compare', str(first), str(second)]) == 0
    compared = capsys.readouterr().out
    assert main(['report', str(first), '--compare', str(second)]) == 0
    assert capsys.readouterr().out == f'{first / "report.html"}\n{compared}'


def test_figures_of_a_comparison_are_those_of_the_runs(tmp_path):
    found = compare([targets_folder(tmp_path / 'a'), targets_folder(tmp_path / 'b', accuracy=0.5)])
    line = found.figures[0]
    assert [figure.value for figure in line.figures] == [75, 50]
    assert line.figures[0].interval == (50, 87.5)
    assert (line.difference(1), line.unit) == (-25, '%')
    undefined = next(line for line in found.figures if line.name.startswith('recall at'))
    assert (undefined.difference(1), undefined.changed) == (None, False)


@every_kind
@pytest.mark.parametrize(('what', 'change'), [
    ('labels', {'labels': LabelConfig(rule='distance')}),
    ('thresholds', {'lcd': LcdConfig(threshold=0.9)})])
def test_compare_warns_of_other_conditions(tmp_path, capsys, kind, what, change):
    if (kind, what) == ('labels', 'thresholds'):
        pytest.skip('labels are there before any detector')
    folders = [MAKERS[kind](tmp_path / 'a'), MAKERS[kind](tmp_path / 'b', **change)]
    assert main(['compare', *map(str, folders)]) == 0
    assert f'warning: the runs differ in their {what}' in capsys.readouterr().err


def test_compare_warns_of_other_sequences(tmp_path, capsys):
    folders = [frames(tmp_path / 'a'), frames(tmp_path / 'b', sequences=('tour',))]
    assert main(['compare', *map(str, folders)]) == 0
    said = capsys.readouterr()
    assert 'warning: the runs differ in their sequences' in said.err
    assert 'not there' in said.out


def test_three_runs_are_compared_with_the_first(tmp_path):
    found = compare([targets_folder(tmp_path / str(accuracy), accuracy=accuracy)
                     for accuracy in (0.5, 0.75, 0.25)])
    assert [found.figures[0].difference(run) for run in range(3)] == [0, 25, -25]


def test_other_versions_and_settings_are_told(tmp_path):
    folders = [replay(tmp_path / 'a'), replay(tmp_path / 'b', lcd=LcdConfig(candidates=4))]
    environment = json.loads((folders[1] / 'environment.json').read_text())
    environment['versions']['numpy'] = '1.0'
    (folders[1] / 'environment.json').write_text(json.dumps(environment))
    found = compare(folders)
    assert [(entry.name, entry.values) for entry in found.settings] == [
        (f'{LcdConfig.title}.candidates', (LcdConfig.candidates, 4))]
    assert [entry.name for entry in found.versions] == ['versions.numpy']


def test_different_kinds_are_refused_in_one_line(tmp_path, capsys):
    assert main(['compare', str(replay(tmp_path / 'a')), str(frames(tmp_path / 'b'))]) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    assert 'different kinds' in said


@pytest.mark.parametrize(('options', 'said'), [
    (['a'], '1 results folder: expected two'), (['a', 'a', '--picture', 'x.bmp'], 'in .svg'),
    (['a', 'nowhere'], 'there is no folder nowhere')])
def test_a_wrong_comparison_is_refused(tmp_path, capsys, options, said):
    replay(tmp_path / 'a')
    assert main(['compare', *options]) == 2
    assert said in capsys.readouterr().err


def test_a_folder_compared_with_itself_is_warned_of(tmp_path, capsys):
    folder = MAKERS['replay'](tmp_path / 'one')
    (tmp_path / 'latest').symlink_to(folder)
    assert main(['compare', str(folder), str(tmp_path / 'latest'), '--picture',
                 str(tmp_path / 'c.svg')]) == 0
    assert 'warning: all 2 are the same results folder' in capsys.readouterr().err


@every_kind
@pytest.mark.parametrize(('content', 'said'), [
    ('[]', 'holds a list'), ('{"rows": ', 'cannot be read'), ('{"rows": []}', 'has no kind'),
    ('{"kind": "else"}', "the kind 'else'"), ('{"kind": "KIND", "schema": 0}', 'schema 0'),
    ('{"kind": "KIND", "schema": SCHEMA}', 'expected a list "rows"'),
    ('{"kind": "KIND", "schema": SCHEMA, "rows": [{}]}', 'row 1 is missing')])
@pytest.mark.parametrize('command', ['report', 'inspect', 'compare'])
def test_what_is_damaged_is_one_line(tmp_path, capsys, kind, content, said, command):
    folder = MAKERS[kind](tmp_path / 'a')
    (folder / 'summary.json').write_text(content.replace('KIND', kind).replace(
        'SCHEMA', str(KNOWN[kind].schema)))
    assert main([command, str(folder), *([str(folder)] if command == 'compare' else [])]) == 2
    found = capsys.readouterr().err
    assert found.count('\n') == 1
    assert said in found


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """Return a folder of every kind, and the text of its summary."""
    made = {kind: MAKERS[kind](tmp_path_factory.mktemp(kind) / 'a') for kind in KINDS}
    return {kind: (folder, (folder / 'summary.json').read_text())
            for kind, folder in made.items()}


@settings(max_examples=150, deadline=None,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(kind=st.sampled_from(KINDS), data=st.data())
def test_no_value_of_a_row_ends_in_a_traceback(whole, kind, data):
    folder, text = whole[kind]
    document = json.loads(text)
    row = data.draw(st.sampled_from(document['rows']))
    name = data.draw(st.sampled_from(sorted(row)))
    row[name] = data.draw(st.sampled_from([None, 'text', [], [1, 'x'], {}, True, -1, 0.5]))
    (folder / 'summary.json').write_text(json.dumps(document))
    for command in (['inspect', str(folder)], ['compare', str(folder), str(folder)]):
        assert main(command) in (0, 2)


def test_a_summary_comes_back_from_its_document(tmp_path):
    document = json.loads((replay(tmp_path / 'a') / 'summary.json').read_text())
    assert as_document(from_document(document)) == document
    assert [row['name'] for row in document['rows']] == ['clean', 'eigen', 'walk']
