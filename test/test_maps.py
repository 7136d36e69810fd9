# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Maps of a made-up replay, from its results folder to tables, report and g2o."""

from dataclasses import replace
import importlib.util
import json
from pathlib import Path
import sys

import bag_factory as make
import cv2
from map_factory import pairs, wavy
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_slam import needs_gtsam

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.config import BACK_ENDS, AttackConfig, LabelConfig, LcdConfig, MapConfig
from adversarial_lcd_ros.errors import ConfigError, EvaluationError
from adversarial_lcd_ros.evaluation import results
from adversarial_lcd_ros.evaluation.maps.beside import read_beside
from adversarial_lcd_ros.evaluation.maps.claims import claim_errors
from adversarial_lcd_ros.evaluation.maps.inputs import has_metres, read_inputs
from adversarial_lcd_ros.evaluation.maps.overview import overview
from adversarial_lcd_ros.evaluation.maps.plan import ADDED, MISSING, pairs_of, plan_cases
from adversarial_lcd_ros.evaluation.maps.run import make_maps
from adversarial_lcd_ros.evaluation.maps.summary import summarise_cases
from adversarial_lcd_ros.evaluation.maps.tables import all_tables
from adversarial_lcd_ros.evaluation.replay.records import AttackRun, make_records, write_records
from adversarial_lcd_ros.evaluation.replay.report import write_report
from adversarial_lcd_ros.evaluation.replay.summary import GraphStatistics, as_document, summarise
from adversarial_lcd_ros.ground_truth.labelling import Views, label_views
from adversarial_lcd_ros.messages.types import AttackReport, LoopClosure
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.slam.motions import between

ROOT = Path(__file__).resolve().parents[1]
COUNT, LAP = 60, 30
FIRST = 29  # is back near the start of the path
LABELS = LabelConfig(rule='distance', min_gap_s=0.1, positive_distance_m=0.3,
                     negative_distance_m=1.5)
FALSE = {20: 6, 24: 2, 28: 10}  # before any loop is there
QUIET = {'draws': 2}


def here(function, tasks):
    yield from map(function, tasks)


def decisions(stamps, false):
    """Return closures of the second lap with the first one, and false ones."""
    match = {frame: frame - LAP for frame in range(LAP + 2, COUNT)} | false | {15: 13}
    return [LoopClosure(int(stamp), 'camera', frame, frame in match,
                        0.9 if frame in match else 0.1,
                        *((int(stamps[match[frame]]), match[frame]) if frame in match
                          else (None, None)), candidates=frame)
            for frame, stamp in enumerate(stamps)]


def walked(tmp_path):
    """Return the folder of a sequence of two laps."""
    source = make.tum_folder(tmp_path / 'laps', COUNT, truth=False)
    stamps, truth = make.stamps(COUNT), wavy(COUNT, 2)
    quaternion = Rotation.from_matrix(truth[:, :3, :3]).as_quat()
    (source / 'groundtruth.txt').write_text('# timestamp tx ty tz qx qy qz qw\n' + ''.join(
        f'{make.seconds(stamp)} ' + ' '.join(f'{value:.9f}' for value in (*at[:3, 3], *turn))
        + '\n' for stamp, at, turn in zip(stamps, truth, quaternion, strict=True)))
    return source


def replayed(tmp_path, source=None, lcd=None, false=FALSE, name='results', rules=LABELS):
    """Return the results folder of two laps, clean and with false closures."""
    source, lcd = source or walked(tmp_path), lcd or LcdConfig()
    sequence = open_sequence(source)
    stamps = sequence.stamps_ns
    labels = label_views(Views(stamps, sequence.image_size, sequence.trajectory, source),
                         LABELS).labels
    reports = [AttackReport(int(stamp), 'camera', frame, 'failure', '', 9, 9, 9, 9, -1.0, -1.0,
                            0.01) for frame, stamp in enumerate(stamps)]
    records = make_records(labels, decisions(stamps, {}), {
        'forger': AttackRun(decisions(stamps, false), reports)})
    folder = tmp_path / name
    folder.mkdir()
    made = results.ResultsFolder(folder)
    made.write_setup([lcd, rules, AttackConfig()], ['adversarial-lcd', 'evaluate'], 1,
                     {'source': str(source)})
    summary = summarise('laps', records, {'forger': AttackConfig()},
                        GraphStatistics.of([300] * COUNT, [900] * COUNT), seed=1)
    made.write_json(results.SUMMARY, as_document(summary))
    write_records(folder / results.RECORDS, records)
    write_report(folder, summary, records, [])
    return folder


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    return replayed(tmp_path_factory.mktemp('maps'))


