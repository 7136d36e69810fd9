# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

from dataclasses import dataclass, replace
from datetime import datetime, timezone
import json

from graph_factory import make_graph
import numpy as np
from page_links import Links
import pytest

from adversarial_lcd_ros.commands.common import print_lines
from adversarial_lcd_ros.config import AttackConfig, LabelConfig, LcdConfig
from adversarial_lcd_ros.environment import environment
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation import results, wording
from adversarial_lcd_ros.evaluation.methods import whose
from adversarial_lcd_ros.evaluation.page import ATTACK_COLOURS, CLEAN_COLOUR
from adversarial_lcd_ros.evaluation.pictures import Picture
from adversarial_lcd_ros.evaluation.replay import findings, report, tables
from adversarial_lcd_ros.evaluation.replay.behind import ask_check
from adversarial_lcd_ros.evaluation.replay.records import (
    AttackRun,
    make_records,
    read_records,
    runs_of,
    write_records,
)
from adversarial_lcd_ros.evaluation.replay.summary import GraphStatistics, as_document, summarise
from adversarial_lcd_ros.evaluation.replay.telling import choose_records, describe
from adversarial_lcd_ros.evaluation.terminal import replay_lines
from adversarial_lcd_ros.ground_truth.labels import label_frames, unlabelled
from adversarial_lcd_ros.lcd.geometry import find_inliers
from adversarial_lcd_ros.messages.types import AttackReport, LoopClosure
from adversarial_lcd_ros.registry import PERTURBATIONS

COUNT = 60
ATTACKS = {'eigen': AttackConfig(), 'walk': AttackConfig(perturbation='random_walk',
                                                         mode='surrogate')}


@dataclass(frozen=True)
class Poses:
    stamp_ns: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    frame_id: str = 'place_index'


def make_labels():
    stamp = np.arange(COUNT) * 10**9
    place = np.r_[np.arange(30), np.arange(30)].astype(float)  # two walks along the same way
    position = np.stack([place, place * 0, place * 0], axis=1)
    return label_frames(Poses(stamp, position, np.tile([0, 0, 0, 1.0], (COUNT, 1))), stamp,
                        (640, 480), LabelConfig(negative_index=5))


def decide(loops, matches=None):
    """The detector sees a loop at the given frames, each with the frame 30 before it."""
    return [LoopClosure(index * 10**9, 'camera', index, index in loops,
                        0.9 if index in loops else 0.1,
                        *((m * 10**9, m) if (m := (matches or {}).get(index, index - 30)) >= 0
                          else (None, None)), candidates=max(index - 8, 0))
            for index in range(COUNT)]


def report_of(index, **values):
    return replace(AttackReport(index * 10**9, 'camera', index, 'failure', 'budget spent', 27, 20,
                                1080, 100, -1.0, -0.5, 0.01), **values)


def make_runs():
    reports = [report_of(index, status='skipped', edit_budget=0, edits=0, queries=0)
               if index < 6 else report_of(index) for index in range(COUNT)]
    attacked = decide({20, *range(35, 60)}, {20: 3, 40: 3})
    return {'eigen': AttackRun(attacked, reports),
            'walk': AttackRun(decide(range(30, 60)), reports)}


@pytest.fixture(scope='module')
def records():
    return make_records(make_labels(), decide(range(30, 60)), make_runs())


@pytest.fixture
def summary(records):
    return summarise('walks', records, ATTACKS, GraphStatistics.of([300] * COUNT, [900] * COUNT),
                     seed=1)


def test_records_hold_outcome_and_effect(records):
    runs = runs_of(records)
    assert list(runs) == ['clean', 'eigen', 'walk']
    clean, eigen = runs['clean'], runs['eigen']
    assert [record.outcome for record in clean[30:]] == ['TP'] * 30
    assert clean[20].outcome == 'TN'
    assert clean[0].kind == 'no_candidate'
    assert eigen[20].effect == 'invented'
    assert eigen[31].effect == 'suppressed'
    assert eigen[40].effect == 'diverted'
    assert eigen[50].effect == ''
    assert eigen[3].status == 'skipped'
    assert clean[3].status is None
    assert clean[45].match_frame == 15
    assert clean[3].match_frame is None


