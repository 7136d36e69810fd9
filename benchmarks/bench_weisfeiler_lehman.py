# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scoring every single flip of a graph: WL kernel, WL features, and the target itself."""

import networkx as nx
import numpy as np
import pytest

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.flips import FlipScorer, flip_logits
from adversarial_lcd_ros.weisfeiler_lehman.continuous import (
    flip_features,
    node_features,
    pooled_features,
)
from adversarial_lcd_ros.weisfeiler_lehman.histogram import flip_kernels, histogram

ITERATIONS = 3
CANDIDATES = 20


def all_pairs(graph):
    return np.stack(np.triu_indices(graph.node_count, 1), axis=1)


def some_pairs(graph, count=CANDIDATES):
    pairs = all_pairs(graph)
    return pairs[np.random.default_rng(0).choice(len(pairs), count, replace=False)]


def as_grakel(graph):
    from grakel import Graph
    neighbours = {node: {} for node in range(graph.node_count)}
    for u, v in graph.edge.tolist():
        neighbours[u][v] = neighbours[v][u] = 1.0
    return Graph(neighbours, node_labels=dict(enumerate(graph.label.tolist())))


@pytest.mark.parametrize('features', [100, 300])
def test_wl_flip_beside_grakel(record, tour_graphs, features):
    grakel = pytest.importorskip('grakel')
    graph, other = tour_graphs(features)[30], tour_graphs(features)[3]
    pairs, reference = all_pairs(graph), histogram(other, other.label, ITERATIONS)
    rival = grakel.WeisfeilerLehman(n_iter=ITERATIONS,
                                    base_graph_kernel=grakel.VertexHistogram)
    rival.fit([as_grakel(other)])
    chosen = some_pairs(graph)
    flipped = [as_grakel(graph.flip(pair)) for pair in chosen]
    assert rival.transform(flipped)[:, 0].tolist() == flip_kernels(
        graph, graph.label, chosen, ITERATIONS, reference).tolist()
    record('wl_flip', f'n = {graph.node_count}, h = 3, all flips, labels',
           lambda: flip_kernels(graph, graph.label, pairs, ITERATIONS, reference),
           'GraKeL WeisfeilerLehman + VertexHistogram', lambda: rival.transform(flipped),
           100, ours_units=len(pairs), rival_units=len(flipped))


def test_wl_flip_beside_networkx(record, tour_graphs):
    graph, other = tour_graphs(300)[30], tour_graphs(300)[3]
    pairs, reference = all_pairs(graph), histogram(other, other.label, ITERATIONS)
    rivals = []
    for pair in some_pairs(graph, 5):
        flipped = nx.from_edgelist(graph.flip(pair).edge.tolist())
        nx.set_node_attributes(flipped, dict(enumerate(map(str, graph.label.tolist()))), 'label')
        rivals.append(flipped)
    record('wl_flip', f'n = {graph.node_count}, h = 3, all flips, labels',
           lambda: flip_kernels(graph, graph.label, pairs, ITERATIONS, reference),
           'networkx WL subgraph hashes',
           lambda: [nx.weisfeiler_lehman_subgraph_hashes(
               flipped, node_attr='label', iterations=ITERATIONS) for flipped in rivals],
           ours_units=len(pairs), rival_units=len(rivals))


@pytest.mark.parametrize('features', [100, 300])
def test_wl_flip_of_continuous_features(record, tour_graphs, features):
    graph = tour_graphs(features)[30]
    x, pairs = node_features(graph), all_pairs(graph)
    flipped = [graph.flip(pair) for pair in some_pairs(graph)]
    record('wl_flip', f'n = {graph.node_count}, h = 3, all flips, pooled features',
           lambda: flip_features(graph, x, pairs, ITERATIONS), 'recomputing (numpy, scipy)',
           lambda: [pooled_features(graph, x, ITERATIONS) for graph in flipped],
           ours_units=len(pairs), rival_units=len(flipped))


@pytest.mark.parametrize('features', [100, 300, 1000])
def test_greedy_step(record, tour_graphs, features):
    graphs = tour_graphs(features)
    detector = LoopClosureDetector(LcdConfig())
    for graph in graphs[:35]:
        detector.detect(graph)
    graph = graphs[35]
    references = detector.query_nodes(graph).compared.nodes
    assert len(references) >= 10
    scorer, pairs = FlipScorer(detector, graph), some_pairs(graph)
    found = scorer.logits(graph, pairs)
    assert found == pytest.approx(
        [detector.log_odds(graph.flip(pair)).max() for pair in pairs], abs=1e-9)
    every = graph.node_count * (graph.node_count - 1) // 2
    further = graph.flip(pairs[0])

    def two_steps():
        scorer.logits(graph)
        scorer.logits(further)

    size = f'n = {graph.node_count}, {len(references)} references'
    mark = 0.1 if features == 300 else None
    for step, ours, steps in (('first', lambda: flip_logits(detector, graph), 1),
                              ('further', two_steps, 2)):
        record('greedy_step', f'{size}, {step} step', ours, 'recomputing: a query for each flip',
               lambda: [detector.log_odds(graph.flip(pair)) for pair in pairs],
               mark, higher_is_better=False, ours_units=steps, rival_units=len(pairs) / every)
