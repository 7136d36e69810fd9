# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The arithmetic of a comparison, compiled.

A node's features, a match's weight and a cosine are each computed by one function here, whether
a graph is looked at whole or after a few flips: what is kept of one graph equals, bit for bit,
what would be recomputed for another with the same edges around a node.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.hamming import compiled
from adversarial_lcd_ros.compiled.incidence import vectorised

MIN_COSINE = 0.4
NEIGHBOUR_WEIGHT = 0.5
_TINY = 1e-12


@vectorised
def iterated_rows(nodes: NDArray[np.int64], x0: NDArray[np.int8], start: NDArray[np.int64],
                  neighbour: NDArray[np.int64], weight: NDArray[np.float64]
                  ) -> NDArray[np.float64]:
    """
    Return features of some nodes after one continuous WL iteration, unit rows, (k, bits).

    x1(v) = normalise(x0(v) + 0.5 mean of x0 over the neighbours, by weight).

    Parameters
    ----------
    nodes : int64, (k,)
    x0 : int8, (n, bits)
        Descriptor bits as +-1; zeros for objects.
    start, neighbour, weight
        As ``incidence`` gives them.

    """
    rows = np.zeros((len(nodes), x0.shape[1]))
    for i in range(len(nodes)):
        v, row, total = nodes[i], rows[i], 0.0
        for k in range(start[v], start[v + 1]):
            total += weight[k]
            other, value = x0[neighbour[k]], weight[k]
            for j in range(len(row)):
                row[j] += value * other[j]
        scale = NEIGHBOUR_WEIGHT / max(total, _TINY)
        square = 0.0
        for j in range(len(row)):
            row[j] = x0[v, j] + scale * row[j]
            square += row[j] * row[j]
        norm = 1 / max(sqrt(square), _TINY)
        for j in range(len(row)):
            row[j] *= norm
    return rows


@vectorised
def dot(one: NDArray[np.float64], other: NDArray[np.float32]) -> float:
    """Return the scalar product of two rows, summed in the wider type."""
    total = 0.0
    for j in range(len(one)):
        total += one[j] * other[j]
    return total


@vectorised
def write_match_scores(nodes: NDArray[np.int64], rows: NDArray[np.float64],
                       start: NDArray[np.int64], match_x1: NDArray[np.float32],
                       score: NDArray[np.float64]) -> None:
    """
    Write sqrt(max(cosine - 0.4, 0)) of every match of some nodes.

    Parameters
    ----------
    nodes : int64, (k,)
    rows : float64, (k, bits)
        Their features.
    start : int64, (n + 1,)
        Where the matches of each node begin.
    match_x1 : float32, (matches, bits)
        Features of the nodes that they are matched with.
    score : float64, (matches,)
        Written to.

    """
    for i in range(len(nodes)):
        for k in range(start[nodes[i]], start[nodes[i] + 1]):
            score[k] = sqrt(max(dot(rows[i], match_x1[k]) - MIN_COSINE, 0.0))


@vectorised
def write_cosines(nodes: NDArray[np.int64], rows: NDArray[np.float64],
                  other_x1: NDArray[np.float32], comparable: NDArray[np.bool_],
                  cosine: NDArray[np.float64]) -> None:
    """
    Write the cosines of some nodes with others where they are comparable, else 0.

    Parameters
    ----------
    nodes : int64, (k,)
        Rows of ``comparable`` and ``cosine``.
    rows : float64, (k, bits)
        Their features.
    other_x1 : float32, (others, bits)
    comparable : bool, (n, others)
    cosine : float64, (n, others)
        Written to.

    """
    for i in range(len(nodes)):
        for k in range(len(other_x1)):
            found = comparable[nodes[i], k]
            cosine[nodes[i], k] = dot(rows[i], other_x1[k]) if found else 0.0


@compiled
def total_by_owner(owner: NDArray[np.int64], value: NDArray[np.float64], owners: int
                   ) -> NDArray[np.float64]:
    """Return the sum of the values of each owner, shape (owners,)."""
    total = np.zeros(owners)
    for i in range(len(owner)):
        total[owner[i]] += value[i]
    return total


@compiled
def total_of_common(key: NDArray[np.int64], earning_key: NDArray[np.int64],
                    earning: NDArray[np.float64], owner: NDArray[np.int64], owners: int
                    ) -> NDArray[np.float64]:
    """
    Return what each owner earns by keys that are present, shape (owners,).

    Parameters
    ----------
    key : int64, (m,)
        Those present, ascending.
    earning_key : int64, (c,)
        Ascending, repeats allowed.
    earning, owner : float64 and int64, (c,)
        What the presence of each key is worth, and to whom.
    owners : int

    """
    total = np.zeros(owners)
    place = 0
    for i in range(len(earning_key)):
        while place < len(key) and key[place] < earning_key[i]:
            place += 1
        if place == len(key):
            break
        if key[place] == earning_key[i]:
            total[owner[i]] += earning[i]
    return total


@compiled
def changed_nodes(key: NDArray[np.int64], length: NDArray[np.float32],
                  other_key: NDArray[np.int64], other_length: NDArray[np.float32],
                  nodes: int) -> NDArray[np.int64]:
    """
    Return the ends, ascending, of edges that only one of two graphs has, or at another length.

    Parameters
    ----------
    key, other_key : int64, (m,) and (m',)
        Edges as source * n + target, ascending.
    length, other_length : float32, (m,) and (m',)
    nodes : int
        n.

    """
    changed = np.zeros(nodes, np.bool_)
    i = j = 0
    while i < len(key) or j < len(other_key):
        if j == len(other_key) or (i < len(key) and key[i] < other_key[j]):
            different, edge = True, key[i]
            i += 1
        elif i == len(key) or other_key[j] < key[i]:
            different, edge = True, other_key[j]
            j += 1
        else:
            different, edge = length[i] != other_length[j], key[i]
            i += 1
            j += 1
        if different:
            changed[edge // nodes] = True
            changed[edge % nodes] = True
    return np.flatnonzero(changed)
