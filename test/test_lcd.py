# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The detector: scores by hand, retrieval, gap, and queries that leave no trace."""

from dataclasses import replace
import json
import shutil

from graph_factory import flips_of, graphs, make_graph, suited
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.errors import ConfigError, ModelError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.keyframes.database import Database, bow_score
from adversarial_lcd_ros.lcd.decision import FORMAT, Decision, probability
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.targets import TARGETS, make_target
from adversarial_lcd_ros.lcd.targets.gnn import NETWORK
from adversarial_lcd_ros.lcd.views import Comparison, View
from adversarial_lcd_ros.messages.types import LcdQuery
from adversarial_lcd_ros.paths import model_path

GRAPH = make_graph(40, [(0, 1), *((0, k) for k in range(2, 12)), *((1, k) for k in range(12, 20)),
                        *((k, k + 1) for k in range(2, 39))], objects=2)


@pytest.fixture
def model(tmp_path):
    """Return a function that writes a decision for a target and returns its path."""
    def write(target='wl'):
        channels = TARGETS[target].channels
        path = tmp_path / f'{target}.json'
        Decision(target, channels, (10.0,) * len(channels), -10.0).save(path)
        if target == 'gnn':
            shutil.copy(model_path(NETWORK), path.with_suffix('.onnx'))
        return str(path)
    return write


def scores(target, query, reference):
    view = View(query)
    found, = make_target(target).compare(view, Comparison(view, [View(reference)]))
    return dict(zip(TARGETS[target].channels, found, strict=True))


def test_a_graph_is_most_like_itself():
    root = np.sqrt(0.6)
    assert scores('descriptors', GRAPH, GRAPH)['features'] == pytest.approx(root, abs=1e-6)
    found = scores('wl', GRAPH, GRAPH)
    assert found['features'] == pytest.approx(root, abs=1e-6)
    assert found['objects'] == pytest.approx(1, abs=1e-6)
    assert scores('vbow', GRAPH, GRAPH)['words'] == pytest.approx(1, abs=1e-6)


def test_edge_score_counts_edges_between_matched_features():
    # 37 of 56 edges join two features; objects have no descriptor to match.
    assert scores('edges', GRAPH, GRAPH)['edges'] == pytest.approx(37 * 0.6 / 56, abs=1e-6)
    fewer = GRAPH.flip([(2, 3)])
    assert scores('edges', fewer, GRAPH)['edges'] == pytest.approx(36 * 0.6 / 55.5, abs=1e-6)


def test_objects_counts_what_recurs_in_class_size_and_arrangement():
    classes, square = [3, 5, 5], np.array([[100, 100], [300, 100], [300, 400]], np.float32)
    fields = {'label': np.array(classes, np.uint32), 'position': square,
              'size': np.full((3, 2), 40, np.float32)}
    query = make_graph(3, [(0, 1), (0, 2), (1, 2)], objects=3, **fields)
    whole = pytest.approx({'objects': 1, 'edges': 1})
    assert scores('objects', query, query) == whole
    moved = make_graph(3, [(0, 1), (0, 2), (1, 2)], objects=3,
                       **{**fields, 'position': square + np.float32([50, 20])})
    assert scores('objects', query, moved) == whole
    smaller = make_graph(3, [(0, 1), (0, 2), (1, 2)], objects=3,
                         **{**fields, 'size': np.full((3, 2), 20, np.float32)})
    assert scores('objects', query, smaller)['objects'] == pytest.approx((21 / 41) ** 2)
    fewer = scores('objects', query.flip([[1, 2]]), query)
    assert max(fewer.values()) < 1
    # The numbers of the classes are names, however large.
    renamed = [make_graph(3, [(0, 1), (0, 2), *more], objects=3, **{
        **fields, 'label': np.array([65_000, 7, 7], np.uint32)}) for more in ([], [(1, 2)])]
    assert scores('objects', *renamed) == pytest.approx(fewer)


@pytest.mark.parametrize('target', ['descriptors', 'vbow'])
@given(st.integers(0, 2**16))
@settings(max_examples=20)
def test_controls_are_immune_to_flips(target, seed):
    flips = flips_of(GRAPH, np.random.default_rng(seed), 20)
    assert scores(target, GRAPH.flip(flips), GRAPH) == scores(target, GRAPH, GRAPH)


