# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rings: walls and posters in views, worst cases, the page, and the recipe as a whole."""

from dataclasses import replace
import json
from types import SimpleNamespace

import cv2
from graph_factory import make_graph
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from results_factory import ring_row

from adversarial_lcd_ros.attack.searches import make_search
from adversarial_lcd_ros.config import AttackConfig, BuilderConfig, LabelConfig, LcdConfig
from adversarial_lcd_ros.errors import ConfigError, EvaluationError
from adversarial_lcd_ros.evaluation.frames.recipe import load_cells
from adversarial_lcd_ros.evaluation.kinds import open_results
from adversarial_lcd_ros.evaluation.recipes import read_recipe
from adversarial_lcd_ros.evaluation.rings import plots
from adversarial_lcd_ros.evaluation.rings import run as rings_run
from adversarial_lcd_ros.evaluation.rings.html import headline, rings_html
from adversarial_lcd_ros.evaluation.rings.page import rings_page
from adversarial_lcd_ros.evaluation.rings.posters import (
    PairTask,
    PosterConfig,
    conditions_of,
    counts,
    poster_config,
    poster_streams,
    poster_tasks,
    run_pair,
    scene_of,
)
from adversarial_lcd_ros.evaluation.rings.prices import sealing_us
from adversarial_lcd_ros.evaluation.rings.report import write_rings
from adversarial_lcd_ros.evaluation.rings.scene import BARE, OTHER, SAME, Condition, Scene
from adversarial_lcd_ros.evaluation.rings.summaries import (
    ANY,
    FLIPS,
    NODES,
    WITHIN_NODES,
    WITHIN_R,
    defence_title,
    ring_of,
    summarise,
    worst_cases,
)
from adversarial_lcd_ros.evaluation.rings.tables import ranking, standings
from adversarial_lcd_ros.evaluation.rings.walls import Camera, find_wall
from adversarial_lcd_ros.evaluation.streams import GraphSource, graphs_digest
from adversarial_lcd_ros.graph_sequences.opening import open_graphs
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.paths import share_path
from adversarial_lcd_ros.registry import SEARCHES
from adversarial_lcd_ros.vision.builder import GraphBuilder

CAMERA = Camera(np.eye(3), np.zeros(3), 0.785, 640, 480)


def slanted(slope, far=3.0, rows=48, columns=64):
    """Return the depth of a wall that recedes to the right."""
    x = (np.arange(columns) + 0.5 - columns / 2) / (0.785 * columns)
    return np.repeat((far / (1 - slope * x))[None].astype(np.float32), rows, axis=0)


@settings(max_examples=30)
@given(st.floats(-0.8, 0.8), st.sampled_from([0.02, 0.05, 0.1]), st.integers(0, 99))
def test_a_square_on_a_wall_is_of_its_size_and_square(slope, share, seed):
    world = find_wall(CAMERA, slanted(slope), share, np.random.default_rng(seed))
    if world is None:
        return  # no place tried had room for it
    pixels = CAMERA.pixels(world)
    area = cv2.contourArea(pixels.astype(np.float32)) / (640 * 480)
    assert abs(area - share) < 0.1 * share
    sides = np.linalg.norm(world - np.roll(world, 1, axis=0), axis=1)
    np.testing.assert_allclose(sides, sides[0], rtol=1e-6)
    # On the plane: depth is what the wall's is there.
    x = (pixels[:, 0] - 320) / (0.785 * 640)
    np.testing.assert_allclose(world[:, 2], 3.0 / (1 - slope * x), rtol=0.02)
    # From the upper left on, clockwise as seen.
    assert pixels[0, 0] < pixels[1, 0]
    assert pixels[0, 1] < pixels[3, 1]


def test_most_of_a_plain_wall_has_room():
    found = [find_wall(CAMERA, slanted(0.3), 0.05, np.random.default_rng(seed))
             for seed in range(20)]
    assert sum(each is not None for each in found) >= 19


def test_no_wall_where_depth_is_unknown_or_rough():
    rough = np.random.default_rng(1).uniform(1, 4, (48, 64)).astype(np.float32)
    for depth in (np.zeros((48, 64), np.float32), rough):
        assert find_wall(CAMERA, depth, 0.05, np.random.default_rng(1)) is None


