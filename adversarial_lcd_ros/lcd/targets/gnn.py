# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A small graph neural network: matched features count by how alike it embeds them."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.incidence import LENGTH_SCALE
from adversarial_lcd_ros.errors import FileError, ModelError
from adversarial_lcd_ros.files.network import open_network
from adversarial_lcd_ros.lcd.targets.base import Target
from adversarial_lcd_ros.lcd.targets.scores import share
from adversarial_lcd_ros.lcd.views import Comparison, View
from adversarial_lcd_ros.paths import model_path

NETWORK = 'target_gnn.onnx'
INPUTS, OUTPUT = ('features', 'adjacency'), 'embedding'


def network_inputs(view: View) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """
    Return what the network sees of a graph.

    Returns
    -------
    features : float32, (n, 257)
        Descriptor bits as +-1/16, zeros for objects; 1 for objects.
    adjacency : float32, (n, n)
        Weights exp(-length / 0.1); the rows of nodes with neighbours sum to 1.

    """
    features = np.zeros((view.graph.node_count, view.x0.shape[1] + 1), np.float32)
    features[:, :-1] = view.x0 / np.float32(16)
    features[:view.objects, -1] = 1
    weight = view.graph.weighted_adjacency(LENGTH_SCALE).toarray().astype(np.float32)
    return features, weight / np.maximum(weight.sum(axis=1, keepdims=True), np.float32(1e-12))


class GnnTarget(Target):
    """
    Matched features, weighed by the cosine of their embeddings.

    Two layers of message passing embed every node together with what is around it; the network
    is trained so that this tells loops from other places (gnn_training.py).

    Parameters
    ----------
    network : Path, optional
        ONNX file; the one that ships if not given.

    Raises
    ------
    ModelError
        The file is missing or damaged, or of another network.

    """

    name: ClassVar[str] = 'gnn'
    channels: ClassVar[tuple[str, ...]] = ('matches',)
    trainer: ClassVar[str] = 'adversarial_lcd_ros.training.gnn:GnnTrainer'
    query_s: ClassVar[float] = 3.5e-3
    flip_s: ClassVar[float] = 3.5e-3

    def __init__(self, network: Path | None = None) -> None:
        path = network or model_path(NETWORK)
        try:
            self._session = open_network(path, threads=1)
        except FileError as error:
            raise ModelError(f'{path} is no network: {error}; train one with "adversarial-lcd '
                             'train --targets gnn"') from error
        names = tuple(entry.name for entry in self._session.get_inputs())
        if names != INPUTS or [entry.name for entry in self._session.get_outputs()] != [OUTPUT]:
            raise ModelError(f'{path} has inputs {names}: expected {INPUTS} and the output '
                             f'{OUTPUT}')
        self._kept: WeakKeyDictionary[View, NDArray[np.float32]] = WeakKeyDictionary()

    @classmethod
    def open(cls, network: Path | None) -> Target:
        """Return the target with the network of a file; the one that ships if not given."""
        return cls(network)

    def embed(self, view: View) -> NDArray[np.float32]:
        """Return the embedding of every node, unit rows, (n, d)."""
        feed = dict(zip(INPUTS, network_inputs(view), strict=True))
        rows: NDArray[np.float32] = self._session.run([OUTPUT], feed)[0]
        norm = np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), np.float32(1e-12))
        return np.asarray(rows / norm, np.float32)

    def compare(self, query: View, nodes: Comparison) -> NDArray[np.float64]:
        """Return the score of a query with every reference, shape (r, 1)."""
        own = self.embed(query)
        total = np.zeros(len(nodes))
        for place, (reference, match) in enumerate(zip(nodes.references, nodes.matches,
                                                       strict=True)):
            if reference not in self._kept:
                self._kept[reference] = self.embed(reference)
            other = self._kept[reference]
            cosine = np.einsum('ij,ij->i', own[match.query], other[match.reference])
            total[place] = match.weight @ np.maximum(cosine, 0)
        return share(total, query.features, nodes.features)[:, None]
