# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The graph neural network: what it computes, what is refused, and a tiny training."""

import sys

from graph_factory import make_graph
import numpy as np
import pytest

from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.lcd.targets.gnn import NETWORK, GnnTarget, network_inputs
from adversarial_lcd_ros.lcd.views import Comparison, View
from adversarial_lcd_ros.paths import model_path
from adversarial_lcd_ros.training import gnn as gnn_training
from adversarial_lcd_ros.training.pair_scores import LabelledPairs

GRAPH = make_graph(30, [(0, 1), *((0, k) for k in range(2, 12)), *((k, k + 1) for k in
                                                                  range(2, 29))], objects=2)


def score(query, reference, network=None):
    view = View(query)
    return GnnTarget(network).compare(view, Comparison(view, [View(reference)])).item()


def test_the_network_sees_descriptors_tier_and_lengths():
    features, adjacency = network_inputs(View(GRAPH))
    assert features.shape == (30, 257)
    assert np.linalg.norm(features, axis=1) == pytest.approx(np.ones(30))
    assert features[:3, -1].tolist() == [1, 1, 0]
    lone = network_inputs(View(GRAPH.flip([(0, 1), (28, 29)])))[1]
    assert adjacency.sum(axis=1) == pytest.approx(np.ones(30))
    assert lone[[1, 29]].sum() == 0
    length = GRAPH.length_between(np.array([[2, 0], [2, 3]]))
    assert adjacency[2, 0] / adjacency[2, 3] == pytest.approx(
        np.exp((length[1] - length[0]) / 0.1), rel=1e-4)


def test_it_passes_messages_twice():
    onnx = pytest.importorskip('onnx')
    weight = {entry.name: onnx.numpy_helper.to_array(entry)
              for entry in onnx.load(model_path(NETWORK)).graph.initializer}
    view = View(GRAPH)
    rows, adjacency = network_inputs(view)
    for layer in range(2):
        rows = np.maximum(rows, 0) if layer else rows
        rows = (rows @ weight[f'own{layer}'] + adjacency @ (rows @ weight[f'around{layer}'])
                + weight[f'bias{layer}'])
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    assert GnnTarget().embed(view) == pytest.approx(rows, abs=1e-5)


def test_a_graph_is_most_like_itself_and_flips_show():
    whole = score(GRAPH, GRAPH)
    assert whole == pytest.approx(np.sqrt(0.6), abs=1e-5)
    for pair in [(5, 20), (0, 3), (0, 25)]:
        assert score(GRAPH.flip([pair]), GRAPH) < whole - 1e-6


def test_the_network_that_ships_is_small():
    assert model_path(NETWORK).stat().st_size < 1e6


def test_what_is_no_network_is_refused(tmp_path):
    path = tmp_path / 'target_gnn.onnx'
    with pytest.raises(ModelError, match='is no network'):
        GnnTarget(path)
    path.write_bytes(b'damaged')
    with pytest.raises(ModelError, match='train --targets gnn'):
        GnnTarget(path)


def test_another_network_is_refused(tmp_path):
    onnx = pytest.importorskip('onnx')
    value = [onnx.helper.make_tensor_value_info(name, 1, [1]) for name in ('x', 'y')]
    graph = onnx.helper.make_graph([onnx.helper.make_node('Relu', ['x'], ['y'])], 'other',
                                   value[:1], value[1:])
    onnx.save(onnx.helper.make_model(graph, ir_version=8, opset_imports=[
        onnx.helper.make_opsetid('', 14)]), tmp_path / 'other.onnx')
    with pytest.raises(ModelError, match=r"inputs \('x',\): expected"):
        GnnTarget(tmp_path / 'other.onnx')


def training():
    """Return six places, each seen twice: the second time with other edges and a few bits."""
    rng, graphs = np.random.default_rng(0), []
    for place in range(6):
        for _ in range(2):
            edges = [tuple(rng.choice(20, 2, replace=False)) for _ in range(40)]
            graphs.append(make_graph(20, edges, objects=2, seed=place))
    pairs = np.array([(b, a) for b in range(12) for a in range(b)])
    return LabelledPairs(graphs, pairs[:, 0], pairs[:, 1], pairs[:, 0] // 2 == pairs[:, 1] // 2)


def test_same_seed_same_network(tmp_path, monkeypatch):
    pytest.importorskip('torch')
    pytest.importorskip('onnx')
    monkeypatch.setattr(gnn_training, 'EPOCHS', 1)
    monkeypatch.setattr(gnn_training, 'PAIRS', 6)
    done = []
    cards = [gnn_training.GnnTrainer().train([training()], tmp_path / name, seed,
                                    lambda *epochs: done.append(epochs))
             for name, seed in (('one', 1), ('again', 1), ('other', 2))]
    assert done == [(1, 1)] * 3
    assert cards[0] == cards[1]
    assert cards[0]['pairs_an_epoch'] == 12
    one, again, other = ((tmp_path / name).read_bytes() for name in ('one', 'again', 'other'))
    assert one == again
    assert one != other
    assert score(GRAPH, GRAPH, tmp_path / 'one') == pytest.approx(np.sqrt(0.6), abs=1e-5)


def test_without_pytorch_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, 'torch', None)
    with pytest.raises(ModelError, match=r'pip install "adversarial_lcd_ros\[gnn\]"'):
        gnn_training.GnnTrainer()