def test_an_untold_match_is_in_no_figure_and_is_said():
    labels = make_labels()
    possible = labels.possible.copy()
    possible[45, 15] = False  # neither right nor wrong
    records = make_records(replace(labels, possible=possible), decide(range(30, 60)), make_runs())
    clean, eigen = (runs_of(records)[name] for name in ('clean', 'eigen'))
    assert (clean[45].outcome, clean[45].match_is) == ('UM', 'untold')
    assert (eigen[40].match_is, eigen[45].effect) == ('elsewhere', '')
    found = summarise('walks', records, ATTACKS, GraphStatistics.of([1] * COUNT, [1] * COUNT), 1,
                      told_by='audit')
    attack = found['attacks'][0]
    assert found['clean']['untold_matches'] == attack['left_out'] == 1
    assert found['clean']['recall'] == found['clean']['precision'] == 1
    assert found['clean']['wrong_closures_unscored'] == 0
    assert (attack['invented_elsewhere'], attack['diverted_elsewhere']) == (1, 1)
    assert attack['declared_elsewhere'] == 2
    assert attack['decline_pp'] == pytest.approx(50 * (6 / 29 + 1 / 22))
    assert found['told_by'] == 'audit'
    assert '1 frame was left out' in findings.headline(found)


def test_records_survive_the_file(records, tmp_path):
    path = tmp_path / 'per_query.csv'
    write_records(path, records)
    assert read_records(path) == records
    text = path.read_text().replace(',0.9,', ',high,', 1)
    path.write_text(text)
    with pytest.raises(EvaluationError, match=r"line \d+: probability is 'high'"):
        read_records(path)
    path.write_text('a,b\n')
    with pytest.raises(EvaluationError, match='columns'):
        read_records(path)


@pytest.mark.parametrize('broken', [
    lambda all_: all_[:-1], lambda all_: all_[:5] + all_[6:], lambda all_: all_ + all_[:1],
    lambda all_: [all_[1], all_[0], *all_[2:]]])
def test_lost_or_repeated_messages_give_no_figure(broken):
    labels, runs = make_labels(), make_runs()
    with pytest.raises(EvaluationError, match='run it again'):
        make_records(labels, broken(decide(())), runs)
    run = AttackRun(runs['walk'].decisions, broken(list(runs['walk'].reports)))
    with pytest.raises(EvaluationError, match='run it again'):
        make_records(labels, decide(()), {'walk': run})


def test_match_with_a_frame_of_another_run_is_refused():
    strange = [replace(decision, match_stamp_ns=-5) if index == 50 else decision
               for index, decision in enumerate(decide(()))]
    with pytest.raises(EvaluationError, match='no frame of this replay'):
        make_records(make_labels(), strange, {})


def test_summary_has_the_agreed_fields(summary):
    assert {'sequence', 'frames', 'graphs', 'decisions', 'nodes_mean', 'edges_mean', 'positives',
            'negatives', 'clean', 'attacks', 'seed'} <= set(summary)
    assert {'accuracy', 'balanced_accuracy', 'precision', 'recall', 'recall_at_100_precision',
            'mcc'} <= set(summary['clean'])
    assert {'perturbation', 'surrogate', 'ratio', 'mode', 'edits_mean', 'queries_mean',
            'unattackable', 'suppressed', 'invented', 'accuracy', 'decline_pp',
            'decline_ci95'} <= set(summary['attacks'][0])


def test_summary_figures(summary):
    eigen, walk = summary['attacks']
    assert (summary['positives'], summary['negatives']) == (30, 22)
    assert summary['not_scored'] == {'scale': 0, 'between': 0, 'no_candidate': 8,
                                     'no_ground_truth': 0}
    assert (eigen['suppressed'], eigen['diverted'], eigen['invented']) == (6, 1, 1)
    assert eigen['decline_pp'] == pytest.approx(50 * (6 / 30 + 1 / 22))
    assert eigen['decline_ci95'][0] < eigen['decline_pp'] < eigen['decline_ci95'][1]
    assert walk['decline_pp'] == 0
    assert walk['decline_ci95'] == (0, 0)
    assert eigen['unattackable'] == 6
    assert eigen['edits_mean'] == pytest.approx(20 * 54 / 60)  # skipped frames count as none


def test_summary_refuses_lost_graphs(records):
    with pytest.raises(EvaluationError, match='59 graphs for 60 frames'):
        summarise('walks', records, ATTACKS, GraphStatistics.of([1] * 59, [1] * 59), seed=1)
    with pytest.raises(EvaluationError, match='runs'):
        summarise('walks', records, {}, GraphStatistics.of([1] * 60, [1] * 60), seed=1)


