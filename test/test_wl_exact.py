# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The textbook WL kernel as a target: by hand, against GraKeL, and its brittleness."""

from dataclasses import replace

from graph_factory import graphs, make_graph
from hypothesis import given, settings
import numpy as np
import pytest

from adversarial_lcd_ros.lcd.targets import make_target
from adversarial_lcd_ros.lcd.targets.wl_exact import ITERATIONS
from adversarial_lcd_ros.lcd.views import Comparison, View

# An object with two features of one word, and a third feature that hangs on nothing.
STAR = make_graph(4, [(0, 1), (0, 2)], objects=1, label=np.array([7, 3, 3, 7], np.uint32))


def score(query, *references):
    view = View(query)
    return make_target('wl_exact').compare(
        view, Comparison(view, [View(reference) for reference in references]))[:, 0]


def test_a_star_by_hand():
    # Labels: object, two words, another word; then each with its neighbours, again 1 + 2^2 + 1.
    assert score(STAR, STAR).item() == pytest.approx(1)
    # Without one spoke, only one leaf and the lone feature have the neighbours they had.
    cut = STAR.flip([(0, 2)])
    common, own, other = 6 + (2 * 1 + 1), 6 + 6, 6 + 4
    assert score(STAR, cut).item() == pytest.approx(common / np.sqrt(own * other))


def test_a_class_is_no_word():
    # Alike but for the tier of node 0, whose number is that of the last node's word.
    features = make_graph(4, [(0, 1), (0, 2)], objects=0, label=STAR.label)
    # In common: two words and the last node's, 4 + 1; here that word occurs twice, 4 + 2. The
    # leaves of iteration 1 have another neighbour; the lone feature stays.
    assert score(STAR, features).item() == pytest.approx((4 + 2 + 1) / np.sqrt(12 * (8 + 6)))


@given(graphs(min_nodes=2), graphs(min_nodes=2))
@settings(max_examples=30, deadline=None)
def test_it_is_grakels_kernel(one, other):
    grakel = pytest.importorskip('grakel')

    def known(graph):
        near = {node: [] for node in range(graph.node_count)}
        for u, v in graph.edge.tolist():
            near[u].append(v)
            near[v].append(u)
        label = {node: f'{graph.tier[node]} {graph.label[node]}' for node in near}
        return grakel.Graph(near, label)

    kernel = grakel.WeisfeilerLehman(n_iter=ITERATIONS, normalize=True,
                                     base_graph_kernel=grakel.VertexHistogram)
    expected = kernel.fit_transform([known(one), known(other)])[0, 1]
    assert score(one, other).item() == pytest.approx(expected, abs=1e-9)


def test_a_neighbourhood_does_not_survive_one_neighbour_more():
    nodes = 40
    star = make_graph(nodes, [(0, k) for k in range(1, nodes - 1)], objects=1,
                      label=np.arange(nodes, dtype=np.uint32))
    more = star.flip([(0, nodes - 1)])
    # Labels of nodes stay; the hub and the new leaf have other neighbours.
    assert score(star, more).item() == pytest.approx((nodes + nodes - 2) / (2 * nodes))


def test_references_are_labelled_once():
    target, view, reference = make_target('wl_exact'), View(STAR), View(STAR.flip([(0, 3)]))
    first = target.compare(view, Comparison(view, [reference]))
    reference.graph = replace(STAR, label=STAR.label + np.uint32(9))
    assert target.compare(view, Comparison(view, [reference])) == first