@pytest.fixture(scope='module')
def beside(tmp_path_factory):
    """Return replays of one sequence: as it is, with a length check, and another detector."""
    place = tmp_path_factory.mktemp('beside')
    source = walked(place)
    return [replayed(place, source, lcd, false, name) for name, lcd, false in (
        ('usual', LcdConfig(), FALSE),
        ('checked', LcdConfig(defences='length_check', length_factor=3.0), {20: 6}),
        ('other', LcdConfig(target='vbow'), FALSE | {22: 4}))]


@pytest.fixture(scope='module')
def inputs(folder):
    return read_inputs(folder, 'laps', labelled=True)


def test_closures_are_right_false_or_cannot_be_told(inputs):
    clean, forged = inputs.runs['clean'], inputs.runs['forger']
    assert len(clean.pairs) == COUNT - LAP - 2
    assert not clean.pairs.is_false.any()
    assert forged.pairs.query[forged.pairs.is_false].tolist() == sorted(FALSE)
    # 15 with 13: too near in space to be another place, too near in time to be the same.
    assert (clean.untold, forged.untold) == (1, 1)
    assert np.allclose(inputs.truth, wavy(COUNT, 2), atol=1e-6)
    assert inputs.first_loop == FIRST


@pytest.mark.parametrize(('count', 'labelled'), [(COUNT - 5, False), (COUNT, True)])
def test_another_sequence_is_refused(folder, tmp_path, count, labelled):
    other = make.tum_folder(tmp_path / 'other', count)
    with pytest.raises(EvaluationError, match='expected the sequence that was replayed'):
        read_inputs(folder, 'laps', str(other), labelled=labelled)


def test_results_that_do_not_say_their_sequence_ask_for_it(folder, tmp_path):
    copy = tmp_path / 'copy'
    copy.mkdir()
    for path in folder.glob('*.*'):
        (copy / path.name).write_bytes(path.read_bytes())
    document = json.loads((copy / 'configuration.json').read_text())
    source = document.pop('source')
    (copy / 'configuration.json').write_text(json.dumps(document))
    with pytest.raises(ConfigError, match='--sequence'):
        read_inputs(copy, 'laps')
    assert read_inputs(copy, 'laps', source).first_loop == FIRST


def test_a_sequence_without_poses_in_metres_makes_no_map(tmp_path):
    with pytest.raises(EvaluationError, match='no poses in metres'):
        has_metres(make.tum_folder(tmp_path / 'blind', truth=False))


def test_young_and_whole_maps_go_draw_by_draw(inputs):
    cases = list(plan_cases(inputs, MapConfig(draws=2), sweeps=False))
    assert [(case.draw, case.stage, case.frames, case.run) for case in cases[:4]] == [
        (0, 'young', FIRST, 'clean'), (0, 'young', FIRST, 'forger'),
        (0, 'whole', COUNT, 'clean'), (0, 'whole', COUNT, 'forger')]
    assert [case.draw for case in cases] == [0] * 4 + [1] * 4
    assert {case.frames for case in plan_cases(inputs, MapConfig(young_frames=12), sweeps=False)
            } == {12, COUNT}


