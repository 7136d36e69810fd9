"""Flips between the most central nodes: the paper's own choice (Sec. 3.3, Eq. 2-3)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import eigsh

from adversarial_lcd_ros.attack.perturbations.base import Allowed
from adversarial_lcd_ros.graph import MultiTierGraph

TIE_DECIMALS = 9


def eigencentrality(graph: MultiTierGraph) -> NDArray[np.float64]:
    """
    Return the eigenvector x of the largest eigenvalue of A, at least 0, unit length, (n,).

    Of a disconnected graph it is that of the component with the largest eigenvalue, 0 elsewhere;
    equally large components share it. The shift A + I leaves eigenvectors alone and keeps the
    spectrum from being symmetric about 0 (bipartite graphs).
    """
    count = graph.node_count
    if count < 3 or not graph.edge_count:
        return np.full(count, 1 / np.sqrt(max(count, 1)))
    shifted = graph.adjacency.copy()
    shifted.setdiag(1.0)
    _, vectors = eigsh(shifted.tocsr(), k=1, which='LA', v0=np.ones(count), tol=1e-10)
    centrality: NDArray[np.float64] = np.abs(vectors[:, 0])
    return centrality


class Eigencentrality:
    """
    The pairs with the largest x_u x_v, recomputed on the graph at hand.

    Products that agree to nine decimals tie; ties go to the smaller node indices.
    """

    name: ClassVar[str] = 'eigencentrality'

    def propose(self, graph: MultiTierGraph, count: int, allowed: Allowed,
                rng: np.random.Generator) -> NDArray[np.int64]:
        """Return the pairs by falling product of centralities."""
        x = eigencentrality(graph)
        product = np.round(np.triu(np.outer(x, x), 1), TIE_DECIMALS)
        source, target = np.triu_indices(graph.node_count, 1)
        value = product[source, target]
        wanted = min(count + len(allowed.tried), len(value))
        while wanted:
            chosen = _largest(value, wanted)
            pairs = allowed.filter(graph, np.stack([source[chosen], target[chosen]], axis=1))
            if len(pairs) >= count or wanted == len(value):
                return pairs[:count]
            wanted = min(4 * wanted, len(value))
        return np.zeros((0, 2), np.int64)


def _largest(value: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Return the places of the largest values, falling, ties in order of place."""
    bound = np.partition(value, len(value) - count)[len(value) - count]
    places = np.flatnonzero(value >= bound)
    return places[np.argsort(-value[places], kind='stable')][:count]
