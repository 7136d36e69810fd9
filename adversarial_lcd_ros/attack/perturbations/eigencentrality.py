# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Flips between the most central nodes: the paper's own choice (Sec. 3.3, Eq. 2-3).

Ties have a rule: nine decimals, then smaller node numbers. Cliques of objects with leaves have few
distinct centralities, and rounding would choose. Plain power iteration fades on the smaller
component of a disconnected graph, at a rate of its own: below 100 nodes an eigensolver is used,
above a compiled Lanczos iteration with a measured residual and a start without symmetry, then
ARPACK where that does not converge.
"""

from __future__ import annotations

from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import eigsh

from adversarial_lcd_ros.attack.perturbations.base import Allowed, Perturbation
from adversarial_lcd_ros.attack.perturbations.lanczos import leading
from adversarial_lcd_ros.graph import MultiTierGraph

DENSE_BELOW = 100
TIE = 1e-9
TIE_DECIMALS = 9
TOLERANCE = 1e-12
START_SHARE = 1e-3
RESTARTS = 20


@lru_cache(16)
def _start(count: int) -> NDArray[np.float64]:
    # Without symmetry: a start that lacks a part of the eigenvector would never find it.
    start: NDArray[np.float64] = np.random.default_rng(0).uniform(0.5, 1.5, count) / count ** 0.5
    return start


def eigencentrality(graph: MultiTierGraph, near: NDArray[np.float64] | None = None
                    ) -> NDArray[np.float64]:
    """
    Return the eigenvector x of the largest eigenvalue of A, at least 0, unit length, (n,).

    Of a disconnected graph it is that of the component with the largest eigenvalue, 0 elsewhere;
    components that tie for the largest share it. Without edges all nodes are alike.

    Parameters
    ----------
    graph : MultiTierGraph
    near : float64, (n,), optional
        That of a graph which differs in few edges: a better start, the same result to ten
        decimals.

    """
    count = graph.node_count
    if not graph.edge_count:
        return np.full(count, 1 / np.sqrt(max(count, 1)))
    if count < DENSE_BELOW:
        values, vectors = np.linalg.eigh(graph.adjacency.toarray())
        # Any vector of a repeated eigenvalue would do; the projection of 1 treats nodes alike.
        space = vectors[:, values > values[-1] - TIE]
        shared = np.abs(space @ space.sum(axis=0))
        x: NDArray[np.float64] = shared / np.linalg.norm(shared)
        return x
    # Something of an arbitrary start is added to what is near: another component may lead now.
    start = _start(count) if near is None else near + START_SHARE * _start(count)
    for _ in range(RESTARTS):
        start, residual = leading(graph.edge, start, TOLERANCE)
        if residual <= 10 * TOLERANCE:
            x = np.abs(start)
            return x
    # Two leading eigenvalues so close that the iteration needs restarts that know of both.
    _, vectors = eigsh(graph.adjacency, k=1, which='LA', v0=start, tol=1e-10)
    found: NDArray[np.float64] = np.abs(vectors[:, 0])
    return found


class Eigencentrality(Perturbation):
    """
    The pairs with the largest x_u x_v, recomputed on the graph at hand.

    Centralities that agree to nine decimals tie; ties go to the smaller node indices.
    """

    name: ClassVar[str] = 'eigencentrality'
    rank: ClassVar[int] = 7
    colour: ClassVar[str] = '#2f5d8a'
    marker: ClassVar[str] = 's'

    def propose(self, graph: MultiTierGraph, count: int, allowed: Allowed,
                rng: np.random.Generator) -> NDArray[np.int64]:
        """Return the pairs by falling product of centralities."""
        # From scratch: a better start would save little, and let earlier graphs into the rounding.
        x = np.round(eigencentrality(graph), TIE_DECIMALS)
        rank = np.argsort(-x, kind='stable')
        every = graph.node_count * (graph.node_count - 1) // 2
        wanted = min(count + len(allowed.tried), every)
        while wanted:
            ranks = _leading_pairs(graph.node_count, wanted)
            pairs = np.sort(rank[ranks], axis=1)
            product = np.round(x[pairs[:, 0]] * x[pairs[:, 1]], TIE_DECIMALS)
            order = np.lexsort((pairs[:, 1], pairs[:, 0], -product))[:wanted]
            found = allowed.filter(graph, pairs[order])
            if len(found) >= count or wanted == every:
                return found[:count]
            wanted = min(4 * wanted, every)
        return np.zeros((0, 2), np.int64)


def _leading_pairs(nodes: int, wanted: int) -> NDArray[np.int64]:
    """
    Return all pairs of ranks, shape (k, 2), that can be among the ``wanted`` largest products.

    No pair (i, j), i < j, beats the (i + 1) j - i (i + 1) / 2 pairs whose ranks are both at most
    its own, itself included.
    """
    first = np.arange(nodes - 1)
    last = np.minimum((wanted + first * (first + 1) // 2) // (first + 1), nodes - 1)
    length = np.maximum(last - first, 0)
    i = np.repeat(first, length)
    start = np.repeat(np.cumsum(length) - length, length)
    return np.stack([i, i + 1 + np.arange(len(i)) - start], axis=1)
