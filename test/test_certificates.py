# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Certificates: no flips that anybody finds lead beyond their bounds."""

from dataclasses import replace
from itertools import combinations

from graph_factory import flips_of, graphs, make_graph, suited
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.evaluation.frames.optimum import Optimum
from adversarial_lcd_ros.lcd.bound_kernels import largest_ratio
from adversarial_lcd_ros.lcd.certificates import certify
from adversarial_lcd_ros.lcd.decision import Decision
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.targets import TARGETS

BUDGET = 4
SLACK = 1e-4


@pytest.fixture(params=['edges', 'wl', 'edges, length check', 'wl, geometric check',
                        'edges, a weight below 0', 'wl, rederive', 'vbow', 'symbio'])
def make_detector(request, tmp_path):
    """Return a function that makes a detector with given keyframes, one a second."""
    target = request.param.partition(',')[0]
    channels = TARGETS[target].channels
    path = tmp_path / 'model.json'
    sign = -1.0 if 'below' in request.param else 1.0
    Decision(target, channels, tuple(sign * weight for weight in (7.0, 9.0, 5.0))[:len(channels)],
             -8.0 * sign).save(path)
    settings = {'length_factor': 1.3, 'geometric_inliers': 12, 'rederive_neighbours': 2,
                'defences': {'length check': 'length_check', 'rederive': 'rederive',
                             'geometric check': 'geometric_check'}.get(
                                 request.param.partition(', ')[2], 'none')}

    def make(keyframes):
        detector = LoopClosureDetector(LcdConfig(
            target=target, model=str(path), min_gap_s=1.0, threshold=0.3, **settings))
        for second, keyframe in enumerate(keyframes):
            detector.remember(replace(keyframe, stamp_ns=second * 10**9))
        return detector
    make.target = target
    return make


def seen(graph, seed):
    """Return the graph later, and keyframes that look like it: some flips, some bits away."""
    rng = np.random.default_rng(seed)
    graph = replace(graph, stamp_ns=10**12)
    keyframes = []
    for _ in range(4):
        noise = np.packbits(rng.random((graph.node_count, 256)) < 0.1, axis=1)
        noise[:graph.object_count] = 0
        keyframes.append(replace(graph.flip(flips_of(graph, rng, 4)),
                                 descriptor=graph.descriptor ^ noise))
    return graph, keyframes


@given(graphs(min_nodes=2, max_nodes=12), st.integers(0, 2**16))
@settings(max_examples=40, deadline=None)
def no_flips_leave_the_bounds(make_detector, graph, seed):
    graph, keyframes = seen(suited(make_detector.target, graph), seed)
    detector = make_detector(keyframes)
    found = certify(detector, graph, BUDGET)
    rng = np.random.default_rng(seed)
    now = detector.log_odds(graph)
    assert (found.least[0] - SLACK <= now).all()
    assert (now <= found.largest[0] + SLACK).all()
    for flips in rng.integers(1, BUDGET + 1, 30).tolist():
        flipped = graph.flip(flips_of(graph, rng, flips))
        odds = detector.log_odds(flipped)
        assert (found.least[flips] - SLACK <= odds).all()
        assert (odds <= found.largest[flips] + SLACK).all()
        if found.holds[flips]:
            assert detector.judge(flipped).is_loop == found.is_loop


def test_no_flips_leave_the_bounds(make_detector):
    no_flips_leave_the_bounds(make_detector)


@given(graphs(min_nodes=4, max_nodes=12), st.integers(0, 2**16))
@settings(max_examples=30, deadline=None)
def the_optimum_stays_within(make_detector, graph, seed):
    graph, keyframes = seen(suited(make_detector.target, graph), seed)
    detector = make_detector(keyframes)
    found = certify(detector, graph, BUDGET)
    optimum = Optimum(detector, AttackConfig(ratio=1.0))
    for flips, (flipped, _) in enumerate(optimum.path(graph), 1):
        if flips > BUDGET:
            break
        odds = detector.log_odds(flipped)
        assert (found.least[flips] - SLACK <= odds).all()
        assert (odds <= found.largest[flips] + SLACK).all()
        assert not found.holds[flips] or detector.judge(flipped).is_loop == found.is_loop


def test_the_greedy_optimum_stays_within(make_detector):
    the_optimum_stays_within(make_detector)


@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(0.1, 2), st.booleans()), min_size=1,
                max_size=7), st.integers(0, 4), st.floats(-1, 1))
@settings(deadline=None)
def test_the_largest_ratio_is_the_largest(terms, flips, otherwise):
    top, bottom, present = (np.array(column) for column in zip(*terms, strict=True))

    def ratio(members):
        return top[members].sum() / bottom[members].sum() if members.any() else otherwise
    best = -np.inf
    for count in range(flips + 1):
        for chosen in combinations(range(len(top)), min(count, len(top))):
            members = present.copy()
            members[list(chosen)] ^= True
            best = max(best, ratio(members))
    assert largest_ratio(top, bottom, present, flips, otherwise) == pytest.approx(best, abs=1e-9)
    known = largest_ratio(top, bottom, present, max(flips - 1, 0), otherwise)
    assert largest_ratio(top, bottom, present, flips, otherwise, known) == pytest.approx(
        best, abs=1e-9)


@given(graphs(min_nodes=3, max_nodes=5), st.integers(0, 2**16))
@settings(max_examples=30, deadline=None)
def exact(make, graph, seed):
    graph, keyframes = seen(graph, seed)
    detector = make(keyframes)
    found = certify(detector, graph, 2)
    pairs = list(combinations(range(graph.node_count), 2))
    odds = np.array([detector.log_odds(graph.flip(list(flips))) for count in range(3)
                     for flips in combinations(pairs, count)])
    # Less than 2 flips are better where there is nothing left to add or to delete.
    assert (found.largest[2] >= odds.max(axis=0) - SLACK).all()
    if 2 <= graph.edge_count <= len(pairs) - 2:
        assert found.largest[2] == pytest.approx(odds.max(axis=0), abs=1e-3)


@pytest.mark.parametrize('make_detector', ['edges'], indirect=True)
def test_of_edges_the_largest_is_reached(make_detector):
    exact(make_detector)


def test_what_nothing_is_proven_of_is_refused(tmp_path):
    path = tmp_path / 'model.json'
    graph, keyframes = seen(make_graph(), 0)
    for target, defences, what in (('anchored', 'none', 'target anchored'),
                                   ('edges', 'own_defences:DropsLongEdges', 'makes other edges')):
        Decision(target, TARGETS[target].channels, (7.0,), -8.0).save(path)
        detector = LoopClosureDetector(LcdConfig(target=target, model=str(path), min_gap_s=1.0,
                                                 defences=defences))
        detector.remember(replace(keyframes[0], stamp_ns=0))
        with pytest.raises(ConfigError, match=f'nothing is proven of .*{what}'):
            certify(detector, graph, 2)


def test_without_a_candidate_no_flips_make_a_loop(make_detector):
    graph = suited(make_detector.target, make_graph())
    assert certify(make_detector([]), graph, 3).holds.tolist() == [True] * 4