def test_pictures_are_of_the_telling_frames(records):
    runs = runs_of(records)
    chosen = choose_records(runs['eigen'], 6)
    assert len({record.frame for record in chosen}) == 6
    assert {'suppressed', 'invented', 'diverted'} <= {record.effect for record in chosen}
    title, caption = describe(chosen[0], runs['clean'][chosen[0].frame])
    assert title.startswith(f'Frame {chosen[0].frame}: ')
    assert 'allowed' in caption
    assert choose_records([], 6) == []


@pytest.fixture
def folder(tmp_path, records, summary):
    made = results.ResultsFolder.create(tmp_path / 'results')
    made.write_setup([LcdConfig(), *ATTACKS.values()], ['adversarial-lcd', '<evaluate>'], 1)
    made.write_json(results.SUMMARY, as_document(summary))
    write_records(made.path / results.RECORDS, records)
    pictures = [Picture(f'Frame {n}', 'a & b', np.full((9, 16, 3), n, np.uint8))
                for n in range(6)]
    report.write_report(made.path, summary, records, pictures)
    return made


def test_report_needs_nothing_but_itself(folder):
    text = (folder.path / results.REPORT).read_text(encoding='utf-8')
    page = Links(text)
    assert page.sources
    assert all(source.startswith('data:') for source in page.sources)
    assert '@import' not in text
    assert 'url(' not in text
    assert '<script' not in text
    assert '<th>' not in text  # a screen reader is told what a heading is of
    assert sum(source.startswith('data:image/jpeg') for source in page.sources) == 6
    assert 'a & b' in page.text
    assert '<evaluate>' in page.text


def test_report_is_made_anew_from_the_folder(folder):
    path = folder.finish() / results.REPORT
    before = path.read_bytes()
    path.unlink()
    assert report.report_folder(path.parent) == path
    assert path.read_bytes() == before


@pytest.mark.parametrize('kind', ['positive', 'negative'])
def test_report_without_a_class(records, folder, kind):
    rest = [replace(record, kind='between', outcome='', effect='') if record.kind == kind
            else record for record in records]
    one_sided = summarise('walks', rest, ATTACKS, GraphStatistics.of([1] * COUNT, [1] * COUNT), 1)
    assert one_sided['clean']['balanced_accuracy'] is None
    path = report.write_report(folder.path, one_sided, rest, [])
    assert 'no balanced accuracy can be given' in Links(path.read_text(encoding='utf-8')).text
    json.dumps(one_sided, allow_nan=False)


def test_report_without_attacks(records, folder):
    clean = [record for record in records if record.run == 'clean']
    summary = summarise('walks', clean, {}, GraphStatistics.of([1] * COUNT, [1] * COUNT), 1)
    assert report.write_report(folder.path, summary, clean, []).is_file()


def test_headline_is_careful(summary):
    assert 'took' in findings.headline(summary)
    nothing = {**summary, 'attacks': summary['attacks'][1:]}
    assert findings.headline(nothing).startswith('No attack lowered')


def test_headline_says_whose_the_attack_is_and_what_the_papers_took(summary):
    eigen, walk = summary['attacks']
    ours = {**walk, 'name': 'recall', 'search': 'recall', 'perturbation': '',
            'decline_pp': 20.0, 'decline_ci95': (9.0, 30.0)}
    text = findings.headline({**summary, 'attacks': [eigen, ours]})
    assert "The attack recall, this project's own, took 20.0 points" in text
    assert f"The paper's own (eigen) took {wording.points(eigen['decline_pp'])} points" in text
    assert "The attack eigen, the paper's, took" in findings.headline(summary)
    unsure = {**ours, 'decline_ci95': (0.0, 30.0)}
    text = findings.headline({**summary, 'attacks': [eigen, unsure]})
    assert "recall, this project's own, took 20.0 points" in text
    assert 'whether that is chance: 95\u202f% interval 0.0 to 30.0' in text
    assert "The paper's own (eigen) took" in text


def test_the_owner_of_an_attack_comes_from_its_class():
    def owner(perturbation, surrogate='svm_rbf', search='stepwise', mode='query'):
        return whose({'perturbation': perturbation, 'surrogate': surrogate, 'search': search,
                      'mode': mode})

    assert {owner(method) for method in PERTURBATIONS} == {'paper'}
    assert owner('random_flip', 'none') == 'control'
    assert owner('eigencentrality', 'ard') != 'paper'
    assert owner('', '', 'recall') == 'ours'
    assert owner('', '', 'optimum') == 'bound'
    assert owner('eigencentrality', mode='pass') == 'control'
    assert owner(None, None, None, None) == ''