def test_another_camera_sees_the_same_square_where_it_is():
    moved = replace(CAMERA, centre=np.array([0.5, 0.0, 0.0]))
    world = find_wall(CAMERA, slanted(0.0), 0.05, np.random.default_rng(1))
    shift = moved.pixels(world) - CAMERA.pixels(world)
    np.testing.assert_allclose(shift[:, 0], -0.5 * 0.785 * 640 / 3.0, rtol=1e-6)
    np.testing.assert_allclose(shift[:, 1], 0, atol=1e-9)
    assert moved.pixels(world - (0, 0, 5)) is None


def scene(depth=True):
    image = {index: np.full((480, 640, 3), 128, np.uint8) for index in (3, 4, 5, 9)}
    cameras = {index: replace(CAMERA, centre=np.array([0.1 * index, 0, 0])) for index in image}
    return Scene(((4, 3, 5), (9,)), image, cameras if depth else {},
                 {index: slanted(0.1) for index in image} if depth else {}, 7)


@pytest.mark.parametrize('depth', [True, False])
def test_a_scene_is_posted_in_all_its_frames_and_repeatably(depth):
    condition = Condition('cells', 0.05)
    posted, walls = scene(depth).posted(condition)
    again, _ = scene(depth).posted(condition)
    assert walls == (2 if depth else 0)
    for index, image in posted.items():
        changed = (image != 128).any(axis=2).mean()
        assert 0.025 < changed < 0.1
        np.testing.assert_array_equal(image, again[index])


def test_controls_and_two_posters():
    bare, _ = scene().posted(Condition('none', 0.0, 0, BARE))
    assert all((image == 128).all() for image in bare.values())
    same, other = (scene().posted(Condition('cells', 0.1, 1, control))[0]
                   for control in (SAME, OTHER))
    np.testing.assert_array_equal(same[4], other[4])
    assert (same[9] != other[9]).any()
    two, walls = scene().posted(Condition('cells', 0.1, 2))
    parts = cv2.connectedComponents((np.abs(two[9].astype(int) - 128) > 40).any(
        axis=2).astype(np.uint8) * 255)[0]
    assert walls == 0
    assert parts > 2
    assert 0.05 < (two[9] != 128).any(axis=2).mean() < 0.2


KEPT, LOST = (1, 'TP', 'TP'), (1, 'TP', 'FN')
LEFT, MADE = (-1, 'TN', 'TN'), (-1, 'TN', 'FP')
ROWS = [ring_row('', 'recall', 'recall', [KEPT, LOST, LEFT, MADE]),
        ring_row('', 'move_nodes', '40 nodes', [LOST, KEPT, LEFT, MADE]),
        ring_row('defences rederive', 'recall', 'recall', [KEPT, KEPT, LEFT, LEFT]),
        ring_row('defences rederive', 'replay', 'replay', [KEPT, KEPT, MADE, MADE], aware=False)]


def test_an_entry_counts_what_changed():
    entry = summarise(ROWS, 1)[0]
    assert (entry['suppressed'], entry['invented'], entry['invented_elsewhere']) == (1, 1, 1)
    assert (entry['balanced_clean'], entry['balanced_attacked']) == (1.0, 0.5)
    assert entry['decline_pp'] == 50
    assert entry['ring'] == FLIPS
    assert [each['attack'] for each in summarise(ROWS, 1)][3] == 'replay, unaware'


def test_seeds_of_an_attack_are_one_entry():
    again = ring_row('', 'recall', 'recall', [KEPT, KEPT, LEFT, LEFT], seed=43)
    entry = summarise([ROWS[0], again], 1)[0]
    assert (entry['seeds'], entry['frames'], entry['different_frames']) == (2, 8, 4)
    assert entry['decline_pp'] == 25


def test_the_worst_case_is_no_better_than_any_attack_of_its_rings():
    worst = {(each['defence'], each['level']): each['balanced'] for each in worst_cases(ROWS, 1)}
    assert worst == {('none', WITHIN_R): 0.5, ('none', WITHIN_NODES): 0.25,
                     ('rederive', WITHIN_R): 1.0, ('rederive', ANY): 0.5}


