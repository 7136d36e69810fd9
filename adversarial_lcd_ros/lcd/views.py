# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What a target derives from a graph before it compares, and what edge flips leave alone.

Matches come from descriptors, not from Weisfeiler-Lehman features: else each flip would move all
of them, and nothing could be kept. A query is in double precision, references, of which 256 are
kept, in single.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.hamming import lanes, mutual
from adversarial_lcd_ros.compiled.incidence import Incidence, incidence
from adversarial_lcd_ros.graph import DESCRIPTOR_BYTES, MultiTierGraph
from adversarial_lcd_ros.lcd import kernels
from adversarial_lcd_ros.lcd.kernels import MIN_COSINE

_BITS = 8 * DESCRIPTOR_BYTES
# The largest distance whose cosine, 1 - 2 distance / bits, is above MIN_COSINE.
_FARTHEST = math.ceil((1 - MIN_COSINE) * _BITS / 2) - 1


# Tells which edges may recur: ``Comparison.with_credit``.
Keeps = Callable[['View', 'View', NDArray[np.int64], NDArray[np.int64]], NDArray[np.bool_]]


class Feels(Enum):
    """Flips of edges that can make a difference."""

    EVERY = 'every'
    AT_OBJECTS = 'at_objects'
    NONE = 'none'

    def among(self, pairs: NDArray[np.int64], objects: int) -> NDArray[np.bool_]:
        """Return which of (k, 2) pairs, source < target, can; objects are the first nodes."""
        if self is Feels.AT_OBJECTS:
            return pairs[:, 0] < objects
        return np.full(len(pairs), self is Feels.EVERY)