@pytest.mark.parametrize('target', list(TARGETS))
@given(graphs(), graphs())
@settings(max_examples=30)
def test_scores_are_finite_and_not_negative(target, query, reference):
    found = np.array(list(scores(target, query, reference).values()))
    assert np.isfinite(found).all()
    assert (found >= 0).all()


@pytest.mark.parametrize('target', list(TARGETS))
def test_empty_graphs_are_like_nothing(target):
    empty = MultiTierGraph(0, '', 0, 640, 480)
    assert not any(scores(target, empty, GRAPH).values())
    assert not any(scores(target, empty, empty).values())


@given(graphs(), st.integers(0, 2**16))
@settings(max_examples=30)
def test_the_order_of_features_does_not_matter(graph, seed):
    first = graph.object_count
    rng = np.random.default_rng(seed)
    order = np.r_[np.arange(first), first + rng.permutation(graph.node_count - first)]
    place = np.argsort(order)
    edge = np.sort(place[graph.edge.astype(int)], axis=1).reshape(-1, 2)
    rank = np.lexsort((edge[:, 1], edge[:, 0]))
    shuffled = replace(
        graph, **{name: getattr(graph, name)[order] for name in
                  ('tier', 'label', 'position', 'size', 'score', 'descriptor')},
        edge=edge[rank].astype(np.uint32), edge_length=graph.edge_length[rank])
    reference = GRAPH
    for target in TARGETS:
        assert scores(target, shuffled, reference) == pytest.approx(
            scores(target, graph, reference), abs=1e-5)


@given(st.lists(graphs(min_nodes=1), min_size=1, max_size=6), graphs(min_nodes=1))
@settings(max_examples=30)
def test_the_database_scores_like_the_pairwise_score(stored, query):
    database = Database()
    for graph in stored:
        database.add(graph)
    assert database.scores(query) == pytest.approx([bow_score(query, g) for g in stored], abs=1e-6)


def at(seconds, seed=0, sequence=0):
    return replace(make_graph(40, GRAPH.edge.tolist(), seed=seed),
                   stamp_ns=round(seconds * 1e9), sequence=sequence)


def test_a_revisit_is_a_loop_and_a_new_place_is_not(model):
    detector = LoopClosureDetector(LcdConfig(model=model(), min_gap_s=5.0, map_window=0))
    for second in range(10):
        assert not detector.detect(at(second, seed=second, sequence=second)).is_loop
    decision = detector.detect(at(20, seed=3, sequence=20))
    assert decision.is_loop
    assert (decision.match_sequence, decision.match_stamp_ns) == (3, 3_000_000_000)
    assert decision.sequence == 20


def test_keyframes_within_the_gap_are_no_candidates(model):
    detector = LoopClosureDetector(LcdConfig(model=model(), min_gap_s=5.0))
    detector.detect(at(0))
    assert detector.judge(at(4.9)).match_stamp_ns is None
    assert detector.judge(at(5)).match_stamp_ns == 0


def test_a_query_leaves_no_trace(model):
    detector = LoopClosureDetector(LcdConfig(model=model(), min_gap_s=1.0))
    detector.detect(at(0))
    before = detector.judge(at(5))
    for number in range(5):
        answer = detector.answer(LcdQuery(number, at(5).flip([(2, 3), (4, 9)])))
        assert answer.id == number
    assert detector.keyframe_count == 1
    assert detector.detect(at(5)) == before


def test_reuse_between_queries_does_not_change_the_answer(model):
    detector = LoopClosureDetector(LcdConfig(model=model(), min_gap_s=1.0))
    fresh = LoopClosureDetector(LcdConfig(model=model(), min_gap_s=1.0))
    for second in range(4):
        detector.detect(at(second, seed=second))
        fresh.detect(at(second, seed=second))
    detector.judge(at(9))
    flipped = at(9).flip([(0, 9), (4, 20), (30, 31)])
    assert detector.judge(flipped) == fresh.judge(flipped)


