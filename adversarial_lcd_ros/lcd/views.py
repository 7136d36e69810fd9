"""What a target derives from a graph before it compares, and what edge flips leave alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from adversarial_lcd_ros.graph import DESCRIPTOR_BYTES, MultiTierGraph
from adversarial_lcd_ros.hamming import lanes, mutual

MIN_COSINE = 0.4
NEIGHBOUR_WEIGHT = 0.5
LENGTH_SCALE = 0.1
_BITS = 8 * DESCRIPTOR_BYTES
# The largest distance whose cosine, 1 - 2 distance / bits, is above MIN_COSINE.
_FARTHEST = math.ceil((1 - MIN_COSINE) * _BITS / 2) - 1


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
    def lanes(self) -> NDArray[np.uint64]:
        """Descriptors of the features as ``hamming`` compares them, shape (4, features)."""
        return lanes(self.graph.descriptor[self.objects:])

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


@dataclass(frozen=True)
class NodeMatch:
    """
    Features of a query and of a reference that are each other's nearest neighbour.

    Attributes
    ----------
    query, reference : int64, (k,)
        Node indices.
    weight : float32, (k,)
        sqrt(cosine - 0.4), only pairs above that cosine.

    """

    query: NDArray[np.int64]
    reference: NDArray[np.int64]
    weight: NDArray[np.float32]


def match_nodes(query: View, reference: View) -> NodeMatch:
    """Return the mutual nearest neighbours between the features of two graphs."""
    first, second, distance = mutual(query.lanes, reference.lanes, _FARTHEST)
    cosine = 1 - distance / np.float32(_BITS / 2)
    return NodeMatch(first + query.objects, second + reference.objects,
                     np.sqrt(cosine - np.float32(MIN_COSINE)))


class Comparison:
    """
    A query's nodes beside several references: all that edge flips of the query leave alone.

    An attack asks about the same nodes hundreds of times. What is kept here is laid out for
    that: one flat array over all references, ``*_owner`` telling whose a row is.

    Attributes
    ----------
    references : list of View
    matches : list of NodeMatch
    features, objects, edges : int64, (r,)
        Numbers of each reference.

    """

    def __init__(self, query: View, references: Sequence[View]) -> None:
        self.references = list(references)
        self.matches = [match_nodes(query, reference) for reference in references]
        self.features = np.array([view.features for view in references], np.int64)
        self.objects = np.array([view.objects for view in references], np.int64)
        self.edges = np.array([view.graph.edge_count for view in references], np.int64)
        self._query_nodes = query.graph.node_count

    def __len__(self) -> int:
        """Return the number of references, r."""
        return len(self.references)

    def total(self, owner: NDArray[np.int64], value: NDArray[np.floating[Any]]
              ) -> NDArray[np.float64]:
        """Return the sum of the values of each reference, shape (r,)."""
        sums: NDArray[Any] = np.bincount(owner, value, minlength=len(self))
        return sums.astype(np.float64)

    @cached_property
    def match_owner(self) -> NDArray[np.int64]:
        """Reference of each matched feature, shape (k,)."""
        return np.repeat(np.arange(len(self)), [len(match.query) for match in self.matches])

    @cached_property
    def match_query(self) -> NDArray[np.int64]:
        """Query node of each matched feature, shape (k,)."""
        return np.concatenate([match.query for match in self.matches])

    @cached_property
    def match_weight(self) -> NDArray[np.float32]:
        """Weight of each matched feature, shape (k,)."""
        return np.concatenate([match.weight for match in self.matches])

    @cached_property
    def match_x1(self) -> NDArray[np.float32]:
        """Reference's features after one WL iteration, of each matched feature, (k, 256)."""
        return np.concatenate([view.x1[match.reference] for view, match
                               in zip(self.references, self.matches, strict=True)])

    @cached_property
    def object_x1(self) -> NDArray[np.float32]:
        """Reference's objects after one WL iteration, shape (sum of objects, 256)."""
        return np.concatenate([view.x1[:view.objects] for view in self.references])

    @cached_property
    def _credit(self) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
        keys, weights, owners = [], [], []
        for owner, (view, match) in enumerate(zip(self.references, self.matches, strict=True)):
            node = np.full(view.graph.node_count, -1, np.int64)
            weight = np.zeros(view.graph.node_count)
            node[match.reference], weight[match.reference] = match.query, match.weight
            u, v = node[view.graph.edge[:, 0]], node[view.graph.edge[:, 1]]
            both = (u >= 0) & (v >= 0)
            keys.append((np.minimum(u, v) * self._query_nodes + np.maximum(u, v))[both])
            weights.append((weight[view.graph.edge[:, 0]] * weight[view.graph.edge[:, 1]])[both])
            owners.append(np.full(len(keys[-1]), owner))
        return np.concatenate(keys), np.concatenate(weights), np.concatenate(owners)

    @property
    def credit_key(self) -> NDArray[np.int64]:
        """Query pairs, as source * n + target, whose matches a reference joins, (c,)."""
        return self._credit[0]

    @property
    def credit_weight(self) -> NDArray[np.float64]:
        """w_u w_v of each such pair: what the query earns by having that edge, (c,)."""
        return self._credit[1]

    @property
    def credit_owner(self) -> NDArray[np.int64]:
        """Reference of each such pair, shape (c,)."""
        return self._credit[2]