SEALED = [ring_row('', 'recall', 'recall', [KEPT, LEFT], sealed=True),
          ring_row('', 'replay', 'replay', [LOST, LEFT], sealed=True, aware=False)]
for refused, result in zip(('age', 'replayed'), SEALED[1]['frame_results'], strict=True):
    result['refused'] = refused


def test_what_was_refused_is_counted_and_is_no_success_of_the_attacker():
    held, lost = summarise(SEALED, 1)
    assert {entry['defence'] for entry in (held, lost)} == {'sealed graphs'}
    assert (held['refused'], lost['refused']) == ({}, {'age': 1, 'replayed': 1})
    assert (held['decline_pp'], lost['decline_pp']) == (0, 50)
    by_level = {each['level']: each for each in worst_cases(SEALED, 1)}
    assert (by_level[WITHIN_R]['balanced'], by_level[WITHIN_R]['balanced_or_refused']) == (
        1.0, None)
    assert (by_level[ANY]['balanced'], by_level[ANY]['balanced_or_refused']) == (0.5, 1.0)


def test_unexplained_edges_are_averaged_where_they_were_counted():
    counted = ring_row('defences rederive_check', 'recall', 'recall', [KEPT, LEFT])
    for at, frame in enumerate(counted['frame_results']):
        frame |= {'unexplained_clean': 0, 'unexplained': 20 + at}
    entry, other = summarise([counted, ROWS[0]], 1)
    assert (entry['unexplained_clean_mean'], entry['unexplained_mean']) == (0.0, 20.5)
    assert (other['unexplained_clean_mean'], other['unexplained_mean']) == (None, None)


def test_a_threshold_is_a_defence_of_its_own():
    assert defence_title({'detector': '', 'threshold': 0.99}) == 'threshold 0.99'
    assert defence_title({'detector': 'defences x', 'threshold': 0.9}) == (
        'x, threshold 0.9')


POSTERS = [{'sequence': 'tour', 'earlier': 1, 'later': 9, 'kind': condition.kind,
            'share': condition.share, 'count': condition.count, 'control': condition.control,
            'on_wall': 2, 'target': 'wl', 'check': check, 'declared': True, 'to_poster': at < 2,
            'elsewhere': True}
           for condition in conditions_of(PosterConfig())
           for check in ('none', 'hull') for at in range(3)]


def test_the_page_is_of_the_summary_alone(tmp_path):
    prices = [{'sequence': 'tour', 'defence': 'none', 'decision_us': 9.0, 'more_us': 0.0}]
    path = write_rings(tmp_path, ROWS, POSTERS, prices)
    text = path.read_text()
    summary = json.loads((tmp_path / 'summary.json').read_text())
    assert rings_page(summary) in text
    assert '| recall | 50.0 (' in text
    assert '2 (+1)' in text
    assert 'replay, unaware' in text
    assert (tmp_path / 'rings.svg').read_bytes().startswith(b'<?xml')


def test_targets_are_kept_apart_and_refusals_shown(tmp_path):
    rows = [*ROWS, *SEALED, ring_row('', 'replay', 'replay', [LOST, LOST, MADE, MADE]),
            ring_row('', 'recall', 'recall', [LOST, LEFT], target='symbio')]
    prices = [{'sequence': 'tour', 'target': target, 'defence': 'none', 'decision_us': 9.0,
               'more_us': more} for target, more in (('wl', 0.0), ('symbio', 7.0))]
    text = write_rings(tmp_path, rows, [], prices).read_text().replace('\u202f', ' ')
    first, second = text.split('### Target wl')[1].split('### Target symbio')
    assert '| tour | none | 100.0 % | 50.0 % (' in first
    assert 'or refused 100.0 %' in first
    assert '| tour | none | 100.0 % | 50.0 % (50.0 to 50.0; 1 attack) | n/a | n/a | +7 |' in (
        second)
    assert '## tour, wl: decline in points' in second
    assert '2 refused |' in text
    assert '| age 1, replayed 1 |' in text
    assert 'Sealed graphs: builder and detector share a key.' in text
    # The same in the report, where each has the price of its own target.
    summary = json.loads((tmp_path / 'summary.json').read_text())
    assert {(entry.target, entry.more_us) for entry in standings(summary)
            if entry.defence == 'none'} == {('wl', 0.0), ('symbio', 7.0)}
    (tmp_path / 'configuration.json').write_text('{"settings": []}')
    (tmp_path / 'environment.json').write_text('{"time_utc": "2026-01-02T03:04:05Z"}')
    report = rings_html(tmp_path, summary, b'').replace('\u202f', ' ')
    assert ', refused: age 1, replayed 1</small>' in report
    assert ', or refused 100 %' in report
    assert [rank.defence for rank in ranking(summary) if rank.target == 'wl'] == [
        'sealed graphs', 'rederive', 'none']
    assert 'Sealed graphs refuse what was changed, with an alarm each: counting that as ' in report
    assert 'failed attack, 100.0 % are left.' in report
    assert '<small>100.0 % or refused</small>' in report
    assert 'tour, wl: 3 frames with a loop, 3 at a new place' in report
    assert 'Sealed graphs: builder and detector share a key.' in report
    # A folder from before there were seals and counts.
    old = tmp_path / 'old'
    old.mkdir()
    assert 'Sealed graphs' not in write_rings(old, ROWS, [], []).read_text()