def test_a_check_behind_the_detector_takes_loops_back(records):
    # The check bears out what is right, and no loop of the attacked run with another place.
    asked = [replace(record, support=(2.0 if record.match_correct else 0.5)
                     if record.is_loop else None) for record in records]
    found = summarise('walks', asked, ATTACKS, GraphStatistics.of([1] * COUNT, [1] * COUNT), 1,
                      LcdConfig())
    eigen = found['behind_check']['attacks'][0]
    assert (eigen['invented'], eigen['fp'], eigen['wrong_matches']) == (0, 0, 0)
    assert eigen['suppressed'] == found['attacks'][0]['suppressed']  # one wrong match among them
    assert found['detector'] == {'target': 'wl', 'threshold': 0.5, 'defences': []}
    assert tables.behind_rows(found)[0]['invented'] == '0 of 22'
    assert any('geometric check' in text for text in findings.meaning(found))


def test_without_the_check_asked_there_are_no_rows_of_it(summary):
    assert summary['behind_check'] is None
    assert tables.behind_rows(summary) == []
    assert not any('geometric check' in text for text in findings.meaning(summary))


def test_the_check_is_asked_of_the_graphs_that_the_detector_got(records):
    graphs = [make_graph(42, [], 2, index % 5) for index in range(COUNT)]
    sent = {name: graphs for name in runs_of(records)}
    asked = ask_check(records, sent, LcdConfig())
    for record in asked:
        known = record.is_loop and record.match_frame is not None
        assert (record.support is not None) == known
        if known:
            assert record.support == find_inliers(
                graphs[record.frame], graphs[record.match_frame], 3.0).count / 20
    same = ask_check(records, sent, LcdConfig(geometric_check=True))
    assert all(record.support is None for record in same)


def test_text_in_the_colours_of_attacks_can_be_read():
    def luminance(colour):
        parts = [int(colour[at:at + 2], 16) / 255 for at in (1, 3, 5)]
        return np.dot([0.2126, 0.7152, 0.0722], [
            part / 12.92 if part <= 0.03928 else ((part + 0.055) / 1.055) ** 2.4
            for part in parts])

    for colour in (*ATTACK_COLOURS, CLEAN_COLOUR):
        assert 1.05 / (luminance(colour) + 0.05) >= 4.5, colour


@pytest.mark.parametrize('width', [80, 120])
def test_the_terminal_has_a_line_for_each_attack(summary, width, monkeypatch, capsys):
    monkeypatch.setenv('COLUMNS', str(width))
    longer = {**summary['attacks'][0], 'name': 'eigencentrality + SVM-RBF, no queries at all'}
    title, rows = replay_lines({**summary, 'attacks': [*summary['attacks'], longer]})
    print_lines(title, rows)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= width
    assert len(lines) == 2 + len(rows)
    for line, row in zip(lines[2:], rows, strict=True):
        # Names give way, figures do not.
        *_, decline = row.values()
        assert line.rstrip().endswith(decline)
        assert line.startswith(row['attack'][:9])
        assert row['attack'][-8:] in line


def test_an_attack_without_a_name_is_told_by_its_settings(summary):
    attack = {**summary['attacks'][1], 'name': ''}
    assert wording.attack_title(attack) == 'random walk + SVM-RBF, surrogate only'


def test_latest_changes_only_when_the_folder_is_complete(folder, tmp_path):
    root = tmp_path / 'results'
    assert folder.path.name.endswith('.partial')
    assert not (root / 'latest').exists()
    final = folder.finish()
    assert (root / 'latest').resolve() == final
    assert (final / 'summary.json').is_file()
    unfinished = results.ResultsFolder.create(root)
    with pytest.raises(EvaluationError, match='not complete'):
        unfinished.finish()
    assert (root / 'latest').resolve() == final


def test_two_folders_of_one_second(tmp_path):
    now = datetime(2026, 1, 2, 3, 4, 5, tzinfo=timezone.utc)
    names = [results.ResultsFolder.create(tmp_path, now).path.name for _ in range(2)]
    assert names == ['2026-01-02T03-04-05Z.partial', '2026-01-02T03-04-05Z-2.partial']


def test_json_has_no_nan(tmp_path):
    folder = results.ResultsFolder.create(tmp_path)
    folder.write_json('a.json', {'x': float('nan'), 'y': [np.float32(0.5), np.int64(3)]})
    assert results.read_json(folder.path / 'a.json') == {'x': None, 'y': [0.5, 3]}
    with pytest.raises(EvaluationError, match='cannot be read'):
        results.read_json(folder.path / 'b.json')


