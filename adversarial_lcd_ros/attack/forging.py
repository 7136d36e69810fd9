# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Graphs whose nodes are forged: their edges, and what was changed in them.

An attacker who changes nodes changes edges with them, by the builder's rule, and none of them is
an edit of its own. So a forged graph has two counts: nodes that differ, and edges that neither the
rule nor the clean graph explains.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.edge_rule import joined_pairs
from adversarial_lcd_ros.graph import MultiTierGraph

_NODE_FIELDS = ('tier', 'label', 'position', 'size', 'score', 'descriptor')


@dataclass(frozen=True)
class Change:
    """
    In what a forwarded graph differs from the clean one.

    Attributes
    ----------
    edits : int
        Edges flipped; of a graph with changed nodes those that do not follow from them.
    nodes : int
        Nodes changed.

    """

    edits: int = 0
    nodes: int = 0


def change_between(clean: MultiTierGraph, forwarded: MultiTierGraph) -> Change:
    """
    Return what was changed in a graph, whoever did it and however.

    A graph of which no node is left is another graph: its edges count with its nodes.
    """
    if clean.node_digest == forwarded.node_digest:
        return Change(len(clean.flips_to(forwarded)))
    moved = _changed_nodes(clean, forwarded)
    if moved >= clean.node_count:
        return Change(0, moved)
    neighbours = neighbours_of(clean)
    # Edges of another builder do not all follow the rule: the clean graph tells how many do not.
    strange = _unexplained(forwarded, neighbours) - _unexplained(clean, neighbours)
    return Change(max(0, strange), moved)


def with_positions(graph: MultiTierGraph, position: NDArray[np.float32],
                   neighbours: int) -> MultiTierGraph:
    """
    Return a graph with its nodes elsewhere, and the edges that follow.

    Parameters
    ----------
    graph : MultiTierGraph
    position : float32, (n, 2)
        Pixels, within the picture.
    neighbours : int
        k of the builder's rule (``neighbours_of``).

    """
    none: NDArray[np.uint32] = np.zeros((0, 2), np.uint32)
    moved = replace(graph, position=position, edge=none,
                    edge_length=np.zeros(0, np.float32))
    edge = joined_pairs(moved.position, moved.size, moved.object_count, neighbours,
                        moved.has_scene)
    return moved.with_edges(edge, moved.length_between(edge))


def neighbours_of(graph: MultiTierGraph) -> int:
    """
    Return k of the builder's rule, which anybody can see in a graph.

    A feature is joined with its k nearest, and with others only if it is among theirs: the least
    degree among features is k, where there are more than k of them.
    """
    first = graph.object_count
    ends = graph.edge[graph.edge[:, 0] >= first].astype(np.int64) - first
    degree = np.bincount(ends.ravel(), minlength=graph.node_count - first)
    return int(degree.min()) if len(degree) else 0


def among_nearest(graph: MultiTierGraph, pairs: NDArray[np.int64], neighbours: int
                  ) -> NDArray[np.bool_]:
    """
    Tell which pairs would be edges between features if more neighbours were joined, (k,).

    Parameters
    ----------
    graph : MultiTierGraph
    pairs : int64, (k, 2)
        Source < target.
    neighbours : int
        Nearest features that each would be joined with.

    """
    edge = joined_pairs(graph.position, graph.size, graph.object_count, neighbours,
                        graph.has_scene)
    key = edge.astype(np.int64) @ (graph.node_count, 1)
    near: NDArray[np.bool_] = np.isin(pairs @ (graph.node_count, 1), key)
    return near & (pairs[:, 0] >= graph.object_count)


def _changed_nodes(one: MultiTierGraph, other: MultiTierGraph) -> int:
    if one.node_count != other.node_count:
        return max(one.node_count, other.node_count)
    differs = np.zeros(one.node_count, bool)
    for name in _NODE_FIELDS:
        rows = getattr(one, name) != getattr(other, name)
        differs |= rows.reshape(one.node_count, -1).any(axis=1)
    return int(differs.sum())


def _unexplained(graph: MultiTierGraph, neighbours: int) -> int:
    edge = joined_pairs(graph.position, graph.size, graph.object_count, neighbours,
                        graph.has_scene)
    key = edge.astype(np.int64) @ (graph.node_count, 1)
    return len(np.setxor1d(graph.edge_key, key, assume_unique=True))