def test_defences_are_ranked_by_what_is_left_over_all_sequences():
    def summary(held):
        rows = [{'sequence': sequence, 'target': 'wl', 'defence': defence, 'balanced_clean': 1.0}
                for sequence in 'ab' for defence in ('none', 'x', 'half')]
        return {'rows': rows, 'prices': [], 'worst': [
            {'sequence': sequence, 'target': 'wl', 'defence': defence, 'level': WITHIN_R,
             'balanced': value, 'attacks': 2} for (sequence, defence), value in held.items()]}
    ranks = ranking(summary({('a', 'none'): .2, ('b', 'none'): .4, ('a', 'x'): .9,
                             ('b', 'x'): .5, ('a', 'half'): 1.0}))
    # Of "half" nothing is known on b: it cannot be first.
    assert [(rank.defence, rank.held[0]) for rank in ranks] == [
        ('x', pytest.approx(.7)), ('none', pytest.approx(.3)), ('half', None)]
    said = headline(ranks)
    assert 'leaves 30.0' in said
    assert 'behind x, 70.0' in said
    assert 'no defence that was tried leaves more' in headline(ranking(summary({
        (sequence, defence): .5 for sequence in 'ab' for defence in ('none', 'x')})))


def test_the_same_nodes_close_and_far_apart_are_two_curves():
    rows = summarise([ring_row('', 'move_nodes', name, [LOST, LEFT], moved=moved,
                               variant=f'moved {moved}')
                      for moved in ('close', 'spread') for name in ('40', '80')], 1)
    for row, budget in zip(rows, (40, 80, 40, 80), strict=True):
        row['node_budget_mean'] = budget
    lines = plots._over(rows, 'nodes', 'move_nodes')
    assert {title: {at: point.value for at, point in line.items()}
            for title, line in lines.items()} == {
        ('tour', 'close: none'): {40: 50.0, 80: 50.0},
        ('tour', 'spread: none'): {40: 50.0, 80: 50.0}}


def test_points_of_curves_have_intervals():
    row = summarise([ring_row('', 'recall', 'recall', [LOST, LEFT])], 1)[0]
    line, = plots._over([{**row, 'ci95': [20.0, 70.0]}, {**row, 'ratio': 9.0, 'ci95': None}],
                        'ratio', plots.FLIPS).values()
    assert line == {row['ratio']: (50.0, 20.0, 70.0), 9.0: (50.0, 50.0, 50.0)}
    posters = [{'sequence': 'tour', 'control': plots.SAME, 'count': 1, 'kind': 'cells',
                'target': 'wl', 'check': 'none', 'share': share, 'to_poster': fooled, 'pairs': 12}
               for share, fooled in ((.1, 0), (.2, 12))]
    line, = plots._posters(posters).values()
    # Wilson's interval of 0 of 12 ends at z^2 / (n + z^2).
    assert line[.1] == pytest.approx((0.0, 0.0, 3.8415 / 15.8415), abs=1e-4)
    assert line[.2] == pytest.approx((1.0, 1 - 3.8415 / 15.8415, 1.0), abs=1e-4)


