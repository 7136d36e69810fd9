"""Log odds after single flips, against making each flip and asking the detector."""

from dataclasses import replace
import shutil

from graph_factory import flips_of, graphs, make_graph
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.lcd.decision import Decision
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.flips import FlipScorer, flip_logits
from adversarial_lcd_ros.lcd.targets import TARGETS
from adversarial_lcd_ros.lcd.targets.gnn import NETWORK
from adversarial_lcd_ros.paths import model_path


@pytest.fixture(params=list(TARGETS))
def make_detector(request, tmp_path):
    """Return a function that makes a detector with given keyframes, one a second."""
    channels = TARGETS[request.param].channels
    path = tmp_path / 'model.json'
    Decision(request.param, channels, (7.0, 9.0, 5.0)[:len(channels)], -8.0).save(path)
    if request.param == 'gnn':
        shutil.copy(model_path(NETWORK), path.with_suffix('.onnx'))

    def make(keyframes):
        detector = LoopClosureDetector(
            LcdConfig(target=request.param, model=str(path), min_gap_s=1.0))
        for second, keyframe in enumerate(keyframes):
            detector.detect(replace(keyframe, stamp_ns=second * 10**9))
        return detector
    return make


def by_judging(detector, graph, pairs):
    return [detector.log_odds(graph.flip(pair)).max() for pair in pairs]


# The first call compiles.
@given(graphs(min_nodes=2, max_nodes=12), st.integers(0, 2**16), st.booleans())
@settings(max_examples=25, deadline=None)
def all_flips_agree(make_detector, graph, seed, stretched):
    rng = np.random.default_rng(seed)
    graph = replace(graph, stamp_ns=10**12)
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
    graph = replace(make_graph(20, [(k % 3, k) for k in range(5, 20)], objects=3),
                    stamp_ns=10**12)
    detector = make_detector([graph.flip([(3, 4)]), make_graph(20, objects=3)])
    pairs = [(9, 4), (0, 5), (2, 1), (19, 0), (9, 4)]
    assert flip_logits(detector, graph, pairs) == pytest.approx(
        by_judging(detector, graph, np.array(pairs)), abs=1e-9)


def test_a_scorer_goes_on_with_flipped_graphs(make_detector):
    graph = replace(make_graph(20, [(k % 3, k) for k in range(5, 20)], objects=3),
                    stamp_ns=10**12)
    detector = make_detector([graph.flip([(3, 4)]), make_graph(20, objects=3)])
    scorer = FlipScorer(detector, graph)
    flipped = graph.flip([(0, 5), (1, 12), (7, 8)])
    pairs = flips_of(graph, np.random.default_rng(0), 50)
    assert scorer.logits(flipped, pairs) == pytest.approx(
        by_judging(detector, flipped, pairs), abs=1e-9)


def test_step_after_step_the_scores_are_those_of_a_fresh_scorer(make_detector):
    graph = replace(make_graph(20, [(k % 3, k) for k in range(5, 20)], objects=3),
                    stamp_ns=10**12)
    detector = make_detector([graph.flip([(3, 4)]), make_graph(20, objects=3)])
    scorer = FlipScorer(detector, graph)
    for pair in [(7, 8), (0, 5), (1, 12), (9, 10), (0, 9)]:
        graph = graph.flip([pair])
        assert scorer.logits(graph) == pytest.approx(flip_logits(detector, graph), abs=1e-12)
        if pair == (1, 12):  # other pairs in between
            scorer.logits(graph.flip([(2, 9)]), [(3, 4)])


def test_without_a_candidate_no_flip_makes_a_loop(make_detector):
    assert (flip_logits(make_detector([]), make_graph()) == -np.inf).all()
