# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The object tier alone: classes, sizes and arrangement of objects, no visual features."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.targets.base import Target
from adversarial_lcd_ros.lcd.targets.scores import assign_objects, share
from adversarial_lcd_ros.lcd.views import Comparison, Feels, View

# Lengths over the image diagonal: how far a neighbour counts, how much an edge may differ.
REACH, TOLERANCE = 0.3, 0.05


class ObjectsTarget(Target):
    """
    Objects of the same class and of similar size among similar neighbours; and their edges.

    Features do not count: for graphs that have none, as those of recorded detections.
    """

    name: ClassVar[str] = 'objects'
    channels: ClassVar[tuple[str, ...]] = ('objects', 'edges')
    feels: ClassVar[Feels] = Feels.AT_OBJECTS
    query_s: ClassVar[float] = 2.5e-3
    flip_s: ClassVar[float] = 40e-6

    def compare(self, query: View, nodes: Comparison) -> NDArray[np.float64]:
        """Return the scores (objects, edges) of a query with every reference, shape (r, 2)."""
        objects, edges = np.zeros(len(nodes)), np.zeros(len(nodes))
        own = _object_edges(query.graph)
        classes = np.unique(np.concatenate([
            view.graph.label[:view.objects] for view in (query, *nodes.references)]))
        mine = _neighbourhood(query.graph, own, classes)
        for place, reference in enumerate(nodes.references):
            ends = _object_edges(reference.graph)
            rows, columns, alike = assign_objects(_alike(
                query.graph, reference.graph, mine,
                _neighbourhood(reference.graph, ends, classes)))
            objects[place] = alike.sum()
            common = _common_edges(query.graph, reference.graph, own, rows, columns, alike)
            edges[place] = common / max((len(own) + len(ends)) / 2, 1)
        return np.stack([share(objects, query.objects, nodes.objects), edges], axis=1)


def _object_edges(graph: MultiTierGraph) -> NDArray[np.int64]:
    """Return the edges between two objects, (e, 2); source < target, and objects come first."""
    return graph.edge[graph.edge[:, 1] < graph.object_count].astype(np.int64)


def _neighbourhood(graph: MultiTierGraph, ends: NDArray[np.int64],
                   classes: NDArray[np.uint32]) -> NDArray[np.float64]:
    """
    Return how much of each class is at and around each object, unit rows, (objects, classes).

    One continuous WL iteration on classes, weighted by exp(-length / reach).
    """
    label = np.searchsorted(classes, graph.label[:graph.object_count])
    known = np.zeros((len(label), len(classes)))
    weight = np.exp(-graph.length_between(ends) / REACH)
    for here, there in ((0, 1), (1, 0)):
        np.add.at(known, (ends[:, here], label[ends[:, there]]), weight)
    known[np.arange(len(label)), label] += 1
    unit: NDArray[np.float64] = known / np.linalg.norm(known, axis=1, keepdims=True)
    return unit


def _alike(query: MultiTierGraph, reference: MultiTierGraph, mine: NDArray[np.float64],
           other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how alike any two objects are, 0 to 1, (objects, objects of the reference)."""
    here, there = slice(query.object_count), slice(reference.object_count)
    same = query.label[here, None] == reference.label[None, there]
    scale = np.log(query.size[here, None] + 1) - np.log(reference.size[None, there] + 1)
    alike: NDArray[np.float64] = same * np.exp(-np.abs(scale).sum(axis=2)) * (mine @ other.T)
    return alike


def _common_edges(query: MultiTierGraph, reference: MultiTierGraph, ends: NDArray[np.int64],
                  rows: NDArray[np.int64], columns: NDArray[np.int64],
                  alike: NDArray[np.float64]) -> float:
    """Return the summed weight of the query's edges that recur, with the same offset."""
    partner, weight = np.full(query.object_count, -1), np.zeros(query.object_count)
    partner[rows], weight[rows] = columns, alike
    ends = ends[(partner[ends] >= 0).all(axis=1)]
    ends = ends[reference.has_edges(partner[ends])]
    matched = partner[ends]
    offset = (query.position[ends[:, 0]] - query.position[ends[:, 1]]) / query.diagonal
    offset -= (reference.position[matched[:, 0]] - reference.position[matched[:, 1]]
               ) / reference.diagonal
    gain = np.sqrt(weight[ends].prod(axis=1)) * np.exp(-np.hypot(*offset.T) / TOLERANCE)
    return float(gain.sum())