def test_environment_names_what_figures_depend_on():
    found = environment()
    assert found['python']
    assert found['versions']['numpy']
    assert found['versions']['opencv']


# without ground truth ------------------------------------------------------------------------

@pytest.fixture(scope='module')
def bare_records():
    labels = unlabelled(np.arange(COUNT) * 10**9)
    return make_records(labels, decide(range(30, 60)), make_runs())


@pytest.fixture
def bare(bare_records):
    return summarise('walks', bare_records, ATTACKS,
                     GraphStatistics.of([300] * COUNT, [900] * COUNT), seed=1)


def test_without_ground_truth_changes_are_counted_and_nothing_else(bare, bare_records):
    assert not bare['labelled']
    for figures in (bare, bare['clean'], *bare['attacks']):
        unknown = {'positives', 'tp', 'fp', 'recall', 'balanced_accuracy', 'suppressed',
                   'decline_pp', 'wrong_closures_unscored'} & set(figures)
        assert all(figures[name] is None for name in unknown)
    eigen, walk = bare['attacks']
    # Silenced: 30 to 34. Raised: 20. With another match: 40.
    assert bare['clean']['loops_declared'] == 30
    counted = [eigen[name] for name in ('silenced', 'raised', 'redirected', 'changed')]
    assert counted == [5, 1, 1, 7]
    assert eigen['success_rate'] == 7 / 54
    assert eigen['agreement'] == 53 / 60
    assert (walk['changed'], walk['agreement'], walk['success_rate']) == (0, 1.0, 0.0)
    effects = [record.effect for record in runs_of(bare_records)['eigen']]
    assert [effects[k] for k in (20, 30, 40, 50)] == ['raised', 'silenced', 'redirected', '']
    assert json.loads(json.dumps(bare, allow_nan=False)) == bare


def test_with_ground_truth_changes_are_counted_as_well(summary):
    assert summary['labelled']
    assert summary['attacks'][0]['changed'] == 7
    assert summary['clean']['loops_declared'] == 30


def test_the_headline_without_ground_truth_claims_no_accuracy(bare):
    text = findings.headline(bare)
    assert '30 loops in 60 frames' in text
    assert 'changed 7 decisions' in text
    assert 'Without ground truth nobody can say' in text
    assert 'accuracy' not in text
    assert 'nobody can say' in findings.headline({**bare, 'attacks': []})


def test_no_attack_that_could_be_made_is_no_rate(bare_records):
    reports = [report_of(index, status='skipped', edit_budget=0, edits=0, queries=0)
               for index in range(COUNT)]
    records = make_records(unlabelled(np.arange(COUNT) * 10**9), decide(range(30, 60)),
                           {'eigen': AttackRun(decide(range(30, 60)), reports)})
    found = summarise('walks', records, {'eigen': AttackConfig()},
                      GraphStatistics.of([0] * COUNT, [0] * COUNT), seed=1)
    assert found['attacks'][0]['success_rate'] is None
    assert findings.headline(found).startswith('All 60 graphs of walks are empty')


def test_the_report_without_ground_truth_says_what_is_missing(bare, bare_records, tmp_path):
    folder = results.ResultsFolder.create(tmp_path, datetime(2026, 1, 1, tzinfo=timezone.utc))
    folder.write_setup([LcdConfig()], ['adversarial-lcd', 'evaluate'], 42)
    folder.write_json('summary.json', as_document(bare))
    write_records(folder.path / 'per_query.csv', bare_records)
    page = report.write_report(folder.path, bare, bare_records, []).read_text()
    for said in ('What each attack changed', 'No accuracy, precision, recall or curve',
                 'No frame has ground truth', '7 of 60', 'silenced'):
        assert said in page
    for unsaid in ('None', 'a new place', 'Decline', 'block bootstrap'):
        assert unsaid not in page
    assert report.report_folder(folder.path).read_text() == page
    title, rows = replay_lines(bare)
    assert 'no ground truth' in title
    assert rows[0]['changed'] == '7'


def test_pictures_without_ground_truth_show_what_changed(bare_records):
    runs = runs_of(bare_records)
    chosen = choose_records(runs['eigen'], 3)
    assert [record.effect for record in chosen] == ['raised', 'silenced', 'redirected']
    assert 'another frame' in describe(chosen[2], runs['clean'][40])[1]
    assert describe(runs['eigen'][50], runs['clean'][50])[0] == 'Frame 50: unchanged'