def test_sweeps_add_false_closures_and_leave_out_right_ones(inputs):
    config = MapConfig(draws=1)
    cases = list(plan_cases(inputs, config, sweeps=True))
    assert {case.drift for case in cases} == {1.0, 3.0, 5.0}
    right = len(inputs.runs['clean'].pairs)
    for case in cases:
        found = pairs_of(inputs, case, config)
        if case.added is not None:
            added = found.chosen(found.is_false)
            assert case.consistent or len(added) == case.added
            assert inputs.elsewhere[added.query, added.match].all()
            assert (added.query < case.frames).all()
            if case.consistent:
                assert len(set((added.query - added.match).tolist())) == 1
        if case.missing is not None:
            assert len(found) == right - round(case.missing * right)
    assert {case.added for case in cases} == {None, *ADDED}
    assert {case.missing for case in cases} == {None, *MISSING}


def test_an_excess_is_over_the_same_draws_of_the_clean_run():
    def case(run, draw, error):
        figures = {'ate_m': error, 'rpe_m': None, 'rpe_deg': None, 'right_kept': 1,
                   'false_kept': 0, 'duration_s': 0.1}
        return {'run': run, 'stage': 'whole', 'frames': 9, 'drift': 1.0, 'draw': draw,
                'added': None, 'consistent': False, 'missing': None, 'checked': False,
                'setting': '', 'claims': '',
                'right': 1, 'false': 0, 'unposed': 0,
                'back_ends': dict.fromkeys(('odometry', *BACK_ENDS), figures)}

    rows = summarise_cases([case('clean', 0, 1.0), case('forger', 0, 1.5), case('clean', 1, 3.0),
                            case('forger', 1, 3.5)])
    row = next(row for row in rows if row['run'] == 'forger' and row['back_end'] == 'gnc')
    assert (row['ate_m'], row['draws'], row['excess_m']) == (2.5, 2, 0.5)
    assert row['excess_ci95'] == (0.5, 0.5)
    # Student's t with one degree of freedom: 12.706 times the standard error, here 1 m.
    assert row['ate_ci95'] == pytest.approx((2.5 - 12.706, 2.5 + 12.706), abs=1e-3)
    assert next(row for row in rows if row['run'] == 'clean')['excess_m'] is None


@needs_gtsam
def test_maps_are_made_once_reported_and_shown(folder, capsys):
    config = MapConfig(**QUIET)
    made = make_maps([folder], config, here)
    error = {(row['run'], row['stage'], row['back_end']): row['ate_m'] for row in made['rows']}
    assert error['forger', 'young', 'least_squares'] > 5 * error['clean', 'young', 'least_squares']
    assert error['forger', 'young', 'gnc'] < 2 * error['clean', 'young', 'odometry']
    kept = next(row for row in made['rows'] if (row['run'], row['stage'], row['back_end'])
                == ('forger', 'whole', 'gnc'))
    assert (kept['false'], kept['false_kept']) == (3, 0)
    cells = (folder / 'map' / 'cells.jsonl').read_bytes()
    assert make_maps([folder], config, here)['rows'] == made['rows']
    assert (folder / 'map' / 'cells.jsonl').read_bytes() == cells

    def none_left(function, tasks):
        assert not tasks
        yield from ()

    make_maps([folder], config, none_left)
    assert main(['report', str(folder)]) == 0
    page = (folder / 'report.html').read_text()
    assert 'What it does to the map' in page
    assert page.count('Under forger, with 3 false closures, the young map (29 frames)') == 1
    assert main(['report', str(folder / 'map')]) == 0
    alone = (folder / 'map' / 'report.html').read_text()
    assert alone.count('Under forger') == 1
    assert '<th>' not in page + alone
    assert '| forger |' in (folder / 'map' / 'tables.md').read_text()
    capsys.readouterr()
    assert main(['inspect', str(folder / 'map')]) == 0
    assert 'Absolute error in metres, young map, 29 frames' in capsys.readouterr().out


