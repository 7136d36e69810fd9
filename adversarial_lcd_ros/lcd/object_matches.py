# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Matches of features by how alike their objects are: the arithmetic of the target symbio.

What a match is worth is computed by one function, for a graph and after a flip at its feature.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.hamming import compiled
from adversarial_lcd_ros.lcd.views import Comparison, NodeMatch, View

_ROUNDING = 1e-13
_NO_OBJECT = -1


@dataclass(frozen=True)
class ObjectMatches:
    """
    The matches of a query with one reference, and all that flips of its edges leave alone.

    Attributes
    ----------
    reference : View
    match : NodeMatch
    classes, other_classes : int64, (objects,)
        Of the query and of the reference, counted from 0.
    other_around : int64, (objects of the reference, classes)
        How many objects of each class each is joined with.
    iterations : int
        Weisfeiler-Lehman iterations that are summed.
    other_class : float
        What objects of different classes count.

    """

    reference: View
    match: NodeMatch
    classes: NDArray[np.int64]
    other_classes: NDArray[np.int64]
    other_around: NDArray[np.int64]
    iterations: int
    other_class: float

    @classmethod
    def with_each(cls, query: View, nodes: Comparison, iterations: int, other_class: float
                  ) -> list[ObjectMatches]:
        """Return those with each reference of a comparison."""
        found = []
        for reference, match in zip(nodes.references, nodes.matches, strict=True):
            labels = np.concatenate([query.graph.label[:query.objects],
                                     reference.graph.label[:reference.objects]])
            known, classes = np.unique(labels, return_inverse=True)
            mine, other = classes[:query.objects], classes[query.objects:]
            start, neighbour, _ = reference.incidence
            found.append(cls(reference, match, mine, other,
                             _around(start, neighbour, other, len(known)), iterations,
                             other_class))
        return found

    def total(self, query: View) -> float:
        """Return the summed worth of the matches of a query."""
        return float(self._worth(query, self._alike(query)).sum())

    def after_spokes(self, query: View) -> NDArray[np.float64]:
        """Return ``total`` after each flip of an object with a feature, (objects, nodes)."""
        alike = self._alike(query)
        now = self._worth(query, alike)
        before = now.sum()
        total = np.full((query.objects, query.graph.node_count), before)
        for flipped, row in enumerate(total):
            row[self.match.query] += self._worth(query, alike, flipped) - now
        # 0 where all that counted was taken away, not what rounding left.
        settled: NDArray[np.float64] = np.where(total > _ROUNDING * before, total, 0)
        return settled

    def around(self, query: View) -> NDArray[np.int64]:
        """Return how many objects of each class each is joined with, (objects, classes)."""
        start, neighbour, _ = query.incidence
        around: NDArray[np.int64] = _around(start, neighbour, self.classes,
                                            self.other_around.shape[1])
        return around

    def _alike(self, query: View) -> NDArray[np.float64]:
        alike: NDArray[np.float64] = _kernel(self.classes, self.around(query), self.other_classes,
                                             self.other_around, self.iterations, self.other_class)
        return alike

    def _worth(self, query: View, alike: NDArray[np.float64], flipped: int = _NO_OBJECT
               ) -> NDArray[np.float64]:
        """Return what each match is worth, its feature flipped with an object, shape (k,)."""
        mean: NDArray[np.float64] = _means(
            self.match.query, *query.incidence[:2], self.match.reference,
            *self.reference.incidence[:2], alike, flipped)
        return mean * self.match.weight


@compiled
def _around(start: NDArray[np.int64], neighbour: NDArray[np.int64], classes: NDArray[np.int64],
            count: int) -> NDArray[np.int64]:
    """Return how many objects of each class each object is joined with, (objects, classes)."""
    around = np.zeros((len(classes), count), np.int64)
    for i in range(len(classes)):
        for k in range(start[i], start[i + 1]):
            if neighbour[k] < len(classes):
                around[i, classes[neighbour[k]]] += 1
    return around


@compiled
def _kernel(classes: NDArray[np.int64], around: NDArray[np.int64],
            other_classes: NDArray[np.int64], other_around: NDArray[np.int64], iterations: int,
            other_class: float) -> NDArray[np.float64]:
    """
    Return how alike any two objects are, over all iterations, (objects, others).

    Iteration h has K_h = K_0 N^(h - 1): K_0 is 1 for one class, else ``other_class``; N is the
    share of what both are joined with, themselves counted, that is of the same classes.
    """
    alike = np.zeros((len(classes), len(other_classes)))
    for i in range(len(classes)):
        for j in range(len(other_classes)):
            common, either = 1, 1
            for c in range(around.shape[1]):
                common += min(around[i, c], other_around[j, c])
                either += max(around[i, c], other_around[j, c])
            value = 1.0 if classes[i] == other_classes[j] else other_class
            for _ in range(iterations):
                alike[i, j] += value
                value *= common / either
    return alike


@compiled
def _means(node: NDArray[np.int64], start: NDArray[np.int64], neighbour: NDArray[np.int64],
           other: NDArray[np.int64], other_start: NDArray[np.int64],
           other_neighbour: NDArray[np.int64], alike: NDArray[np.float64], flipped: int
           ) -> NDArray[np.float64]:
    """
    Return how alike the objects of both ends of each match are in the mean, 0 without, (k,).

    Parameters
    ----------
    node, other : int64, (k,)
        Features of the query and of the reference.
    start, neighbour, other_start, other_neighbour
        As ``incidence`` gives them.
    alike : float64, (objects, objects of the reference)
    flipped : int
        Object whose edge with the query's feature is flipped; -1: none.

    """
    mean = np.zeros(len(node))
    for m in range(len(node)):
        first, last = start[node[m]], start[node[m] + 1]
        joined = False
        for i in range(first, last):
            joined |= neighbour[i] == flipped
        total, pairs = 0.0, 0
        for j in range(other_start[other[m]], other_start[other[m] + 1]):
            there = other_neighbour[j]
            if there >= alike.shape[1]:
                continue
            for i in range(first, last):
                if neighbour[i] < alike.shape[0] and neighbour[i] != flipped:
                    total += alike[neighbour[i], there]
                    pairs += 1
            if flipped >= 0 and not joined:
                total += alike[flipped, there]
                pairs += 1
        if pairs:
            mean[m] = total / pairs
    return mean
