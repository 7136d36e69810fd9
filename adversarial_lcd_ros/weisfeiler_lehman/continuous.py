# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Continuous Weisfeiler-Lehman features of a graph (paper, Sec. 3.4, Eq. 4-6)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from adversarial_lcd_ros.compiled.incidence import LENGTH_SCALE, incidence
from adversarial_lcd_ros.graph import FEATURE_TIER, MultiTierGraph
from adversarial_lcd_ros.weisfeiler_lehman import flips
from adversarial_lcd_ros.weisfeiler_lehman.pooled_flips import ITERATIONS, pooled_changes

# Sums of squares of larger numbers may overflow float32.
_LARGE = 1e15
NODE_FEATURES = ('is_object', 'x', 'y', 'log_size', 'score', 'log_degree')


def node_features(graph: MultiTierGraph) -> NDArray[np.float64]:
    """
    Return the initial node features x_0(v), shape (n, 6), in the order of NODE_FEATURES.

    Each is scaled by a constant, or within its tier, and not by statistics of the batch at hand:
    rows computed at different times stay comparable. Perturbed graphs keep the features of the
    clean one, the degree included: what a flip changes is what the iterations aggregate.
    """
    is_feature = graph.tier == FEATURE_TIER
    score = np.zeros(graph.node_count)
    for tier in (is_feature, ~is_feature):
        if tier.any():
            values = graph.score[tier]
            if np.abs(values).max() > _LARGE:
                values = values.astype(np.float64)
            score[tier] = (values - values.mean()) / (values.std() or 1.0)
    degree = np.bincount(graph.edge.ravel(), minlength=graph.node_count)
    size = graph.size.max(axis=1) / graph.diagonal
    return np.stack([~is_feature,
                     4 * (graph.position[:, 0] / graph.width - 0.5),
                     4 * (graph.position[:, 1] / graph.height - 0.5),
                     np.log(np.maximum(size, 1e-3)) + 3,
                     score,
                     np.log1p(degree) - 2], axis=1).astype(np.float64)


def iterate(x: NDArray[np.float64], adjacency: sparse.csr_array,
            iterations: int) -> list[NDArray[np.float64]]:
    """
    Return x_1 .. x_H with x_h(v) = (x_{h-1}(v) + weighted mean over neighbours) / 2.

    Parameters
    ----------
    x : float64, (n, d)
        x_0.
    adjacency : (n, n)
        Symmetric, weights at least 0. A node without neighbours keeps its features.
    iterations : int
        H.

    """
    total = adjacency.sum(axis=1)
    lonely = total <= 0
    scale = np.where(lonely, 0.0, 1 / np.where(lonely, 1.0, total))[:, None]
    levels = []
    for _ in range(iterations):
        mean = np.where(lonely[:, None], x, scale * (adjacency @ x))
        x = (x + mean) / 2
        levels.append(x)
    return levels


def pooled_features(graph: MultiTierGraph, x: NDArray[np.float64],
                    iterations: int) -> NDArray[np.float64]:
    """
    Return phi(G) with each level reduced to its mean and deviation, shape (2 d H,).

    The paper concatenates node by node (Eq. 5), which ties phi to one frame's nodes; this one
    does not depend on their order and carries over between frames.
    """
    levels = iterate(x, graph.weighted_adjacency(LENGTH_SCALE), iterations)
    return np.concatenate([np.r_[level.mean(axis=0), level.std(axis=0)] for level in levels])


def concatenated_features(graph: MultiTierGraph, x: NDArray[np.float64],
                          iterations: int) -> NDArray[np.float64]:
    """Return phi(G) of Eq. (5) and (6), the node features of every level, shape (n d H,)."""
    levels = iterate(x, graph.weighted_adjacency(LENGTH_SCALE), iterations)
    return np.concatenate([level.ravel() for level in levels])


def flip_features(graph: MultiTierGraph, x: NDArray[np.float64], pairs: NDArray[np.int64],
                  iterations: int, *, pooled: bool = True) -> NDArray[np.float64]:
    """
    Return how each single flip changes phi, shape (k, 2 d H) pooled, else (k, n d H).

    Differences carry over between frames, where phi(G') itself mostly tells the frame. Only the
    nodes within H hops of a flip are looked at.

    Parameters
    ----------
    graph : MultiTierGraph
    x : float64, (n, d)
        Initial node features.
    pairs : int, (k, 2)
    iterations : int
        H.
    pooled : bool
        Mean and deviation of each level, times n; else node by node as in Eq. (5).

    """
    levels = np.stack([x, *iterate(x, graph.weighted_adjacency(LENGTH_SCALE), iterations)])
    ends = np.ascontiguousarray(pairs, np.int64).reshape(-1, 2)
    gained = np.exp(-graph.length_between(ends).astype(np.float64) / LENGTH_SCALE)
    around = incidence(graph.edge, graph.edge_length, graph.node_count)
    change: NDArray[np.float64] = (
        pooled_changes(ends, gained, levels, *around) if pooled and iterations == ITERATIONS else
        flips.changes(ends, graph.has_edges(ends), gained, levels, *around, pooled))
    return graph.node_count * change if pooled else change
