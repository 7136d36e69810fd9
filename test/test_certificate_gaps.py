# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Certificates on thousands of frames: the greedy optimum never gets beyond a bound."""

from dataclasses import replace

from graph_factory import flips_of, make_graph, patch, suited
import numpy as np
import pytest

from adversarial_lcd_ros.config import ANCHORS, TIERS, BuilderConfig, LcdConfig
from adversarial_lcd_ros.evaluation.certificates.gaps import optimum_gaps, random_gaps
from adversarial_lcd_ros.lcd.bound_channels import EdgeBound, NeighbourhoodBound
from adversarial_lcd_ros.lcd.decision import Decision
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.targets import TARGETS
from adversarial_lcd_ros.paths import share_path
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.vision.builder import GraphBuilder

LATER_NS = 10**15
USUAL = 27
# As certificates have it: bounds and scores are summed in another order.
SLACK = 1e-4
# Weights and biases by which a good part of the frames is a loop and another is none.
DECISIONS = {'edges': ((7.0,), -1.0), 'wl': ((7.0, 9.0, 5.0), -4.0), 'symbio': ((9.0,), -3.0)}


@pytest.fixture(scope='module')
def tour():
    """Return small graphs of frames of the embedded tour, by variant."""
    sequence = open_sequence(share_path('bags/flat_tour'))
    builders = {variant: GraphBuilder(BuilderConfig(features=60, graph_variant=variant))
                for variant in (TIERS, ANCHORS)}
    frames = [(frame.image(), frame.stamp_ns) for frame in sequence.frames(0, None, 24)]
    return {variant: [builder.build(image, stamp_ns, 'camera', number)
                      for number, (image, stamp_ns) in enumerate(frames)]
            for variant, builder in builders.items()}


@pytest.fixture
def make_detector(tmp_path):
    """Return a function that makes a detector with keyframes."""
    def make(target, defences, keyframes):
        path = tmp_path / 'model.json'
        weights, bias = DECISIONS[target]
        Decision(target, TARGETS[target].channels, weights, bias).save(path)
        detector = LoopClosureDetector(LcdConfig(
            target=target, model=str(path), min_gap_s=1.0, candidates=2, map_window=1,
            defences=defences))
        for second, keyframe in enumerate(keyframes):
            detector.remember(replace(keyframe, stamp_ns=second * 10**9))
        return detector
    return make


def budget_of(rng):
    return USUAL if rng.random() < 0.05 else int(rng.integers(1, 7))


def compared(detector, graphs, rng):
    """Return the decisions on graphs, and what was compared; nothing may be beyond a bound."""
    decisions, gaps = [], []
    for graph in graphs:
        budget = budget_of(rng)
        decisions.append(detector.judge(graph).is_loop)
        gaps += optimum_gaps(detector, graph, budget)
        gaps += random_gaps(detector, graph, budget, rng.integers(1, budget + 1, 2).tolist(), rng)
    assert min(gap.inside for gap in gaps) >= -SLACK
    assert min(gap.loose for gap in gaps) >= -SLACK
    assert all(gap.kept for gap in gaps)
    return decisions, gaps


# 2,500 in all.
@pytest.mark.parametrize(('target', 'defences', 'count'), [
    ('edges', 'none', 600), ('edges', 'length_check', 600), ('wl', 'none', 400),
    ('wl', 'length_check', 400), ('symbio', 'none', 300), ('symbio', 'length_check', 200)])
def test_the_greedy_optimum_stays_within_on_frames_of_the_tour(make_detector, tour, target,
                                                               defences, count):
    rng = np.random.default_rng(11)
    frames = tour[TARGETS[target].graph_variant or TIERS]
    # The first half is the map; what is left of a frame is seen again, or seen anew.
    detector = make_detector(target, defences, frames[:len(frames) // 2])
    queries = (patch(replace(frames[place % len(frames)], stamp_ns=LATER_NS), rng,
                     int(rng.integers(5, 14)), int(rng.integers(0, 3)) + (target == 'symbio'))
               for place in range(count))
    decisions, gaps = compared(detector, queries, rng)
    assert min(decisions.count(True), decisions.count(False)) > count // 8
    for is_loop in (True, False):  # suppressed, invented: somebody got somewhere
        assert len({gap.flips for gap in gaps if gap.is_loop == is_loop}) > 3


@pytest.mark.parametrize(('target', 'defences'), [
    (target, defences) for target in DECISIONS for defences in ('none', 'length_check')])
def test_the_greedy_optimum_stays_within_on_graphs_that_were_made(make_detector, target,
                                                                  defences):
    for seed in range(100):
        rng = np.random.default_rng(seed)
        nodes = int(rng.integers(4, 14))
        pairs = np.stack(np.triu_indices(nodes, 1), axis=1)
        graph = replace(suited(target, make_graph(
            nodes, pairs[rng.random(len(pairs)) < rng.random()].tolist(),
            int(rng.integers(0, 4)), seed)), stamp_ns=LATER_NS)
        keyframes = [graph.flip(flips_of(graph, rng, 3)) for _ in range(2)]
        compared(make_detector(target, defences, keyframes), [graph], rng)


@pytest.mark.parametrize(('target', 'bound'), [('edges', EdgeBound), ('wl', NeighbourhoodBound)])
def test_a_bound_that_is_none_is_noticed(make_detector, tour, monkeypatch, target, bound):
    def too_narrow(self, budget):
        least, largest = true(self, budget)
        return (np.r_[least[:1], np.repeat(least[:1], budget, axis=0)],
                np.r_[largest[:1], np.repeat(largest[:1], budget, axis=0)])
    true = bound.after
    monkeypatch.setattr(bound, 'after', too_narrow)
    rng = np.random.default_rng(11)
    detector = make_detector(target, 'none', tour[TIERS][:4])
    with pytest.raises(AssertionError):
        compared(detector, [patch(replace(frame, stamp_ns=LATER_NS), rng, 12, 1)
                            for frame in tour[TIERS][:4]], rng)