def test_a_keyframe_is_prepared_once(model, monkeypatch):
    monkeypatch.setattr('adversarial_lcd_ros.lcd.detector.CACHED_VIEWS', 1)
    detector = LoopClosureDetector(LcdConfig(
        model=model(), min_gap_s=1.0, defences='own_defences:CountsPreparations'))
    defence, = detector.judging.scoring.defences
    for second in range(6):
        detector.detect(at(second, seed=second % 3))
        assert defence.asked == second + 1
    revisit = at(9, seed=1)
    for graph in (revisit, revisit.flip([(2, 3)]), revisit.flip([(4, 9)])):
        detector.judge(graph)
    assert defence.asked == 6 + 3


def map_of(model, target):
    """Return a function that makes detectors with the same keyframes: some alike, some not."""
    graph = suited(target, make_graph(
        30, [(k % 4, k) for k in range(5, 30)] + [(k, k + 2) for k in range(28)], objects=4,
        seed=5))
    stored = [replace(graph.flip(flips_of(graph, np.random.default_rng(second), 12)),
                      stamp_ns=second * 10**9, sequence=second) for second in range(3)]
    stored += [suited(target, at(second, seed=second)) for second in (3, 4)]

    def make():
        detector = LoopClosureDetector(
            LcdConfig(target=target, model=model(target), min_gap_s=1.0))
        for keyframe in stored:
            detector.detect(keyframe)
        return detector
    return replace(graph, stamp_ns=20 * 10**9), make


@pytest.mark.parametrize('target', list(TARGETS))
def test_what_was_judged_before_changes_no_bit_of_a_probability(model, target):
    graph, make = map_of(model, target)
    used = make()

    # The first call compiles.
    @settings(max_examples=12, deadline=None)
    @given(st.lists(st.tuples(st.integers(0, 2**16), st.integers(0, 40), st.booleans()),
                    min_size=2, max_size=4))
    def judge_in_turn(steps):
        used.judge(replace(graph, stamp_ns=30 * 10**9))  # the next one is a new base
        for seed, flips, stretched in steps:
            asked = graph.flip(flips_of(graph, np.random.default_rng(seed), flips))
            if stretched:
                asked = replace(asked, edge_length=asked.edge_length * np.float32(1.5))
            assert used.judge(asked) == make().judge(asked)

    judge_in_turn()


def test_a_flip_at_an_object_changes_the_score_of_objects():
    view = View(GRAPH)
    nodes = Comparison(view, [View(GRAPH), View(make_graph(40, seed=3))])
    scores = make_target('wl').prepare(view, nodes)
    flipped = View(GRAPH.flip([(0, 12), (0, 5), (2, 3)]), view)
    assert (scores(flipped) != scores(view)).any(axis=0).tolist() == [True, True, True]
    assert scores(flipped).tolist() == make_target('wl').compare(flipped, nodes).tolist()


def test_hard_answers_tell_the_decision_only(model):
    detector = LoopClosureDetector(LcdConfig(model=model(), min_gap_s=1.0, hard_answers=True))
    detector.detect(at(0))
    answer = detector.answer(LcdQuery(1, at(5)))
    assert not answer.is_soft
    assert answer.probability in (0.0, 1.0)


def moved(graph, seconds, shift):
    """Return what a graph's features look like from elsewhere: each moved by a vector."""
    return replace(graph, stamp_ns=seconds * 10**9, position=graph.position + np.float32(shift))


def test_the_geometric_check_wants_one_motion_for_all_features(model):
    def decide(graph, **settings):
        detector = LoopClosureDetector(LcdConfig(model=model(), min_gap_s=1.0, map_window=0,
                                                 threshold=0.4, **settings))
        detector.detect(at(0))
        return detector.judge(graph)

    nodes = len(at(0).position)
    steady = moved(at(0), 9, [4, 2])
    torn = moved(at(0), 9, np.random.default_rng(0).uniform(-200, 200, (nodes, 2)))
    assert decide(torn).is_loop
    assert decide(torn, geometric_check=True, geometric_inliers=18).probability < 0.4
    checked = decide(steady, geometric_check=True, geometric_inliers=18)
    assert checked == decide(steady)
    assert checked.is_loop


