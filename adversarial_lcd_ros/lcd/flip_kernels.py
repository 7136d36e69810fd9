# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Cosines of a node after each of many single flips, without its features, compiled.

A flip (u, v) adds one term to the neighbour sums of u and of v. With the products of all x0
among themselves and with the reference's features at hand, a cosine after an added edge takes a
few operations instead of one for each descriptor bit; after a deleted edge, of which there are
few, the row is recomputed: a difference of sums would lose digits.
"""

from __future__ import annotations

from math import exp, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.incidence import LENGTH_SCALE, Incidence, vectorised
from adversarial_lcd_ros.lcd.kernels import MIN_COSINE, NEIGHBOUR_WEIGHT, dot

_TINY = 1e-12


class Moments(NamedTuple):
    """
    A graph's neighbour sums, as far as single flips need them.

    Attributes
    ----------
    x0 : int8, (n, bits)
        Descriptor bits as +-1; zeros for objects.
    start, neighbour, weight
        As ``incidence`` gives them.
    product : float64, (n, n)
        x0(u) . x0(v).
    total : float64, (n,)
        Sum of the weights of each node's edges.
    near : float64, (n, n)
        Sum of weight(u, k) x0(k) . x0(v) over the neighbours k of u.
    square : float64, (n,)
        |sum of weight(u, k) x0(k)|^2.

    """

    x0: NDArray[np.int8]
    start: NDArray[np.int64]
    neighbour: NDArray[np.int64]
    weight: NDArray[np.float64]
    product: NDArray[np.float64]
    total: NDArray[np.float64]
    near: NDArray[np.float64]
    square: NDArray[np.float64]


def moments(x0: NDArray[np.int8], incidence: Incidence, product: NDArray[np.float64]) -> Moments:
    """Return the neighbour sums of a graph."""
    total, near, square = _neighbour_sums(*incidence, product)
    return Moments(x0, *incidence, product, total, near, square)


@vectorised
def _neighbour_sums(start: NDArray[np.int64], neighbour: NDArray[np.int64],
                    weight: NDArray[np.float64], product: NDArray[np.float64]
                    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    nodes = len(product)
    total, near, square = np.zeros(nodes), np.zeros((nodes, nodes)), np.zeros(nodes)
    for u in range(nodes):
        for k in range(start[u], start[u + 1]):
            total[u] += weight[k]
            row, value = product[neighbour[k]], weight[k]
            for v in range(nodes):
                near[u, v] += value * row[v]
        for k in range(start[u], start[u + 1]):
            square[u] += weight[k] * near[u, neighbour[k]]
    return total, near, square


@vectorised
def near_products(nodes: NDArray[np.int64], first: NDArray[np.int64], last: NDArray[np.int64],
                  graph: Moments, product: NDArray[np.float64]) -> NDArray[np.float64]:
    """
    Return the weighted neighbour sums of products with reference nodes, shape (sum of columns,).

    Parameters
    ----------
    nodes : int64, (k,)
    first, last : int64, (k,)
        Columns of ``product`` that each node is compared with; results follow one another.
    graph : Moments
    product : float64, (n, columns)
        x0 . feature of a reference's node.

    """
    near = np.zeros((last - first).sum())
    place = 0
    for i in range(len(nodes)):
        width = last[i] - first[i]
        row = near[place:place + width]
        for k in range(graph.start[nodes[i]], graph.start[nodes[i] + 1]):
            other = product[graph.neighbour[k], first[i]:last[i]]
            value = graph.weight[k]
            for j in range(width):
                row[j] += value * other[j]
        place += width
    return near


@vectorised
def _add(graph: Moments, u: int, v: int, weight: float, product: NDArray[np.float64],
         first: int, near: NDArray[np.float64], cosine: NDArray[np.float64]) -> None:
    """Write the cosines of u with columns from ``first`` on, once joined with v."""
    scale = NEIGHBOUR_WEIGHT / max(graph.total[u] + weight, _TINY)
    across = graph.near[u, u] + weight * graph.product[u, v]
    around = (graph.square[u] + 2 * weight * graph.near[u, v]
              + weight * weight * graph.product[v, v])
    square = graph.product[u, u] + scale * (2 * across + scale * around)
    norm = 1 / max(sqrt(max(square, 0.0)), _TINY)
    for j in range(len(cosine)):
        mean = near[j] + weight * product[v, first + j]
        cosine[j] = (product[u, first + j] + scale * mean) * norm


@vectorised
def _delete(graph: Moments, u: int, v: int, feature: NDArray[np.float32], first: int,
            row: NDArray[np.float64], cosine: NDArray[np.float64]) -> None:
    """Write the cosines of u with columns from ``first`` on, once parted from v."""
    row[:] = 0
    total = 0.0
    for k in range(graph.start[u], graph.start[u + 1]):
        if graph.neighbour[k] != v:
            total += graph.weight[k]
            other, value = graph.x0[graph.neighbour[k]], graph.weight[k]
            for j in range(len(row)):
                row[j] += value * other[j]
    scale, square = NEIGHBOUR_WEIGHT / max(total, _TINY), 0.0
    for j in range(len(row)):
        row[j] = graph.x0[u, j] + scale * row[j]
        square += row[j] * row[j]
    norm = 1 / max(sqrt(square), _TINY)
    for j in range(len(cosine)):
        cosine[j] = dot(row, feature[first + j]) * norm


@vectorised
def match_changes(pairs: NDArray[np.int64], present: NDArray[np.bool_],
                  length: NDArray[np.float32], graph: Moments, start: NDArray[np.int64],
                  feature: NDArray[np.float32], product: NDArray[np.float64],
                  near: NDArray[np.float64], score: NDArray[np.float64],
                  share: NDArray[np.float64]) -> NDArray[np.float64]:
    """
    Return how each single flip changes sums over matches, shape (k, sums).

    Parameters
    ----------
    pairs : int64, (k, 2)
    present : bool, (k,)
        Which are edges.
    length : float32, (k,)
        Of each as an edge.
    graph : Moments
    start : int64, (n + 1,)
        Where the matches of each node begin.
    feature : float32, (matches, bits)
        Of the nodes that they are matched with.
    product : float64, (n, matches)
        x0 . feature.
    near : float64, (matches,)
        As ``near_products`` gives them for every node and its matches.
    score : float64, (matches,)
        What each adds now.
    share : float64, (matches, sums)
        How much of it counts for each sum.

    """
    change = np.zeros((len(pairs), share.shape[1]))
    row = np.empty(graph.x0.shape[1])
    cosine = np.empty(max(1, (start[1:] - start[:-1]).max()))
    for p in range(len(pairs)):
        weight = 0.0 if present[p] else exp(-np.float64(length[p]) / LENGTH_SCALE)
        for side in range(2):
            u, v = pairs[p, side], pairs[p, 1 - side]
            first, last = start[u], start[u + 1]
            found = cosine[:last - first]
            if first == last:
                continue
            if present[p]:
                _delete(graph, u, v, feature, first, row, found)
            else:
                _add(graph, u, v, weight, product, first, near[first:last], found)
            for j in range(last - first):
                more = sqrt(max(found[j] - MIN_COSINE, 0.0)) - score[first + j]
                for s in range(share.shape[1]):
                    change[p, s] += more * share[first + j, s]
    return change


@vectorised
def object_rows(objects: NDArray[np.int64], features: NDArray[np.int64],
                present: NDArray[np.bool_], length: NDArray[np.float32], graph: Moments,
                feature: NDArray[np.float32], product: NDArray[np.float64],
                near: NDArray[np.float64], comparable: NDArray[np.bool_]
                ) -> NDArray[np.float64]:
    """
    Return an object's cosines with all objects of references after each flip, (k, others).

    Parameters
    ----------
    objects, features : int64, (k,)
        Ends of the flips.
    present, length, graph
        As for ``match_changes``.
    feature : float32, (others, bits)
    product : float64, (n, others)
        x0 . feature.
    near : float64, (objects, others)
        As ``near_products`` gives them.
    comparable : bool, (objects, others)
        Elsewhere a cosine is 0.

    """
    cosine = np.zeros((len(objects), len(feature)))
    row = np.empty(graph.x0.shape[1])
    for p in range(len(objects)):
        u, v = objects[p], features[p]
        if present[p]:
            _delete(graph, u, v, feature, 0, row, cosine[p])
        else:
            weight = exp(-np.float64(length[p]) / LENGTH_SCALE)
            _add(graph, u, v, weight, product, 0, near[u], cosine[p])
        for j in range(len(feature)):
            if not comparable[u, j]:
                cosine[p, j] = 0.0
    return cosine
