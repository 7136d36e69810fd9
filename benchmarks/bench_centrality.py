# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Eigenvector centrality from scratch, and after a flip."""

import networkx as nx
import numpy as np
import pytest

from adversarial_lcd_ros.attack.perturbations.eigencentrality import eigencentrality

SIZES = (100, 300, 1000)


def flip_of(graph):
    return graph.flip(np.random.default_rng(0).choice(graph.node_count, 2, replace=False))


def igraph_of(graph):
    igraph = pytest.importorskip('igraph')
    return igraph.Graph(n=graph.node_count, edges=graph.edge.tolist())


@pytest.mark.parametrize('features', SIZES)
def test_cold_beside_igraph(record, tour_graphs, features):
    graph = tour_graphs(features)[30]
    rival = igraph_of(graph)
    expected = np.array(rival.eigenvector_centrality(scale=False))
    assert eigencentrality(graph) == pytest.approx(
        expected / np.linalg.norm(expected), abs=1e-9)
    record('centrality_cold', f'n = {graph.node_count}', lambda: eigencentrality(graph),
           'igraph', lambda: rival.eigenvector_centrality(scale=False), 1)


@pytest.mark.parametrize('features', SIZES)
def test_warm_beside_igraph(record, tour_graphs, features):
    graph = tour_graphs(features)[30]
    near, flipped = eigencentrality(graph), flip_of(graph)
    rival = igraph_of(flipped)
    record('centrality_warm', f'n = {graph.node_count}', lambda: eigencentrality(flipped, near),
           'igraph', lambda: rival.eigenvector_centrality(scale=False), 5)


@pytest.mark.parametrize('features', SIZES)
@pytest.mark.parametrize('solver', ['eigenvector_centrality', 'eigenvector_centrality_numpy'])
def test_cold_beside_networkx(record, tour_graphs, features, solver):
    graph = tour_graphs(features)[30]
    rival = nx.from_scipy_sparse_array(graph.adjacency)
    options = {'max_iter': 10_000} if solver == 'eigenvector_centrality' else {}
    record('centrality_cold', f'n = {graph.node_count}', lambda: eigencentrality(graph),
           f'networkx {solver}', lambda: getattr(nx, solver)(rival, **options))
