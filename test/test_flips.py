# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Log odds after single flips, against making each flip and asking the detector."""

from dataclasses import replace
import shutil

from graph_factory import flips_of, graphs, make_graph, suited
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.lcd.decision import KEPT_PERCENT, Decision
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.flips import FlipScorer, flip_logits
from adversarial_lcd_ros.lcd.targets import TARGETS
from adversarial_lcd_ros.lcd.targets.gnn import NETWORK
from adversarial_lcd_ros.paths import model_path

# Everything that a detector may have between a graph and its answer.
SETTINGS = {
    'plain': {}, 'geometric check': {'geometric_check': True, 'geometric_inliers': 15},
    'common part': {'defences': 'common_part', 'common_share': 0.6},
    'operating point': {'kept_loops': 0.7},
    **{name: {'defences': f'own_defences:{name}'} for name in (
        'DropsLongEdges', 'DropsAllAtThree', 'IgnoresEdges', 'CountsLikeLengths', 'RefusesEven')},
    'length check': {'defences': 'length_check', 'length_factor': 1.3},
    'rederive': {'defences': 'rederive', 'rederive_neighbours': 2},
    'rederive, length check': {'defences': 'length_check, rederive', 'rederive_neighbours': 2},
    'nearest check': {'defences': 'nearest_check', 'nearest_neighbours': 3},
    'hull': {'geometric_check': True, 'geometric_inliers': 8, 'geometric_hull': 0.9},
    'several': {'defences': 'own_defences:CountsLikeLengths, own_defences:DropsLongEdges',
                'geometric_check': True, 'geometric_inliers': 15}}


@pytest.fixture(params=[*((target, 'plain') for target in TARGETS),
                        *((target, name) for target in ('wl', 'edges', 'anchored', 'vbow')
                          for name in SETTINGS if name != 'plain')], ids=', '.join)
def make_detector(request, tmp_path):
    """Return a function that makes a detector with given keyframes, one a second."""
    target, name = request.param
    channels = TARGETS[target].channels
    path = tmp_path / 'model.json'
    # The bias is such that decisions fall on either side.
    points = tuple(np.linspace(2, -4, 51)) if name == 'operating point' else ()
    Decision(target, channels, (7.0, 9.0, 5.0)[:len(channels)], -8.0, points).save(path)
    if target == 'gnn':
        shutil.copy(model_path(NETWORK), path.with_suffix('.onnx'))

    def make(keyframes):
        detector = LoopClosureDetector(LcdConfig(
            target=target, model=str(path), min_gap_s=1.0, threshold=0.3, **SETTINGS[name]))
        for second, keyframe in enumerate(keyframes):
            detector.detect(replace(suited(target, keyframe), stamp_ns=second * 10**9))
        return detector
    make.suited = lambda graph: suited(target, graph)
    return make


def by_judging(detector, graph, pairs):
    # A detector without what flips leave alone: nothing kept can be wrong.
    logits = []
    for pair in pairs:
        detector._latest = None
        decision = detector.judge(graph.flip(pair))
        logits.append(max(np.log(decision.probability) - np.log1p(-decision.probability), -700)
                      if decision.probability else -700)
    return logits


# The first call compiles.
@given(graphs(min_nodes=2, max_nodes=12), st.integers(0, 2**16), st.booleans())
@settings(max_examples=25, deadline=None)
def all_flips_agree(make_detector, graph, seed, stretched):
    rng = np.random.default_rng(seed)
    graph = make_detector.suited(replace(graph, stamp_ns=10**12))
    others = [graph.flip(flips_of(graph, rng, 4)) for _ in range(3)]
    detector = make_detector([*others, make_graph(9, [(0, 4), (3, 4)], seed=seed)])
    if stretched:
        graph = replace(graph, edge_length=graph.edge_length * np.float32(3))
    pairs = np.stack(np.triu_indices(graph.node_count, 1), axis=1)
    assert flip_logits(detector, graph) == pytest.approx(
        by_judging(detector, graph, pairs), abs=1e-9, rel=1e-12)