@pytest.mark.parametrize('limit', ['max_keyframes', 'max_keyframe_mb'])
def test_a_full_database_goes_on_judging(model, limit):
    # The first keyframe takes a block of 16 MB.
    detector = LoopClosureDetector(LcdConfig(model=model(), min_gap_s=1.0, **{limit: 1}))
    detector.detect(at(0))
    detector.detect(at(2, seed=1))
    assert detector.keyframe_count == 1
    assert detector.detect(at(5)).is_loop


@pytest.mark.parametrize(('text', 'said'), [
    ('not json', 'no trained decision'),
    ('{}', 'no trained decision'),
    (json.dumps({'format': 'x', 'target': 'wl', 'channels': [], 'weights': [], 'bias': 0}),
     'format'),
    (json.dumps({'format': 'adversarial_lcd_ros/decision/1', 'target': 'wl', 'channels': [],
                 'weights': [], 'bias': 0}), 'train it anew'),
    (json.dumps({'format': FORMAT, 'target': 'edges',
                 'channels': ['edges'], 'weights': [1], 'bias': 0}), 'trained for target edges'),
    (json.dumps({'format': FORMAT, 'target': 'wl',
                 'channels': ['edges', 'features', 'objects'], 'weights': [1], 'bias': 0}),
     '3 finite weights'),
])
def test_a_wrong_model_is_refused(tmp_path, text, said):
    path = tmp_path / 'model.json'
    path.write_text(text)
    with pytest.raises(ModelError, match=said):
        LoopClosureDetector(LcdConfig(model=str(path)))


def test_a_folder_of_trained_targets_serves_each(tmp_path):
    for target, bias in (('vbow', 1.0), ('descriptors', 2.0)):
        channels = make_target(target).channels
        Decision(target, channels, (1.0,) * len(channels), bias).save(
            tmp_path / f'target_{target}.json')
        detector = LoopClosureDetector(LcdConfig(target=target, model=str(tmp_path)))
        assert detector.decision.bias == bias
    with pytest.raises(ModelError, match='has no decision for the target wl; those trained there: '
                                         'descriptors, vbow'):
        LoopClosureDetector(LcdConfig(model=str(tmp_path)))


def test_an_unknown_target_is_refused():
    with pytest.raises(ConfigError, match='wl'):
        make_target('nonesuch')


def test_probability_of_extreme_odds():
    assert probability(-1000) == 0
    assert probability(1000) == 1
    assert probability(0) == 0.5


def test_exact_labels_of_one_differing_word_count_for_nothing():
    query = make_graph(3, [(0, 1), (1, 2)], objects=1, label=np.array([5, 7, 9], np.uint32))
    other = replace(query, label=np.array([5, 7, 8], np.uint32))
    # At iteration 0 two labels of three recur; at 1 only the object's, whose neighbour recurs.
    assert scores('wl_exact', query, query)['kernel'] == pytest.approx(1)
    assert scores('wl_exact', query, other)['kernel'] == pytest.approx(3 / 6)
    # An object of class 7 is not a feature of word 7.
    swapped = make_graph(3, [(0, 1), (1, 2)], objects=1, label=np.array([7, 5, 9], np.uint32))
    assert scores('wl_exact', query, swapped)['kernel'] == pytest.approx(1 / 6)


def test_the_network_sees_edges_and_a_damaged_one_is_refused(tmp_path):
    whole = scores('gnn', GRAPH, GRAPH)['matches']
    assert whole == pytest.approx(np.sqrt(0.6), abs=1e-5)
    assert scores('gnn', GRAPH.flip([(2, 3), (4, 30)]), GRAPH)['matches'] < whole - 1e-4
    (tmp_path / 'gnn.onnx').write_bytes(b'no network')
    with pytest.raises(ModelError, match='is no network'):
        make_target('gnn', tmp_path / 'gnn.onnx')
    with pytest.raises(ModelError, match='is no network'):
        make_target('gnn', tmp_path / 'missing.onnx')


@pytest.mark.parametrize('target', list(TARGETS))
def test_what_ships_belongs_to_its_target(target):
    detector = LoopClosureDetector(LcdConfig(target=target, min_gap_s=1.0))
    detector.detect(suited(target, at(0)))
    assert 0 < detector.judge(suited(target, at(9))).probability <= 1
