# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The object-anchored target by hand: what counts, how much, and what does not."""

from dataclasses import replace

from graph_factory import flips_of, graphs, make_graph
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.lcd.targets import make_target
from adversarial_lcd_ros.lcd.views import Comparison, View

# Object 0 has the features 2 to 6, object 1 has 7 to 9; 10 and 11 hang on nothing.
FEATURES = range(2, 12)
LABEL = np.array([4, 8, *FEATURES], np.uint32)
GRAPH = make_graph(12, [(0, 1), *((0, k) for k in range(2, 7)), *((1, k) for k in range(7, 10)),
                        *((k, k + 1) for k in range(2, 11))], objects=2, label=LABEL)
# Weights are sqrt(0.6); there are 5 * 4 + 3 * 2 ordered pairs, and 5^2 + 3^2 with themselves.
PAIR, SIZE = 0.6, 34
WHOLE = 26 * PAIR / SIZE


def score(query, reference):
    view = View(query)
    return make_target('anchored').compare(view, Comparison(view, [View(reference)])).item()


def test_pairs_of_features_of_one_object_count():
    assert score(GRAPH, GRAPH) == pytest.approx(WHOLE, abs=1e-6)


def test_a_cut_spoke_takes_its_pairs_along():
    fewer = (4 * 3 + 3 * 2) * PAIR / np.sqrt(SIZE * (16 + 9))
    assert score(GRAPH.flip([(0, 5)]), GRAPH) == pytest.approx(fewer, abs=1e-6)
    assert score(GRAPH, GRAPH.flip([(0, 5)])) == pytest.approx(fewer, abs=1e-6)


def test_a_spoke_more_counts_if_the_reference_has_it():
    more = GRAPH.flip([(1, 10)])
    assert score(more, GRAPH) == pytest.approx(26 * PAIR / np.sqrt(SIZE * (25 + 16)), abs=1e-6)
    assert score(more, more) == pytest.approx((20 + 12) * PAIR / (25 + 16), abs=1e-6)


@pytest.mark.parametrize('pair', [(2, 3), (4, 11), (0, 1)])
def test_edges_of_one_tier_do_not_count(pair):
    assert score(GRAPH.flip([pair]), GRAPH) == score(GRAPH, GRAPH)


def test_another_class_counts_half():
    other = replace(GRAPH, label=np.r_[np.uint32(5), LABEL[1:]].astype(np.uint32))
    assert score(GRAPH, other) == pytest.approx((20 / 2 + 6) * PAIR / SIZE, abs=1e-6)


def test_objects_are_assigned_one_to_one():
    # All features hang on one object: it can stand for the larger star only.
    merged = GRAPH.flip([(1, k) for k in range(7, 10)] + [(0, k) for k in range(7, 10)])
    assert score(GRAPH, merged) == pytest.approx(20 * PAIR / np.sqrt(SIZE * 64), abs=1e-6)


def moved(nodes, pixels):
    position = GRAPH.position.copy()
    position[nodes] += np.float32(pixels)
    return replace(GRAPH, position=position)


def test_the_camera_may_turn_but_features_may_not_part():
    assert score(GRAPH, moved(slice(None), [40, -30])) == pytest.approx(WHOLE, abs=1e-5)
    # 16 of 800 pixels of diagonal are the tolerance.
    parted = (4 * 3 + 3 * 2 + 8 * np.exp(-1)) * PAIR / SIZE
    assert score(GRAPH, moved(4, [0, 16])) == pytest.approx(parted, abs=1e-5)
    assert score(GRAPH, moved(4, [0, 81])) == pytest.approx(18 * PAIR / SIZE, abs=1e-6)


@given(graphs(), graphs(), st.integers(0, 2**16))
@settings(max_examples=30, deadline=None)
def test_a_prepared_target_scores_flips_as_from_scratch(graph, reference, seed):
    view, target = View(graph), make_target('anchored')
    nodes = Comparison(view, [View(reference), view])
    flipped = View(graph.flip(flips_of(graph, np.random.default_rng(seed), 4)), view)
    assert target.prepare(view, nodes)(flipped).tolist() == target.compare(
        flipped, Comparison(flipped, nodes.references)).tolist()


@given(graphs(), graphs())
@settings(max_examples=30, deadline=None)
def test_it_does_not_matter_which_graph_asks(one, other):
    assert score(one, other) == pytest.approx(score(other, one), abs=1e-6)
    assert score(one, other) <= 0.6 + 1e-6