def test_a_seal_has_a_price():
    graphs = [replace(make_graph(300, [], objects=5, seed=seed), sequence=seed)
              for seed in range(5)]
    # An HMAC of some 20 kB at both ends.
    assert 0 < sealing_us(graphs) < 100_000


def test_posters_are_counted_by_condition():
    found = counts(POSTERS)
    assert len(found) == 2 * len(conditions_of(PosterConfig()))
    assert all((each['pairs'], each['to_poster'], each['elsewhere']) == (3, 2, 3)
               for each in found)


@pytest.mark.parametrize(('values', 'said'), [
    ([1], 'settings by name'), ({'shares': 'a'}, 'expected shares'), ({'pairs': 0}, 'pairs'),
    ({'kinds': 'cloth'}, 'textures of'), ({'checks': {'hull': 3}}, 'checks of the posters'),
    ({'checks': {'hull': {'moat': 1}}}, 'unknown setting'), ({'walls': 2}, 'unknown setting')])
def test_wrong_posters_are_refused(tmp_path, values, said):
    with pytest.raises(ConfigError, match=said):
        poster_config(values, tmp_path)


def test_the_recipe_has_every_defence_beside_one_who_knows_it():
    cells = load_cells('rings', {})
    path, recipe = read_recipe('rings')
    config, checks = poster_config(recipe['posters'], path)
    assert {cell.search for cell in cells} == {
        'stepwise', 'recall', 'optimum', 'move_nodes', 'replay'}
    defences = {dict(cell.detector).get('defences', 'none') for cell in cells}
    assert defences == {'none', 'rederive', 'rederive_check', 'nearest_check', 'length_check',
                        'geometric_check', 'common_part',
                        'rederive, length_check, geometric_check'}
    # What only counts edges judges as if it were not there.
    for named in defences - {'rederive_check'}:
        searches = {cell.search for cell in cells if cell.aware
                    and dict(cell.detector).get('defences', 'none') == named}
        assert {'recall', 'move_nodes', 'replay'} <= searches
    assert any(cell.attack.lengths for cell in cells)
    within = {dict(cell.detector).get('nearest_neighbours', 12) for cell in cells
              if cell.detector and cell.attack.nearest == dict(cell.detector).get(
                  'nearest_neighbours', 12)}
    assert within == {12, 20, 40}
    assert {(cell.search, cell.aware) for cell in cells if cell.sealed} == {
        (search, aware) for search in ('recall', 'move_nodes', 'replay')
        for aware in (True, False)}
    assert {cell.method for cell in cells if cell.target == 'symbio'} == {
        'eigencentrality', 'recall', 'replay', 'optimum'}
    assert dict(checks)['check and hull'] == LcdConfig(defences='geometric_check',
                                                       geometric_hull=0.1)
    assert {condition.count for condition in conditions_of(config)} == {0, 1, 2}


@pytest.mark.parametrize('name', list(SEARCHES))
def test_an_attack_counts_by_what_its_search_changes(name):
    search = make_search(AttackConfig(search=name))
    graph = make_graph(60, [(0, 1)])
    search.observe(graph)
    assert (search.budget(graph).nodes > 0) == (ring_of({'search': name}) == NODES)


def test_posters_that_hang_already_are_not_hung_again(tmp_path, monkeypatch):
    stream = SimpleNamespace(name='tour', digest='a')
    tasks = [SimpleNamespace(sequence='tour', later=later) for later in (5, 3)]
    monkeypatch.setattr(rings_run, 'poster_tasks', lambda *_: tasks)
    asked = []

    def run(function, some):
        for task in some:
            asked.append(task.later)
            yield [{'sequence': task.sequence, 'later': task.later}]

    def rows_of(stream):
        rows, hung = rings_run.run_posters(tmp_path, [stream], PosterConfig(), (), LcdConfig(),
                                           LabelConfig(), run, lambda done, total: None)
        assert hung == tasks
        return rows

    first = rows_of(stream)
    assert [row['later'] for row in first] == [3, 5]
    assert rows_of(stream) == first
    assert asked == [5, 3]
    (tmp_path / rings_run.POSTERS).write_text('{"rows": 7}')
    rows_of(stream)
    rows_of(SimpleNamespace(name='tour', digest='b'))
    assert asked == [5, 3] * 3


