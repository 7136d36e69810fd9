# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The Weisfeiler-Lehman subtree kernel on integer labels, and all its values after single flips.

A label is a 64-bit hash of the label before and of the sum of its neighbours' hashes, in place
of a dictionary of multisets: a flip is then a difference of sums, passed on along edges to the
nodes within h hops. Two different neighbourhoods collide with a chance of about 2^-64.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.hamming import compiled
from adversarial_lcd_ros.compiled.incidence import incidence
from adversarial_lcd_ros.graph import MultiTierGraph

_FREE = np.uint64(0)


@dataclass(frozen=True)
class Histogram:
    """
    How often each label occurs, over all iterations.

    Attributes
    ----------
    label : uint64, (k,)
        Ascending.
    count : int64, (k,)

    """

    label: NDArray[np.uint64]
    count: NDArray[np.int64]

    def kernel(self, other: Histogram) -> int:
        """Return the subtree kernel of two graphs: common labels, counted by their products."""
        _, mine, theirs = np.intersect1d(self.label, other.label, assume_unique=True,
                                         return_indices=True)
        return int(self.count[mine] @ other.count[theirs])


def histogram(graph: MultiTierGraph, label: NDArray[np.uint32], iterations: int) -> Histogram:
    """
    Return the labels of iterations 0 to H of a graph.

    Parameters
    ----------
    graph : MultiTierGraph
    label : uint32, (n,)
        Initial labels; the graph's own are ``graph.label``.
    iterations : int
        H.

    """
    levels, _ = _levels(label, iterations, *_neighbours(graph))
    found, count = np.unique(levels, return_counts=True)
    return Histogram(found, count.astype(np.int64))


def flip_kernels(graph: MultiTierGraph, label: NDArray[np.uint32], pairs: NDArray[np.int64],
                 iterations: int, reference: Histogram) -> NDArray[np.int64]:
    """
    Return the subtree kernel of a graph with a reference after each single flip, shape (k,).

    Parameters
    ----------
    graph : MultiTierGraph
    label : uint32, (n,)
        Initial labels.
    pairs : int, (k, 2)
    iterations : int
        H, as for the reference.
    reference : Histogram

    """
    ends = np.ascontiguousarray(pairs, np.int64).reshape(-1, 2)
    start, neighbour = _neighbours(graph)
    levels, sums = _levels(label, iterations, start, neighbour)
    found: NDArray[np.int64] = _flipped(ends, graph.has_edges(ends), levels, sums, start,
                                        neighbour, *_table(reference.label, reference.count))
    return found


def _neighbours(graph: MultiTierGraph) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    start, neighbour, _ = incidence(graph.edge, graph.edge_length, graph.node_count)
    return start, neighbour


@compiled
def _mixed(value: np.uint64) -> np.uint64:
    """Return a well mixed uint64 (the finaliser of splitmix64)."""
    mixed = value + np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return mixed ^ (mixed >> np.uint64(31))


@compiled
def _relabelled(label: np.uint64, total: np.uint64) -> np.uint64:
    mixed: np.uint64 = _mixed(_mixed(label) ^ (np.uint64(3) * total + np.uint64(1)))
    return mixed


@compiled
def _levels(label: NDArray[np.uint32], iterations: int, start: NDArray[np.int64],
            neighbour: NDArray[np.int64]) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """Return the labels of every iteration, and the sums over neighbours they were made of."""
    nodes = len(label)
    levels = np.zeros((iterations + 1, nodes), np.uint64)
    sums = np.zeros((iterations + 1, nodes), np.uint64)
    for node in range(nodes):
        levels[0, node] = _mixed(np.uint64(label[node]))
    for h in range(1, iterations + 1):
        for node in range(nodes):
            for k in range(start[node], start[node + 1]):
                sums[h, node] += _mixed(levels[h - 1, neighbour[k]])
            levels[h, node] = _relabelled(levels[h - 1, node], sums[h, node])
    return levels, sums


@compiled
def _table(label: NDArray[np.uint64], count: NDArray[np.int64]
           ) -> tuple[NDArray[np.uint64], NDArray[np.int64]]:
    """Return an open hash table: labels, 0 where free, and counts; twice as large as needed."""
    size = 16
    while size < 2 * len(label):
        size *= 2
    keys, values = np.zeros(size, np.uint64), np.zeros(size, np.int64)
    for i in range(len(label)):
        place = _place(keys, label[i])
        keys[place], values[place] = label[i], count[i]
    return keys, values


@compiled
def _place(keys: NDArray[np.uint64], label: np.uint64) -> np.int64:
    place = np.int64(label & np.uint64(len(keys) - 1))
    while keys[place] != _FREE and keys[place] != label:
        place = np.int64((place + 1) & (len(keys) - 1))
    return place


@compiled
def _flipped(pairs: NDArray[np.int64], present: NDArray[np.bool_], levels: NDArray[np.uint64],
             sums: NDArray[np.uint64], start: NDArray[np.int64], neighbour: NDArray[np.int64],
             keys: NDArray[np.uint64], values: NDArray[np.int64]) -> NDArray[np.int64]:
    depth, nodes = levels.shape
    worth = np.zeros((depth, nodes), np.int64)
    for h in range(depth):
        for node in range(nodes):
            worth[h, node] = values[_place(keys, levels[h, node])]
    out = np.full(len(pairs), worth.sum())
    label = levels.copy()
    step = np.zeros((depth, nodes), np.uint64)
    ball, size = np.empty((depth, nodes + 2), np.int64), np.zeros(depth, np.int64)
    mark = np.full(nodes, -1)
    for p in range(len(pairs)):
        for h in range(1, depth):
            size[h] = _collect(pairs[p], present[p], levels[h - 1], label[h - 1],
                               ball[h - 1, :size[h - 1]], start, neighbour, step[h], ball[h],
                               mark, p * depth + h)
            changed = 0
            for i in range(size[h]):
                node = ball[h, i]
                new = _relabelled(label[h - 1, node], sums[h, node] + step[h, node])
                step[h, node] = 0
                if new != levels[h, node]:
                    out[p] += values[_place(keys, new)] - worth[h, node]
                    label[h, node] = new
                    ball[h, changed] = node
                    changed += 1
            size[h] = changed
        for h in range(1, depth):
            for i in range(size[h]):
                label[h, ball[h, i]] = levels[h, ball[h, i]]
    return out


@compiled
def _collect(pair: NDArray[np.int64], present: bool, before: NDArray[np.uint64],
             label: NDArray[np.uint64], changed: NDArray[np.int64], start: NDArray[np.int64],
             neighbour: NDArray[np.int64], step: NDArray[np.uint64], ball: NDArray[np.int64],
             mark: NDArray[np.int64], stamp: int) -> int:
    """Write how the neighbour sums of an iteration change, and where; return for how many."""
    count = 0
    for side in range(2):
        node, other = pair[side], pair[1 - side]
        mark[node], ball[count] = stamp, node
        count += 1
        # The old label: how it changed is passed on below, if the edge stays.
        step[node] += (np.uint64(0) - _mixed(before[other])) if present else _mixed(label[other])
    for i in range(len(changed)):
        node = changed[i]
        if mark[node] != stamp:
            mark[node], ball[count] = stamp, node
            count += 1
        difference = _mixed(label[node]) - _mixed(before[node])
        for k in range(start[node], start[node + 1]):
            near = neighbour[k]
            if present and ((node == pair[0] and near == pair[1])
                            or (node == pair[1] and near == pair[0])):
                continue
            if mark[near] != stamp:
                mark[near], ball[count] = stamp, near
                count += 1
            step[near] += difference
    return count
