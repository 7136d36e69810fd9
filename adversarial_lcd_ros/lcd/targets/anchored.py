# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Object-anchored subgraphs: nearest to the paper's "semantic objects as main anchors"."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.hamming import compiled
from adversarial_lcd_ros.lcd.targets.base import Scores, Target
from adversarial_lcd_ros.lcd.targets.scores import assign_objects
from adversarial_lcd_ros.lcd.views import Comparison, Feels, NodeMatch, View

# How much the place of one feature beside another may differ, over the image diagonal, and the
# multiple of it from which nothing is left.
TOLERANCE, REACH = 0.02, 5.0
# What objects of different classes count: detectors take a chair for a couch in the next frame.
OTHER_CLASS = 0.5


class AnchoredTarget(Target):
    """
    Objects with the features that hang on them, as stars: alike if their arrangement recurs.

    Two features of an object count if their matches hang on one object of the other graph, too,
    and lie to each other as they do. Objects are assigned one to one. Edges between features do
    not count, nor do those between objects.
    """

    name: ClassVar[str] = 'anchored'
    channels: ClassVar[tuple[str, ...]] = ('stars',)
    feels: ClassVar[Feels] = Feels.AT_OBJECTS
    query_s: ClassVar[float] = 0.6e-3
    flip_s: ClassVar[float] = 8e-6

    def compare(self, query: View, nodes: Comparison) -> NDArray[np.float64]:
        """Return the score of a query with every reference, shape (r, 1)."""
        return self.prepare(query, nodes)(query)

    def prepare(self, base: View, nodes: Comparison) -> Scores:
        """Return what scores graphs with the nodes of a base: which spokes they have is left."""
        stars = [_Stars(base, reference, match) for reference, match
                 in zip(nodes.references, nodes.matches, strict=True)]

        def scores(query: View) -> NDArray[np.float64]:
            spokes = _spokes(query)
            size = _size(spokes)
            return np.array([[star.total(spokes) / max(np.sqrt(size * star.size), 1)]
                             for star in stars]).reshape(len(stars), 1)
        return scores


class _Stars:
    """What pairs of a query's matched features are worth if they hang on one object."""

    def __init__(self, query: View, reference: View, match: NodeMatch) -> None:
        spokes = _spokes(reference)
        self.size = _size(spokes)
        self._classes = np.where(
            query.graph.label[:query.objects, None] == reference.graph.label[:reference.objects],
            1.0, OTHER_CLASS)
        here, there = (view.graph.position[nodes] / view.graph.diagonal for view, nodes
                       in ((query, match.query), (reference, match.reference)))
        self._pairs = _pairs(spokes[match.reference], match.query, (here - there),
                             match.weight.astype(np.float64))

    def total(self, spokes: NDArray[np.bool_]) -> float:
        """Return the summed worth of a query's pairs, in the best assignment of objects."""
        worth = _shared(spokes, *self._pairs, self._classes.shape[1])
        return float(assign_objects(worth * self._classes)[2].sum())


def _spokes(view: View) -> NDArray[np.bool_]:
    """Return which features hang on which object, (n, objects); False for objects."""
    # Objects come first and source < target: an edge from an object to a feature is a spoke.
    edge = view.graph.edge
    edge = edge[(edge[:, 0] < view.objects) & (edge[:, 1] >= view.objects)]
    spokes = np.zeros((view.graph.node_count, view.objects), np.bool_)
    spokes[edge[:, 1], edge[:, 0]] = True
    return spokes


def _size(spokes: NDArray[np.bool_]) -> float:
    """Return the number of ordered pairs of features that hang on one object, over all objects."""
    return float((spokes.sum(axis=0).astype(np.float64) ** 2).sum())


@compiled
def _pairs(spokes: NDArray[np.bool_], node: NDArray[np.int64], shift: NDArray[np.float32],
           weight: NDArray[np.float64]) -> tuple[
               NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """
    Return the pairs of matched features that hang on one object of the reference.

    Parameters
    ----------
    spokes : bool, (k, objects)
        On which of the reference's objects each matched feature hangs.
    node : int64, (k,)
        The query's node.
    shift : float32, (k, 2)
        From where the match lies, over the diagonals.
    weight : float64, (k,)

    Returns
    -------
    one, other, anchor : int64, (p,)
        Two nodes of the query, and an object of the reference.
    worth : float64, (p,)
        w_u w_v exp(-|difference of shifts| / tolerance), twice: for both orders.

    """
    one, other, anchor, worth = [np.int64(0)], [np.int64(0)], [np.int64(0)], [0.0]
    for i in range(len(node)):
        for j in range(i):
            distance = np.hypot(shift[i, 0] - shift[j, 0], shift[i, 1] - shift[j, 1]) / TOLERANCE
            if distance >= REACH:
                continue
            for k in range(spokes.shape[1]):
                if spokes[i, k] and spokes[j, k]:
                    one.append(node[i])
                    other.append(node[j])
                    anchor.append(np.int64(k))
                    worth.append(2 * weight[i] * weight[j] * np.exp(-distance))
    return np.array(one)[1:], np.array(other)[1:], np.array(anchor)[1:], np.array(worth)[1:]


@compiled
def _shared(spokes: NDArray[np.bool_], one: NDArray[np.int64], other: NDArray[np.int64],
            anchor: NDArray[np.int64], worth: NDArray[np.float64], anchors: int
            ) -> NDArray[np.float64]:
    """Return the worth of pairs that hang on one object, (objects, objects of the reference)."""
    total = np.zeros((spokes.shape[1], anchors))
    for p in range(len(one)):
        for k in range(spokes.shape[1]):
            if spokes[one[p], k] and spokes[other[p], k]:
                total[k, anchor[p]] += worth[p]
    return total
