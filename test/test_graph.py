# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The graph: validity, flips, immutability."""

from dataclasses import replace

from graph_factory import flips_of, graphs, make_graph
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.errors import GraphError
from adversarial_lcd_ros.graph import MultiTierGraph


def test_flip_deletes_an_edge_and_adds_another():
    graph = make_graph()
    flipped = graph.flip([(1, 0), (5, 4)])
    assert flipped.edge.tolist() == [[0, 2], [1, 3], [2, 4], [4, 5]]
    x, y = graph.position[4] - graph.position[5]
    assert flipped.edge_length[-1] == pytest.approx(np.hypot(x, y) / 800)


@given(graphs(), st.integers(0, 2**16), st.integers(0, 5))
def test_flipping_twice_is_no_change(graph, seed, count):
    pairs = flips_of(graph, np.random.default_rng(seed), count)
    once = graph.flip(pairs)
    assert once.flip(pairs) == graph
    assert len(graph.flips_to(once)) == len(pairs)
    assert abs(once.edge_count - graph.edge_count) <= len(pairs)
    checked = replace(once)  # by the constructor: nothing is carried over
    assert checked == once
    assert checked.node_digest == once.node_digest == graph.node_digest
    assert checked.edge_key.tolist() == once.edge_key.tolist()
    assert not once.edge.flags.writeable
    assert not once.edge_length.flags.writeable


@given(graphs())
def test_adjacency_is_symmetric_and_zero_one(graph):
    dense = graph.adjacency.toarray()
    assert (dense == dense.T).all()
    assert dense.sum() == 2 * graph.edge_count
    assert not dense.diagonal().any()


@given(graphs(), st.integers(0, 2**16))
def test_has_edges_agrees_with_the_adjacency(graph, seed):
    pairs = flips_of(graph, np.random.default_rng(seed), 6)
    dense = graph.adjacency.toarray()
    assert graph.has_edges(pairs).tolist() == (dense[pairs[:, 0], pairs[:, 1]] > 0).tolist()


@pytest.mark.parametrize('pairs', [[(0, 0)], [(0, 6)], [(-1, 2)], [(0, 1), (1, 0)]])
def test_impossible_flips_are_refused(pairs):
    with pytest.raises(GraphError):
        make_graph().flip(pairs)


def test_arrays_cannot_be_changed():
    graph = make_graph()
    with pytest.raises(ValueError, match='read-only'):
        graph.position[0] = 0


@pytest.mark.parametrize(('field', 'value', 'said'), [
    ('edge', np.array([[0, 1], [0, 2], [1, 3], [2, 9]], np.uint32), 'edge to node 9'),
    ('edge', np.array([[0, 2], [0, 1], [1, 3], [2, 4]], np.uint32), 'sorted'),
    ('edge', np.array([[0, 1], [0, 1], [1, 3], [2, 4]], np.uint32), 'without repeats'),
    ('edge', np.array([[1, 0], [0, 2], [1, 3], [2, 4]], np.uint32), 'source < target'),
    ('edge', np.array([[0, 0], [0, 2], [1, 3], [2, 4]], np.uint32), 'source < target'),
    ('edge_length', np.full(4, np.nan, np.float32), 'not finite'),
    ('edge_length', np.full(4, -1, np.float32), '>= 0'),
    ('edge_length', np.zeros(3, np.float32), 'edge_length: expected'),
    ('position', np.full((6, 2), np.inf, np.float32), 'position'),
    ('position', np.zeros((6, 2)), 'float64'),
    ('tier', np.array([0, 0, 1, 1, 1, 7], np.uint8), 'tier 7'),
    ('tier', np.array([1, 0, 1, 1, 1, 1], np.uint8), 'before features'),
    ('label', [1, 2, 3, 4, 5, 6], 'found list'),
    ('word', np.array([5, 3], np.uint32), 'word_weight'),
    ('width', 0, 'image size'),
])
def test_nonsense_is_refused_by_name(field, value, said):
    with pytest.raises(GraphError, match=said):
        replace(make_graph(), **{field: value})


def test_words_must_ascend():
    with pytest.raises(GraphError, match='ascend'):
        replace(make_graph(), word=np.array([5, 3], np.uint32),
                word_weight=np.array([.5, .5], np.float32))


def test_an_empty_graph_is_a_graph():
    graph = MultiTierGraph(0, '', 0, 640, 480)
    assert graph.node_count == graph.edge_count == graph.object_count == 0
    assert graph.flip(np.zeros((0, 2), int)) == graph


def test_flips_to_a_graph_of_other_nodes_is_refused():
    with pytest.raises(GraphError, match='nodes'):
        make_graph().flips_to(make_graph(seed=1))