def test_every_single_flip_is_scored_as_the_detector_judges_it(make_detector):
    all_flips_agree(make_detector)


def test_pairs_in_any_order_and_repeated(make_detector):
    graph = make_detector.suited(replace(
        make_graph(20, [(k % 3, k) for k in range(5, 20)], objects=3), stamp_ns=10**12))
    detector = make_detector([graph.flip([(3, 4)]), make_graph(20, objects=3)])
    pairs = [(9, 4), (0, 5), (2, 1), (19, 0), (9, 4)]
    assert flip_logits(detector, graph, pairs) == pytest.approx(
        by_judging(detector, graph, np.array(pairs)), abs=1e-9)


def test_a_scorer_goes_on_with_flipped_graphs(make_detector):
    graph = make_detector.suited(replace(
        make_graph(20, [(k % 3, k) for k in range(5, 20)], objects=3), stamp_ns=10**12))
    detector = make_detector([graph.flip([(3, 4)]), make_graph(20, objects=3)])
    scorer = FlipScorer(detector, graph)
    flipped = graph.flip([(0, 5), (1, 12), (7, 8)])
    pairs = flips_of(graph, np.random.default_rng(0), 50)
    assert scorer.logits(flipped, pairs) == pytest.approx(
        by_judging(detector, flipped, pairs), abs=1e-9)


def test_step_after_step_the_scores_are_those_of_a_fresh_scorer(make_detector):
    graph = make_detector.suited(replace(
        make_graph(20, [(k % 3, k) for k in range(5, 20)], objects=3), stamp_ns=10**12))
    detector = make_detector([graph.flip([(3, 4)]), make_graph(20, objects=3)])
    scorer = FlipScorer(detector, graph)
    for pair in [(7, 8), (0, 5), (1, 12), (9, 10), (0, 9)]:
        graph = graph.flip([pair])
        assert scorer.logits(graph) == pytest.approx(flip_logits(detector, graph), abs=1e-12)
        if pair == (1, 12):  # other pairs in between
            scorer.logits(graph.flip([(2, 9)]), [(3, 4)])


def test_without_a_candidate_no_flip_makes_a_loop(make_detector):
    graph = make_detector.suited(make_graph())
    assert (flip_logits(make_detector([]), graph) == -np.inf).all()


@pytest.fixture
def tour(tmp_path):
    """Return a detector of edges with some settings and two keyframes, and a graph to judge."""
    path = tmp_path / 'model.json'
    Decision('edges', ('edges',), (10.0,), -4.0,
             tuple(np.linspace(3, -2, len(KEPT_PERCENT)))).save(path)
    rng = np.random.default_rng(0)
    edges = [(k % 3, k) for k in range(5, 20)] + [(k, k + 1) for k in range(3, 19)]
    graph = replace(make_graph(20, edges, objects=3), stamp_ns=10**12)
    graph = replace(graph, edge_length=np.linspace(0.1, 0.6, graph.edge_count, dtype=np.float32))

    def make(**settings):
        detector = LoopClosureDetector(LcdConfig(target='edges', model=str(path), min_gap_s=1.0,
                                                 **settings))
        for second, flip in enumerate([(3, 5), (5, 7)]):
            # Elsewhere in the image, by no motion of the camera.
            position = rng.uniform(0, 480, graph.position.shape).astype(np.float32)
            detector.remember(replace(graph.flip([flip]), stamp_ns=second * 10**9,
                                      position=position))
        return detector
    return make, graph


@pytest.mark.parametrize('name', [name for name in SETTINGS if name != 'plain'])
def test_every_setting_makes_a_difference(tour, name):
    make, graph = tour
    undefended = flip_logits(make(), graph)
    assert not np.allclose(flip_logits(make(**SETTINGS[name]), graph), undefended)


def test_a_defence_that_moves_nodes_is_refused(tour):
    make, graph = tour
    with pytest.raises(ConfigError, match='moves_nodes returned a graph with other nodes'):
        make(defences='own_defences:MovesNodes').judge(graph)