def test_runs_side_by_side_are_called_by_what_differs(beside):
    inputs = read_beside(beside)
    assert list(inputs.runs) == [
        'clean', 'forger', 'clean, length check, length factor 3.0',
        'forger, length check, length factor 3.0', 'clean, vbow', 'forger, vbow']
    assert [int(run.pairs.is_false.sum()) for run in inputs.runs.values()] == [0, 3, 0, 1, 0, 4]
    assert {run.run for run in inputs.runs.values()} == {'clean', 'forger'}
    # Sweeps are of the first detector, also where an attack does more to another.
    cases = list(plan_cases(inputs, MapConfig(draws=1), sweeps=True))
    assert {case.setting for case in cases if case.drift != 1.0} == {''}


def test_what_cannot_be_told_apart_or_compared_is_refused(beside, tmp_path):
    with pytest.raises(EvaluationError, match='nothing tells some runs apart'):
        read_beside([*beside, beside[0]])
    source = json.loads((beside[0] / 'configuration.json').read_text())['source']
    ruled = replayed(tmp_path, source, LcdConfig(target='vbow'),
                     rules=replace(LABELS, positive_distance_m=0.31))
    with pytest.raises(EvaluationError, match='labelled by other rules'):
        read_beside([beside[0], ruled])
    moved = walked(tmp_path)
    text = (moved / 'groundtruth.txt').read_text().splitlines()
    numbers = text[1].split()
    (moved / 'groundtruth.txt').write_text('\n'.join(
        [text[0], ' '.join([numbers[0], '3.01', *numbers[2:]]), *text[2:]]))
    other = replayed(tmp_path, moved, LcdConfig(target='vbow'), name='moved')
    with pytest.raises(EvaluationError, match='expected replays of the same frames'):
        read_beside([beside[0], other])


@needs_gtsam
def test_several_replays_make_one_table_each_against_its_own_clean_run(beside, tmp_path, capsys):
    assert main(['map', *map(str, beside)]) == 2
    assert '--output' in capsys.readouterr().err
    out = tmp_path / 'maps'
    assert main(['map', *map(str, beside), '--output', str(out), '--map-draws', '1',
                 '--jobs', '1']) == 0
    made = json.loads((out / 'summary.json').read_text())
    error = {(row['run'], row['setting'], row['stage'], row['back_end']): row
             for row in made['rows']}
    for setting in ('', 'vbow'):
        row = error['forger', setting, 'young', 'least_squares']
        assert row['excess_m'] == pytest.approx(
            row['ate_m'] - error['clean', setting, 'young', 'least_squares']['ate_m'])
    # Runs that declared the same share their maps: three clean ones are one.
    assert len((out / 'cells.jsonl').read_text().splitlines()) == 2 * (1 + 3)
    assert not (beside[0] / 'map').exists()
    table = (out / 'tables.md').read_text()
    assert '| forger, vbow |' in table
    page = (out / 'report.html').read_text()
    assert 'Under forger, vbow' in page
    still = tmp_path / 'still.png'
    assert main(['render', str(out), '--output', str(still)]) == 0
    assert cv2.imread(str(still)) is not None
    assert main(['render', str(out), '--output', str(tmp_path / 'film.gif')]) == 2
    assert main(['inspect', str(out)]) == 0
    assert main(['compare', str(out), str(out)]) == 0


def test_an_overview_takes_the_worst_of_each_back_end_and_marks_what_is_worse_than_none():
    def row(run, back_end, error, setting='', stage='whole', **more):
        return {'run': run, 'setting': setting, 'stage': stage, 'back_end': back_end,
                'ate_m': error, 'false': 3 if run == 'a' else 0, 'checked': False, 'drift': 1.0,
                'added': None, 'missing': None, 'claims': ''} | more

    rows = [row(run, back_end, error) for run, errors in (
        ('clean', (0.2, 0.1, 0.1)), ('a', (0.2, 1.5, 0.2001)), ('b', (0.2, 0.9, 0.3)))
        for back_end, error in zip(('odometry', 'least_squares', 'gnc'), errors, strict=True)]
    rows += [row('a', 'least_squares', 9.0, drift=3.0), row('a', 'least_squares', 9.0, added=3),
             row('a', 'gnc', 0.1, 'length check'), row('a', 'odometry', 0.2, 'length check'),
             row('clean', 'gnc', 0.1, 'vbow', false=3),
             row('clean', 'odometry', 0.2, 'vbow', false=3)]
    _, cells = overview({'tour': {'rows': rows}})
    found = [(each['run'], each['false closures'], each['least squares'], each['GNC'])
             for each in cells]
    assert found == [('clean', 'n/a / 0', 'n/a / 0.100', 'n/a / 0.100'),
                     ('worst attack', 'n/a / 3', 'n/a / **1.500**', 'n/a / **0.300**'),
                     ('worst attack, length check<br>clean, vbow', 'n/a / 3', 'n/a / n/a',
                      'n/a / 0.100')]