class View:
    """
    A graph together with what is derived from it, each computed once and on demand.

    Attributes
    ----------
    graph : MultiTierGraph
    objects, features : int
        Number of nodes of each tier; objects are the first nodes.

    """

    def __init__(self, graph: MultiTierGraph, same_nodes: View | None = None) -> None:
        self.graph = graph
        self.objects: int = same_nodes.objects if same_nodes else graph.object_count
        self.features = graph.node_count - self.objects
        self._same_nodes = same_nodes

    @cached_property
    def x0(self) -> NDArray[np.int8]:
        """Initial node features: descriptor bits as +-1, zero for objects, shape (n, 256)."""
        if self._same_nodes:
            return self._same_nodes.x0
        rows: NDArray[np.int8] = np.zeros((self.graph.node_count, _BITS), np.int8)
        bits = np.unpackbits(self.graph.descriptor[self.objects:], axis=1)
        rows[self.objects:] = 2 * bits.astype(np.int8) - 1
        return rows

    @cached_property
    def lanes(self) -> NDArray[np.uint64]:
        """Descriptors of the features as ``hamming`` compares them, shape (4, features)."""
        return lanes(self.graph.descriptor[self.objects:])

    @cached_property
    def incidence(self) -> Incidence:
        """Neighbours and edge weights of every node; see ``incidence.incidence``."""
        found: Incidence = incidence(self.graph.edge, self.graph.edge_length,
                                     self.graph.node_count)
        return found

    def iterated(self, nodes: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return features of some nodes after one continuous WL iteration, unit rows (k, 256)."""
        rows: NDArray[np.float64] = kernels.iterated_rows(nodes, self.x0, *self.incidence)
        return rows

    @cached_property
    def x1(self) -> NDArray[np.float32]:
        """Those of all nodes, rounded: many references are kept at once; shape (n, 256)."""
        return self.iterated(np.arange(self.graph.node_count)).astype(np.float32)


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
    that: flat arrays over all references, ``*_owner`` telling whose a row is. Matches are in the
    order of the query's nodes, credits in that of the query's edges.

    Attributes
    ----------
    references : list of View
    matches : list of NodeMatch
    features, objects, edges : int64, (r,)
        Numbers of each reference.

    """

    def __init__(self, query: View, references: Sequence[View]) -> None:
        self.references = list(references)
        self.features = np.array([view.features for view in references], np.int64)
        self.objects = np.array([view.objects for view in references], np.int64)
        self.edges = np.array([view.graph.edge_count for view in references], np.int64)
        self._query = query
        self._query_nodes = query.graph.node_count
        self._query_labels = query.graph.label[:query.objects]
        self._keeps: tuple[Keeps, ...] = ()

    def __len__(self) -> int:
        """Return the number of references, r."""
        return len(self.references)

    def total(self, owner: NDArray[np.int64], value: NDArray[np.float64]
              ) -> NDArray[np.float64]:
        """Return the sum of the values of each reference, shape (r,)."""
        sums: NDArray[np.float64] = kernels.total_by_owner(owner, value, len(self))
        return sums

    @cached_property
    def matches(self) -> list[NodeMatch]:
        """Matches with each reference; targets without features need none."""
        return [match_nodes(self._query, reference) for reference in self.references]

    @cached_property
    def _matched(self) -> NDArray[np.int64]:
        return _join([match.query for match in self.matches], np.int64)

    @cached_property
    def _order(self) -> NDArray[np.int64]:
        return np.argsort(self._matched, kind='stable')

    @cached_property
    def match_query(self) -> NDArray[np.int64]:
        """Query node of each matched feature, ascending, shape (k,)."""
        return self._matched[self._order]

    @cached_property
    def match_start(self) -> NDArray[np.int64]:
        """Where the matches of each query node begin, shape (n + 1,)."""
        return np.searchsorted(self.match_query, np.arange(self._query_nodes + 1))

    @cached_property
    def match_owner(self) -> NDArray[np.int64]:
        """Reference of each matched feature, shape (k,)."""
        lengths = [len(match.query) for match in self.matches]
        return np.repeat(np.arange(len(self)), lengths)[self._order]

    @cached_property
    def match_weight(self) -> NDArray[np.float64]:
        """Weight of each matched feature, shape (k,)."""
        weights = _join([match.weight for match in self.matches], np.float64)
        return weights[self._order]

    @cached_property
    def match_x1(self) -> NDArray[np.float32]:
        """Reference's features after one WL iteration, of each matched feature, (k, 256)."""
        rows: NDArray[np.float32] = np.empty((len(self.match_query), _BITS), np.float32)
        for owner, (view, match) in enumerate(zip(self.references, self.matches, strict=True)):
            rows[self.match_owner == owner] = view.x1[match.reference]
        return rows

    @cached_property
    def object_x1(self) -> NDArray[np.float32]:
        """Reference's objects after one WL iteration, shape (sum of objects, 256)."""
        return _join([view.x1[:view.objects] for view in self.references], np.float32, _BITS)

    @cached_property
    def object_owner(self) -> NDArray[np.int64]:
        """Reference of each object, shape (sum of objects,)."""
        return np.repeat(np.arange(len(self)), self.objects)

    @cached_property
    def _object_columns(self) -> list[slice]:
        ends = np.cumsum(self.objects).tolist()
        return [slice(end - count, end) for end, count
                in zip(ends, self.objects.tolist(), strict=True)]

    def objects_of(self, place: int) -> slice:
        """Return which rows of ``object_x1`` are a reference's."""
        return self._object_columns[place]

    @cached_property
    def same_class(self) -> NDArray[np.bool_]:
        """Whether an object of the query has a reference's class, (objects, sum of objects)."""
        labels = _join([view.graph.label[:view.objects] for view in self.references], np.uint32)
        same: NDArray[np.bool_] = self._query_labels[:, None] == labels
        return same

    @cached_property
    def credit(self) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
        """
        Query pairs whose matches a reference joins: what the query earns by having that edge.

        Returns
        -------
        key : int64, (c,)
            Pairs as source * n + target, ascending.
        weight : float64, (c,)
            w_u w_v.
        owner : int64, (c,)
            Reference of each.

        """
        keys, weights, owners = [], [], []
        for owner, (view, match) in enumerate(zip(self.references, self.matches, strict=True)):
            node = np.full(view.graph.node_count, -1, np.int64)
            weight = np.zeros(view.graph.node_count)
            node[match.reference], weight[match.reference] = match.query, match.weight
            u, v = node[view.graph.edge[:, 0]], node[view.graph.edge[:, 1]]
            both = np.flatnonzero((u >= 0) & (v >= 0))
            for keeps in self._keeps:
                both = both[keeps(self._query, view, np.stack([u[both], v[both]], axis=1),
                                  view.graph.edge[both].astype(np.int64))]
            u, v, ends = u[both], v[both], view.graph.edge[both]
            keys.append(np.minimum(u, v) * self._query_nodes + np.maximum(u, v))
            weights.append(weight[ends[:, 0]] * weight[ends[:, 1]])
            owners.append(np.full(len(keys[-1]), owner))
        key = _join(keys, np.int64)
        order = np.argsort(key, kind='stable')
        return key[order], _join(weights, np.float64)[order], _join(owners, np.int64)[order]

    def with_credit(self, keeps: Keeps) -> Comparison:
        """
        Return the same comparison with part of its ``credit``.

        Parameters
        ----------
        keeps : callable
            Given the query, a reference, (c, 2) pairs of the query's nodes and the reference's
            edges (c, 2) that would recur there, in the same order of ends: which may, (c,).

        """
        kept = Comparison(self._query, self.references)
        # Matches, and what hangs on them alone, are not computed twice.
        kept.__dict__.update({name: value for name, value in self.__dict__.items()
                              if name != 'credit'})
        kept._keeps = (*self._keeps, keeps)
        return kept


def _join(parts: Sequence[NDArray[Any]], dtype: type, *tail: int) -> NDArray[Any]:
    """Return arrays one after the other, also if there are none."""
    return np.concatenate([np.zeros((0, *tail), dtype), *parts], dtype=dtype)