def test_a_folder_of_rings_is_read_reported_and_compared(tmp_path):
    prices = [{'sequence': 'tour', 'defence': 'none', 'decision_us': 9.0, 'more_us': 0.0}]
    page = write_rings(tmp_path, ROWS, POSTERS, prices).read_text()
    (tmp_path / 'configuration.json').write_text('{"settings": []}')
    (tmp_path / 'environment.json').write_text('{"time_utc": "2026-01-02T03:04:05Z"}')
    kind, results = open_results(tmp_path)
    assert kind.name == 'rings'
    assert kind.report(results).read_text() == page
    report = (tmp_path / 'report.html').read_text()
    assert 'detector wl' in report
    assert '>replay, unaware<' in report
    assert len(kind.tables(results)[0].rows) == len(results.rows) == 4
    rows = [(figure.row, figure.name) for figure in kind.figures(results)]
    assert len(set(rows)) == len(rows)
    summary = json.loads((tmp_path / 'summary.json').read_text())
    (tmp_path / 'summary.json').write_text(json.dumps({**summary, 'worst': 3}))
    with pytest.raises(EvaluationError, match='damaged'):
        open_results(tmp_path)


def test_each_detector_gets_posted_graphs_of_the_variant_it_needs(tmp_path):
    source = f'{share_path("bags/flat_tour")}@0:0.12'
    small = {'detector': 'none', 'features': 150}
    stored = {variant: open_graphs(source, BuilderConfig(graph_variant=variant, **small),
                                   tmp_path).graphs for variant in ('tiers', 'anchors')}
    tiers = BuilderConfig(**small)
    # The stream of another target's graphs does as well.
    for variant, graphs in stored.items():
        task = PairTask(
            'tour', GraphSource(source, replace(tiers, graph_variant=variant), tmp_path,
                                graphs_digest(graphs)), tiers, 5, 40, np.ones(43, bool),
            (Condition('cells', 0.3), Condition('none', 0.0, 0, BARE)), ('wl', 'symbio'),
            (('check', LcdConfig(defences='geometric_check')),), LcdConfig(min_gap_s=2.0),
            0.82, 42)
        rows = run_pair(task)
        assert [(row['kind'], row['target'], row['check']) for row in rows] == [
            (kind, target, check) for kind in ('cells', 'none') for target in ('wl', 'symbio')
            for check in ('none', 'check')]
        posted, _ = scene_of(task, graphs).posted(task.conditions[0])
        for target, made in (('wl', 'tiers'), ('symbio', 'anchors')):
            clean = stored[made]
            with GraphBuilder(BuilderConfig(graph_variant=made, **small)) as builder:
                built = {index: builder.build(image, clean[index].stamp_ns)
                         for index, image in posted.items()}
            detector = LoopClosureDetector(LcdConfig(target=target, min_gap_s=2.0))
            for index in range(40):
                detector.remember(built.get(index, clean[index]))
            decision = detector.judge(built[40])
            row = next(row for row in rows if row['target'] == target)
            assert row['declared'] == decision.is_loop
            assert row['to_poster'] == (decision.is_loop and decision.match_stamp_ns in {
                clean[index].stamp_ns for index in (4, 5, 6)})
        assert any(row['to_poster'] for row in rows if row['target'] == 'symbio')


def some_stream(name, nodes, variant=''):
    labels = SimpleNamespace(kind=np.zeros(30), elsewhere=np.ones((30, 30), bool),
                             candidates=np.arange(30))
    builder = BuilderConfig(graph_variant=variant or 'tiers')
    return SimpleNamespace(name=name, nodes=nodes, variant=variant, labels=labels,
                           graphs=GraphSource(name, builder, None, ''))


def test_posters_hang_once_in_each_sequence_in_graphs_for_any_target():
    tour, small, anchored = (some_stream('tour', 300), some_stream('tour', 100),
                             some_stream('tour', 300, 'anchors'))
    other = some_stream('other', 300, 'anchors')
    assert poster_streams([small, tour, anchored, other]) == [tour, other]
    for stream in (tour, other):
        tasks = poster_tasks(stream, PosterConfig(pairs=2), LcdConfig(), (), LabelConfig())
        assert [(task.graphs, task.builder) for task in tasks] == [
            (stream.graphs, BuilderConfig())] * 2