def test_a_page_has_the_tables_of_every_sequence(tmp_path, monkeypatch):
    from results_factory import map_folder

    spec = importlib.util.spec_from_file_location('map_page', ROOT / 'benchmarks/map_page.py')
    map_page = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(map_page)
    page = tmp_path / 'map.md'
    page.write_text(f'Kept.\n\n{map_page.BEGIN}\nbygone\n{map_page.END}\n\nKept, too.\n')
    monkeypatch.setattr(map_page, 'PAGE', page)
    folders = [str(map_folder(tmp_path / name)) for name in ('one', 'two')]
    map_page.main(folders)
    map_page.main(folders)
    text = page.read_text()
    assert text.startswith('Kept.\n')
    assert text.endswith('Kept, too.\n')
    assert 'bygone' not in text
    assert [line for line in text.splitlines() if line.startswith('## ')] == [
        '## All sequences', '## one', '## two']
    assert '### two: absolute error in metres, whole run' in text
    assert text.count('<details>') == text.count('</details>') == 2
    page.write_text('no place')
    with pytest.raises(SystemExit, match='no lines'):
        map_page.main(folders[:1])


@needs_gtsam
def test_false_closures_may_agree_with_one_another(folder):
    made = make_maps([folder], MapConfig(draws=1), here, claims=['consistent'])
    claims = {(row['run'], row['claims']) for row in made['rows']}
    # None of the clean run is false.
    assert claims == {('clean', ''), ('forger', ''), ('forger', 'consistent')}
    assert made['claims'] == []
    titles = [title for title, _ in all_tables(made)]
    assert len(set(titles)) == len(titles)
    assert 'Absolute error in metres, by what closures claim' in titles


def test_claims_of_features_are_held_against_the_truth():
    truth = wavy(12, 1)
    given = pairs((9, 1, 0), (10, 2, 0), (11, 3, 0), (8, 0, 1))
    true = between(truth[given.match], truth[given.query])
    turned = true[0].copy()
    turned[:3, :3] = true[0, :3, :3] @ Rotation.from_rotvec([0, 0, np.radians(10)]).as_matrix()
    half = true[1].copy()
    half[:3, 3] /= 2
    row, = claim_errors({('forger', ''): given}, truth, {
        (1, 9): turned, (2, 10): half, (3, 11): None, (0, 8): np.eye(4)})
    assert (row['right'], row['right_posed'], row['false'], row['false_posed']) == (3, 2, 1, 1)
    assert row['rotation_deg'] == pytest.approx([5, 9])
    assert row['direction_deg'] == pytest.approx([0, 0], abs=1e-4)
    assert row['translation_m'][0] == pytest.approx(np.linalg.norm(true[1, :3, 3]) / 4)
    empty, = claim_errors({('clean', ''): given.chosen(given.is_false)}, truth, {})
    assert empty['rotation_deg'] == [None, None]


@needs_gtsam
def test_one_seed_makes_one_map(folder, tmp_path):
    config = MapConfig(draws=1, seed=7)
    first, second = (make_maps([folder], config, here)['rows'] for _ in range(2))
    assert first == second
    other = make_maps([folder], MapConfig(draws=1, seed=8), here)['rows']
    assert [row['ate_m'] for row in first] != [row['ate_m'] for row in other]


