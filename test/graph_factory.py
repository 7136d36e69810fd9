# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Graphs for tests: small ones to compute by hand, random ones for invariants."""

from dataclasses import replace

from hypothesis import strategies as st
import numpy as np

from adversarial_lcd_ros.graph import SCENE_CLASS, MultiTierGraph
from adversarial_lcd_ros.registry import TARGETS


def make_graph(nodes=6, edges=((0, 1), (0, 2), (1, 3), (2, 4)), objects=2, seed=0, **fields):
    """Return a valid graph with random node values and the given edges."""
    rng = np.random.default_rng(seed)
    edge = np.array(sorted({tuple(sorted(pair)) for pair in edges}), np.uint32).reshape(-1, 2)
    tier = np.r_[np.zeros(objects), np.ones(nodes - objects)].astype(np.uint8)
    descriptor = rng.integers(0, 256, (nodes, 32)).astype(np.uint8)
    descriptor[:objects] = 0
    word = np.unique(rng.integers(0, 1000, nodes)).astype(np.uint32)
    values = {
        'stamp_ns': 1_000_000_007, 'frame_id': 'camera', 'sequence': 3,
        'width': 640, 'height': 480, 'tier': tier,
        'label': rng.integers(0, 3, nodes).astype(np.uint32),
        'position': (rng.random((nodes, 2)) * (640, 480)).astype(np.float32),
        'size': (rng.random((nodes, 2)) * 50 + 10).astype(np.float32),
        'score': rng.random(nodes).astype(np.float32),
        'descriptor': descriptor, 'edge': edge,
        'word': word, 'word_weight': np.full(len(word), 1 / max(len(word), 1), np.float32),
    } | fields
    graph = MultiTierGraph(**values, edge_length=np.zeros(len(edge), np.float32))
    return MultiTierGraph(**values, edge_length=graph.length_between(edge))


@st.composite
def graphs(draw, min_nodes=3, max_nodes=14):
    """Draw valid graphs of any number of objects, features and edges."""
    nodes = draw(st.integers(min_nodes, max_nodes))
    pairs = [(a, b) for a in range(nodes) for b in range(a + 1, nodes)]
    some = st.lists(st.sampled_from(pairs), unique=True) if pairs else st.just([])
    edges = draw(some)
    return make_graph(nodes, edges, draw(st.integers(0, nodes)), draw(st.integers(0, 2**16)))


def flips_of(graph, rng, count):
    """Return distinct random pairs of a graph, shape (count, 2)."""
    source, target = np.triu_indices(graph.node_count, 1)
    chosen = rng.choice(len(source), min(count, len(source)), replace=False)
    return np.stack([source[chosen], target[chosen]], axis=1)


def with_scene(graph):
    """Return a graph with one object more, the scene, which is joined with nothing."""
    if graph.has_scene:
        return graph
    count = graph.object_count
    scene = {'tier': 0, 'label': SCENE_CLASS, 'position': (graph.width / 2, graph.height / 2),
             'size': (graph.width, graph.height), 'score': 1, 'descriptor': 0}
    return replace(graph, edge=graph.edge + (graph.edge >= count).astype(np.uint32), **{
        name: np.insert(getattr(graph, name), count, value, axis=0)
        for name, value in scene.items()})


def suited(target, graph):
    """Return a graph as a target needs it."""
    return with_scene(graph) if TARGETS[target].graph_variant else graph


def patch(graph, rng, features, objects):
    """Return a graph of a few of the nodes: features around a random one, the last objects."""
    feature = np.arange(graph.object_count, graph.node_count)
    distance = np.linalg.norm(graph.position[feature]
                              - graph.position[rng.choice(feature)], axis=1)
    kept = np.r_[np.arange(max(graph.object_count - objects, 0), graph.object_count),
                 np.sort(feature[distance.argsort()[:features]])]
    place = np.full(graph.node_count, -1)
    place[kept] = np.arange(len(kept))
    edge = place[graph.edge]
    there = (edge >= 0).all(axis=1)
    return replace(graph, edge=edge[there].astype(np.uint32),
                   edge_length=graph.edge_length[there], **{
                       name: getattr(graph, name)[kept] for name in
                       ('tier', 'label', 'position', 'size', 'score', 'descriptor')})
