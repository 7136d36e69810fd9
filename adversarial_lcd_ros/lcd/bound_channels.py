# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What no b flips can do to a score: proven bounds, for certificates.

One class for each channel, as in flip_channels.py. ``after(budget)`` returns the least and the
largest score, averaged over each candidate's window, after any up to 0, 1, ... flips; shape
(budget + 1, candidates) each. Every channel is bounded as if all flips were spent on it alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from adversarial_lcd_ros.compiled.incidence import LENGTH_SCALE
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd import bound_kernels, kernels
from adversarial_lcd_ros.lcd.bound import Range, shared_out
from adversarial_lcd_ros.lcd.kernels import MIN_COSINE
from adversarial_lcd_ros.lcd.targets.scores import object_cosines, share
from adversarial_lcd_ros.lcd.views import Comparison, View

# References are kept in single precision.
_SINGLE = 1e-6


class EdgeBound:
    """
    ``edge_score``, exactly.

    Let j edges be added and d deleted. The number of edges is then M + j - d, whichever they are,
    and with it the divisor of each reference is known: the score is a sum over the edges there
    are, of what each earns over that divisor. So it is largest if the j best of those that are
    not there are added and the d of least worth are deleted, least if the d of most worth are
    deleted and edges of no worth added; and all j and d with j + d <= b are tried.
    """

    def __init__(self, query: View, nodes: Comparison, average: NDArray[np.float64]) -> None:
        self._graph, self._nodes, self._average = query.graph, nodes, average
        key, self._weight, self._owner = nodes.credit
        self._key, self._first = np.unique(key, return_index=True)
        self._present = np.isin(self._key, query.graph.edge_key)
        self._now = kernels.total_of_common(query.graph.edge_key, *nodes.credit, len(nodes))

    def after(self, budget: int) -> Range:
        """Return the least and the largest score after up to 0, 1, ... budget flips."""
        shape = budget + 1, len(self._average)
        least, largest = np.full(shape, np.inf), np.full(shape, -np.inf)
        for growth in range(-budget, budget + 1):
            base, added, taken, spared = self._sums(growth, budget)
            for flips in range(abs(growth), budget + 1, 2):
                more, fewer = (flips + growth) // 2, (flips - growth) // 2
                if fewer > self._graph.edge_count:
                    break
                largest[flips] = np.maximum(largest[flips], base + added[more] - spared[fewer])
                least[flips] = np.minimum(least[flips], base - taken[fewer])
        return (np.maximum(np.minimum.accumulate(least), 0),
                np.maximum.accumulate(largest))

    def _sums(self, growth: int, budget: int) -> tuple[NDArray[np.float64], ...]:
        """Return the score, and sums of the best absent, best and worst present edges."""
        divisor = np.maximum((self._graph.edge_count + growth + self._nodes.edges) / 2, 1)
        each = self._average / divisor
        worth = (np.add.reduceat(each[:, self._owner].T * self._weight[:, None], self._first)
                 if len(self._key) else np.zeros((0, len(each))))
        absent, present = worth[~self._present], worth[self._present]
        idle = self._graph.edge_count - len(present)
        return (each @ self._now, _running(-np.sort(-absent, axis=0), budget),
                _running(-np.sort(-present, axis=0), budget),
                _running(np.sort(present, axis=0), budget, idle))


def _running(rows: NDArray[np.float64], budget: int, idle: int = 0) -> NDArray[np.float64]:
    """Return sums of the first 0, 1, ... budget rows, behind so many of zeros."""
    idle = min(idle, budget)
    sums = np.zeros((budget + 1, rows.shape[1]))
    some = np.cumsum(rows[:budget - idle], axis=0)
    sums[idle + 1:idle + 1 + len(some)] = some
    if len(some):
        sums[idle + 1 + len(some):] = some[-1]
    return sums


