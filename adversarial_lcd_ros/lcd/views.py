"""What a target derives from a graph before it compares, and what edge flips leave alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from adversarial_lcd_ros.graph import MultiTierGraph

MIN_COSINE = 0.4
NEIGHBOUR_WEIGHT = 0.5
LENGTH_SCALE = 0.1


def unpack_descriptors(descriptor: NDArray[np.uint8]) -> NDArray[np.float32]:
    """
    Return ORB descriptors as unit vectors of +-1/16.

    Their dot product is the cosine 1 - 2 hamming / 256.

    Parameters
    ----------
    descriptor : uint8, (k, 32)

    Returns
    -------
    float32, (k, 256)

    """
    bits = np.unpackbits(descriptor, axis=1).astype(np.float32)
    bits -= np.float32(0.5)
    bits *= np.float32(0.125)
    return bits


class View:
    """
    A graph together with what is derived from it, each computed once and on demand.

    Attributes
    ----------
    graph : MultiTierGraph
    objects, features : int
        Number of nodes of each tier; objects are the first nodes.

    """

    def __init__(self, graph: MultiTierGraph, x0: NDArray[np.float32] | None = None) -> None:
        self.graph = graph
        self.objects = graph.object_count
        self.features = graph.node_count - graph.object_count
        if x0 is not None:
            self.x0 = x0

    @cached_property
    def x0(self) -> NDArray[np.float32]:
        """Initial node features: unit descriptors, zero for objects, shape (n, 256)."""
        rows = np.zeros((self.graph.node_count, 256), np.float32)
        rows[self.objects:] = unpack_descriptors(self.graph.descriptor[self.objects:])
        return rows

    @cached_property
    def neighbour_mean(self) -> NDArray[np.float32]:
        """Mean of x0 over the neighbours, weighted by exp(-length / 0.1), shape (n, 256)."""
        weight = self.graph.weighted_adjacency(LENGTH_SCALE).astype(np.float32)
        total = np.maximum(weight.sum(axis=1), np.float32(1e-12))
        mean: NDArray[np.float32] = sparse.diags_array(1 / total) @ weight @ self.x0
        return mean

    @cached_property
    def x1(self) -> NDArray[np.float32]:
        """Node features after one continuous WL iteration, unit rows, shape (n, 256)."""
        mixed = self.x0 + np.float32(NEIGHBOUR_WEIGHT) * self.neighbour_mean
        norm = np.sqrt(np.einsum('ij,ij->i', mixed, mixed))
        rows: NDArray[np.float32] = mixed / np.maximum(norm, np.float32(1e-12))[:, None]
        return rows

    @cached_property
    def degree(self) -> NDArray[np.int64]:
        """Number of edges at each node, shape (n,)."""
        return np.bincount(self.graph.edge.ravel(), minlength=self.graph.node_count)


@dataclass(frozen=True)
class NodeMatch:
    """
    Features of a query and of a reference that are each other's nearest neighbour.

    It depends on nodes only: edge flips leave it alone.

    Attributes
    ----------
    query, reference : int64, (k,)
        Node indices.
    weight : float32, (k,)
        sqrt(cosine - 0.4), only pairs above that cosine.
    partner : int64, (n_query,)
        Reference node of each query node, -1 without one.
    partner_weight : float32, (n_query,)
        Its weight, 0 without one.

    """

    query: NDArray[np.int64]
    reference: NDArray[np.int64]
    weight: NDArray[np.float32]
    partner: NDArray[np.int64]
    partner_weight: NDArray[np.float32]


def match_nodes(query: View, reference: View) -> NodeMatch:
    """Return the mutual nearest neighbours between the features of two graphs."""
    partner = np.full(query.graph.node_count, -1, np.int64)
    partner_weight = np.zeros(query.graph.node_count, np.float32)
    if not query.features or not reference.features:
        none = np.zeros(0, np.int64)
        return NodeMatch(none, none, np.zeros(0, np.float32), partner, partner_weight)
    cosine = query.x0[query.objects:] @ reference.x0[reference.objects:].T
    forward, backward = cosine.argmax(axis=1), cosine.argmax(axis=0)
    rows = np.arange(query.features)
    best = cosine[rows, forward]
    kept = np.flatnonzero((backward[forward] == rows) & (best > MIN_COSINE))
    weight = np.sqrt(best[kept] - np.float32(MIN_COSINE))
    ends = kept + query.objects, forward[kept] + reference.objects
    partner[ends[0]] = ends[1]
    partner_weight[ends[0]] = weight
    return NodeMatch(*ends, weight, partner, partner_weight)

