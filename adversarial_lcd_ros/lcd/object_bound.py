# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What no b flips can do to the score of the target symbio: a proven bound."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd import bound_kernels
from adversarial_lcd_ros.lcd.bound import Range, shared_out
from adversarial_lcd_ros.lcd.object_matches import ObjectMatches
from adversarial_lcd_ros.lcd.targets.scores import share
from adversarial_lcd_ros.lcd.views import Comparison, View


class ObjectMatchBound:
    """
    ``SymbioTarget``: t flips between objects and s spokes, flips of an object with a feature.

    *Objects.* Two objects are alike by K (1 + r + r^2 ...), which rises with
    r = c / e: of what both are joined with, themselves counted, c is of the same classes and e is
    all; e = c + d + x, with d of the other's classes missing here and x here in excess. Each of
    the t flips changes one count at an object by one: p of them may make c larger, at most d, and
    q make e smaller, at most x, so r <= (c + p) / (e - q) for some p + q = t; or c smaller, which
    is at least 1, and e larger.

    *Spokes.* A match is worth the mean, over the objects i of its feature, of the mean likeness
    g(i) with the objects of the other feature. Its largest value over sets of objects that m
    spokes lead to is found exactly (``bound_kernels.largest_ratio`` with 1 below), with g at
    its largest; likewise the least, and 0 without an object.

    A spoke has one feature: how s are best shared out among features is found by dynamic
    programming. All t and s with t + s = b are tried.
    """

    iterations: ClassVar[int]
    other_class: ClassVar[float]

    def __init__(self, query: View, nodes: Comparison, average: NDArray[np.float64]) -> None:
        self._query = query
        self._each = ObjectMatches.with_each(query, nodes, self.iterations, self.other_class)
        node = np.concatenate([np.zeros(0, np.int64), *(each.match.query for each in self._each)])
        owner = np.repeat(np.arange(len(nodes)), [len(each.match.query) for each in self._each])
        self._order = np.argsort(node, kind='stable')
        self._node = node[self._order]
        self._share = share(average, query.features, nodes.features)[:, owner[self._order]]
        self._member = _objects_of(query.graph, query.objects)

    def after(self, budget: int) -> Range:
        """Return the least and the largest score after up to 0, 1, ... budget flips."""
        objects, shape = self._query.objects, (budget + 1, len(self._share))
        most = max(min(budget, objects), 1)
        levels = np.unique([*range(1, min(most, 4)), most])
        least, largest = np.full(shape, np.inf), np.full(shape, -np.inf)
        for turned in range(min(budget, objects * (objects - 1) // 2) + 1):
            left = budget - turned
            low, high = self._worth(turned, np.r_[0, levels])
            gain = shared_out(high[:, 1:] - high[:, :1], self._share, self._node, levels, left)
            loss = shared_out(low[:, :1] - low[:, 1:], self._share, self._node, levels, left)
            largest[turned:] = np.maximum(largest[turned:], self._share @ high[:, 0] + gain)
            least[turned:] = np.minimum(least[turned:], self._share @ low[:, 0] - loss)
        return (np.maximum(np.minimum.accumulate(least), 0), np.maximum.accumulate(largest))

    def _worth(self, turned: int, levels: NDArray[np.int64]
               ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return what each match is worth at least and at most, shape (k, l) each."""
        found: list[list[NDArray[np.float64]]] = [[np.zeros((0, len(levels)))] for _ in range(2)]
        for each in self._each:
            member = _objects_of(each.reference.graph, each.reference.objects)[
                each.match.reference]
            count = member.sum(axis=1)
            low, high = ((alike @ member.T / np.maximum(count, 1)).T
                         for alike in self._alike(each, turned))
            least, largest = bound_kernels.mean_bounds(
                self._member[each.match.query], np.ascontiguousarray(low),
                np.ascontiguousarray(high), levels)
            weight = np.where(count, each.match.weight, 0).astype(np.float64)[:, None]
            found[0].append(least * weight)
            found[1].append(largest * weight)
        low, high = (np.concatenate(parts)[self._order] for parts in found)
        return low, high

    def _alike(self, each: ObjectMatches, turned: int
               ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return how alike objects are at least and at most, (objects, others) each."""
        here, there = each.around(self._query)[:, None], each.other_around[None]
        common = 1.0 + np.minimum(here, there).sum(axis=2)
        missing = np.maximum(there - here, 0).sum(axis=2)
        excess = np.maximum(here - there, 0).sum(axis=2)
        either = common + missing + excess
        low, high = common / either, common / either
        for more in range(turned + 1):
            other = turned - more
            high = np.maximum(high, (common + np.minimum(more, missing))
                              / (either - np.minimum(other, excess)))
            low = np.minimum(low, np.maximum(common - more, 1) / (either + other))
        first = np.where(each.classes[:, None] == each.other_classes, 1.0, self.other_class)
        power = np.arange(self.iterations)[:, None, None]
        return first * (low ** power).sum(axis=0), first * (high ** power).sum(axis=0)


def _objects_of(graph: MultiTierGraph, objects: int) -> NDArray[np.bool_]:
    """Return which objects each node is joined with, (n, objects)."""
    member = np.zeros((graph.node_count, objects), bool)
    spoke = graph.edge[graph.edge[:, 0] < objects]
    member[spoke[:, 1], spoke[:, 0]] = True
    return member
