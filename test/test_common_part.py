# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The share of features in what two views could have in common, by hand."""

from dataclasses import replace

from graph_factory import make_graph
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.lcd.common_part import share_in_common
from adversarial_lcd_ros.lcd.defences import make_defences

NODES = 202
EDGES = [(0, 5), (7, 9)]


def moved(graph, shift, keeps=None):
    """Return what a camera sees that turned by some pixels, with other features in places."""
    position = graph.position + np.float32(shift)
    inside = ((position >= 0) & (position < (graph.width, graph.height))).all(axis=1)
    other = make_graph(NODES, EDGES, seed=1)
    taken = inside if keeps is None else inside & keeps
    return replace(graph, position=np.where(taken[:, None], position, other.position),
                   descriptor=np.where(taken[:, None], graph.descriptor, other.descriptor))


GRAPH = make_graph(NODES, EDGES)


def test_a_view_has_all_in_common_with_itself():
    # Features too near to the border are not expected, but count where they match.
    assert share_in_common(GRAPH, GRAPH) == 1


def test_what_is_out_of_sight_does_not_count_against_a_loop():
    half = moved(GRAPH, (320, 0))
    # In the half seen by both: about 100 of one view; of the other, those and none besides.
    assert share_in_common(GRAPH, half) > 0.9


@pytest.mark.parametrize('share', [0.2, 0.5, 0.8])
def test_features_without_a_counterpart_contradict(share):
    keeps = np.random.default_rng(3).random(NODES) < share
    keeps[:2] = True
    assert share_in_common(GRAPH, moved(GRAPH, (4, 2), keeps)) == pytest.approx(share, abs=0.12)


def test_few_matches_or_none_show_nothing():
    assert share_in_common(GRAPH, make_graph(NODES, EDGES, seed=9)) < 0.1
    assert share_in_common(make_graph(6, objects=2), make_graph(6, objects=2)) == 0
    line = np.tile(np.float32([320, 240]), (NODES, 1))
    same = replace(GRAPH, position=line)
    assert 0 <= share_in_common(same, same) <= 1


@given(st.integers(0, 1000), st.integers(0, 1000), st.floats(0, 1))
@settings(max_examples=30, deadline=None)
def test_a_share_is_one_and_hangs_on_nodes_alone(seed, other, share):
    keeps = np.random.default_rng(seed).random(NODES) < share
    one = make_graph(NODES, EDGES, seed=other)
    two = moved(one, (seed % 40, 3), keeps)
    found = share_in_common(one, two)
    assert 0 <= found <= 1
    assert share_in_common(one.flip([(3, 4), (0, 5)]), two) == found


def test_the_defence_refuses_what_contradicts():
    defence, = make_defences(LcdConfig(defences='common_part', common_share=0.5))
    keeps = np.arange(NODES) % 4 == 0
    assert defence.support(GRAPH, GRAPH) == 2
    assert defence.support(GRAPH, moved(GRAPH, (4, 2), keeps)) < 0.8
