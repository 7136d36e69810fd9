# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The WL subtree kernel: by hand, against multisets, and after flips."""

from collections import Counter

from graph_factory import flips_of, graphs, make_graph
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np

from adversarial_lcd_ros.weisfeiler_lehman.histogram import flip_kernels, histogram


def by_multisets(graph, label, iterations):
    """Return labels as nested tuples: what the hashes stand for."""
    near = [[] for _ in range(graph.node_count)]
    for u, v in graph.edge.tolist():
        near[u].append(v)
        near[v].append(u)
    labels = [(0, int(value)) for value in label]
    found = Counter(labels)
    for h in range(1, iterations + 1):
        labels = [(h, labels[v], tuple(sorted(labels[k] for k in near[v])))
                  for v in range(graph.node_count)]
        found.update(labels)
    return found


def product(one, other):
    return sum(count * other[label] for label, count in one.items())


def test_two_paths_by_hand():
    labels = np.zeros(3, np.uint32)
    path, edge = make_graph(3, [(0, 1), (1, 2)]), make_graph(3, [(0, 1)])
    # 3 x 3 labels; then the path has two ends and a middle, the other two ends and a lone node.
    assert histogram(path, labels, 1).kernel(histogram(edge, labels, 1)) == 9 + 2 * 2
    assert histogram(path, labels, 1).kernel(histogram(path, labels, 1)) == 9 + 4 + 1


# The first call compiles.
@given(graphs(), graphs(), st.integers(0, 3))
@settings(deadline=None)
def test_the_kernel_counts_common_multisets(graph, other, iterations):
    mine, theirs = graph.label % 2, other.label % 2
    assert histogram(graph, mine, iterations).kernel(
        histogram(other, theirs, iterations)) == product(
            by_multisets(graph, mine, iterations), by_multisets(other, theirs, iterations))


@given(graphs(min_nodes=2), st.integers(0, 2**16), st.integers(0, 4))
@settings(deadline=None)
def test_after_a_flip_it_is_what_recomputing_gives(graph, seed, iterations):
    label = graph.label % 2
    rng = np.random.default_rng(seed)
    reference = histogram(graph.flip(flips_of(graph, rng, 3)), label, iterations)
    pairs = np.stack(np.triu_indices(graph.node_count, 1), axis=1)
    assert flip_kernels(graph, label, pairs, iterations, reference).tolist() == [
        histogram(graph.flip(pair), label, iterations).kernel(reference) for pair in pairs]