class NeighbourhoodBound:
    """
    ``NeighbourhoodScore``: each match by what flips at its node can do, flips shared out best.

    With a = x0(u), a unit vector, and m the weighted mean of the neighbours' x0, |m| <= 1, the
    feature is z / |z| with z = a + m / 2; it is compared with the unit vector y, at the angle t
    from a. Let e be the unit vector across a in the plane of a and y.

    *Largest.* z lies over the plane at the angle f from a, tan f = (m.e / 2) / (1 + m.a / 2), and
    cos(z, y) <= cos(t - f) wherever that is positive: what z has beyond the plane only makes it
    longer. m.e and m.a are means over the neighbours v by weights w, so
    tan f = sum w (v.e) / sum w (2 + v.a), a ratio of two sums over neighbours with terms of the
    lower one above 0. Its largest value over sets that k flips lead to is found exactly
    (``bound_kernels.largest_ratio``); it is at most 1 / sqrt(3) since |m| <= 1; and
    cos(t - f) grows with f up to f = t.

    *Least.* z.z = 1 + m.a + m.m / 4 <= 5/4 + m.a, whose root is concave in m.a: it is at most
    s + (m.a - c) / (2 s), s = sqrt(5/4 + c), for any c. So cos(z, y), where it is not negative,
    is at least sum w (a.y + v.y / 2) / sum w (s + (v.a - c) / (2 s)): again a ratio, whose least
    value is found exactly. Where it is negative the match adds nothing, and the ratio is negative.

    A flip has two ends: b of them are at most 2 b flips at nodes, at most b at each. How they are
    best shared out among nodes is found by dynamic programming, over a few numbers of flips at a
    node; in between the next larger number's bound holds.
    """

    LEVELS = (1, 2, 3, 5, 8, 14)

    def __init__(self, query: View, nodes: Comparison, average: NDArray[np.float64]) -> None:
        self._query, self._nodes = query, nodes
        self._share = share(average, query.features, nodes.features)[:, nodes.match_owner]

    def after(self, budget: int) -> Range:
        """Return the least and the largest score after up to 0, 1, ... budget flips."""
        levels = np.array([*(level for level in self.LEVELS if level < budget), max(budget, 1)])
        now, lowest, highest = self._matches(levels)
        base = self._share @ now
        gain, loss = (shared_out(np.maximum(change, 0), self._share, self._nodes.match_query,
                                 levels, 2 * budget)[::2]
                      for change in (highest - now[:, None], now[:, None] - lowest))
        return np.maximum(base - loss, 0), base + gain

    def _matches(self, levels: NDArray[np.int64]) -> tuple[NDArray[np.float64], ...]:
        """Return what every match adds now, at least and at most, (k,), (k, l) and (k, l)."""
        query, nodes = self._query, self._nodes
        now = np.zeros(len(nodes.match_query))
        everything = np.arange(query.graph.node_count)
        kernels.write_match_scores(everything, query.iterated(everything), nodes.match_start,
                                   nodes.match_x1, now)
        x0 = query.x0 / np.sqrt(query.x0.shape[1])
        other = nodes.match_x1.astype(np.float64)
        norm = np.linalg.norm(other, axis=1)
        product = x0 @ (other / np.maximum(norm, _SINGLE)[:, None]).T
        present, omega = pair_weights(query.graph)
        least, largest = bound_kernels.cosine_bounds(
            nodes.match_query, x0 @ x0.T, product, omega, present, levels)
        return (now, np.sqrt(np.maximum(least * norm[:, None] - MIN_COSINE - _SINGLE, 0)),
                np.sqrt(np.maximum(largest * norm[:, None] - MIN_COSINE + _SINGLE, 0)))


class ObjectBound:
    """
    ``ObjectScore``: each object by how far all flips can turn it.

    An object's x0 is 0, so its feature is X / |X|, with X the weighted sum of the x0 of the
    features on it. A flip changes X of at most one object, by its weight at most: objects are
    not neighbours that add to a sum. k flips change X by D at most, the sum of the k largest
    weights, and its direction by asin(D / |X|) at most, by any angle if D >= |X|. With cosines
    at their largest, negative ones as 0, the best assignment is worth at least what any is now;
    with cosines at their least it is worth at most what the best is then, whose negative ones
    do not count.
    """

    def __init__(self, query: View, nodes: Comparison, average: NDArray[np.float64]) -> None:
        self._query, self._nodes, self._average = query, nodes, average

    def after(self, budget: int) -> Range:
        """Return the least and the largest score after up to 0, 1, ... budget flips."""
        query, nodes = self._query, self._nodes
        cosine = object_cosines(query, nodes)
        shape = budget + 1, len(nodes)
        least, largest = np.zeros(shape), np.zeros(shape)
        if not cosine.size:
            return least @ self._average.T, largest @ self._average.T
        angle = np.arccos(np.clip(cosine, -1, 1))
        for flips, turn in enumerate(self._turns(budget)):
            near = np.cos(np.maximum(angle - turn[:, None], 0)) + _SINGLE
            far = np.cos(np.minimum(angle + turn[:, None], np.pi)) - _SINGLE
            for place in range(len(nodes)):
                of = nodes.objects_of(place)
                same = nodes.same_class[:, of]
                largest[flips, place] = _assigned(np.where(same, np.maximum(near[:, of], 0), 0))
                least[flips, place] = max(_assigned(np.where(same, far[:, of], 0)), 0)
        norm = query.objects, nodes.objects
        return share(least, *norm) @ self._average.T, share(largest, *norm) @ self._average.T

    def _turns(self, budget: int) -> NDArray[np.float64]:
        """Return by which angle 0, 1, ... budget flips can turn each object, (b + 1, objects)."""
        query = self._query
        present, omega = pair_weights(query.graph)
        here = np.where(present, omega, 0)[:query.objects, query.objects:]
        x0 = query.x0[query.objects:] / np.sqrt(query.x0.shape[1])
        length = np.linalg.norm(here @ x0, axis=1)
        strongest = -np.sort(-omega[:query.objects, query.objects:], axis=1)
        change = _running(strongest.T, budget)
        turned = change >= length * (1 - _SINGLE)
        return np.where((change > 0) & turned, np.pi,
                        np.arcsin(np.minimum(change / np.maximum(length, _SINGLE), 1)))


def _assigned(cosine: NDArray[np.float64]) -> float:
    return float(cosine[linear_sum_assignment(cosine, maximize=True)].sum())


def pair_weights(graph: MultiTierGraph) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Return which pairs are edges, and the weight that each has or would have, (n, n) each."""
    count = graph.node_count
    every = np.indices((count, count)).reshape(2, -1).T
    length = graph.length_between(every).astype(np.float64).reshape(count, count)
    present = np.zeros((count, count), bool)
    for source, target in (graph.edge.T, graph.edge.T[::-1]):
        present[source, target] = True
        length[source, target] = graph.edge_length
    return present, np.exp(-length / LENGTH_SCALE)