@needs_gtsam
def test_pose_graphs_are_exported_with_their_truth(folder, tmp_path, capsys):
    out = tmp_path / 'g2o'
    assert main(['map', str(folder), '--export-g2o', str(out)]) == 0
    written = capsys.readouterr().out.splitlines()
    assert written == [str(out / name) for name in ('clean.g2o', 'forger.g2o', 'truth.tum')]
    lines = (out / 'forger.g2o').read_text().splitlines()
    edges = [line for line in lines if line.startswith('EDGE_SE3:QUAT')]
    assert len(edges) == COUNT - 1 + COUNT - LAP - 2 + len(FALSE)
    assert len((out / 'truth.tum').read_text().splitlines()) == COUNT


def test_results_of_another_kind_make_no_map(tmp_path, capsys):
    from results_factory import frames

    assert main(['map', str(frames(tmp_path / 'a'))]) == 2
    assert 'of the kind "frames"' in capsys.readouterr().err


def test_a_missing_gtsam_is_told_before_anything_is_replayed(monkeypatch, capsys, tmp_path):
    pytest.importorskip('rclpy', reason='rclpy is not installed')
    monkeypatch.setitem(sys.modules, 'gtsam', None)
    assert main(['demo', '--map', '--output', str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert 'adversarial_lcd_ros[slam]' in said
    assert said.count('\n') == 1
    assert not list(tmp_path.iterdir())


@needs_gtsam
@pytest.mark.parametrize('suffix', ['gif', 'mp4'])
def test_a_map_is_shown_as_it_grows(folder, tmp_path, capsys, suffix):
    out = tmp_path / 'films' / f'map.{suffix}'
    assert main(['render', str(folder), '--output', str(out), '--steps', '3', '--seconds', '2',
                 '--jobs', '1']) == 0
    assert capsys.readouterr().out == f'{out}\n'
    assert [path.name for path in out.parent.iterdir()] == [out.name]
    film = cv2.VideoCapture(str(out))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) >= 3
    found, picture = film.read()
    assert found
    assert picture.std() > 1


@needs_gtsam
def test_maps_that_are_there_are_drawn_side_by_side(tmp_path, capsys):
    folder, still = replayed(tmp_path), tmp_path / 'map.png'
    assert main(['render', str(folder), '--output', str(still)]) == 2
    assert 'adversarial-lcd map' in capsys.readouterr().err
    make_maps([folder], MapConfig(draws=1), here)
    assert main(['render', str(folder), '--output', str(still)]) == 0
    # Two runs by odometry and four back ends.
    assert cv2.imread(str(still)).shape[1] > 500


@pytest.mark.parametrize(('options', 'said'), [
    (['--output', 'map.avi'], '.gif, .mp4, .png, .svg'), (['--steps', '0'], '--steps 0'),
    (['--jobs', '0'], '--jobs 0')])
def test_wrong_options_of_render_are_told(folder, capsys, options, said):
    assert main(['render', str(folder), *options]) == 2
    found = capsys.readouterr().err
    assert said in found
    assert found.count('\n') == 1


@needs_gtsam
def test_a_run_that_is_not_there_is_told(folder, capsys):
    assert main(['render', str(folder), '--run', 'nobody', '--jobs', '1']) == 2
    assert 'clean, forger' in capsys.readouterr().err


@needs_gtsam
def test_claims_by_features_are_refused_where_the_attack_changed_them(folder, tmp_path):
    copy = tmp_path / 'copy'
    copy.mkdir()
    for path in folder.glob('*.*'):
        (copy / path.name).write_bytes(path.read_bytes())
    document = json.loads((copy / 'configuration.json').read_text())
    document['settings'][-1]['values']['poster'] = 'cells'
    (copy / 'configuration.json').write_text(json.dumps(document))
    with pytest.raises(EvaluationError, match='the attack changed features'):
        make_maps([copy], MapConfig(false_claim='essential', draws=1), here)
