# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Which nodes of a multi-tier graph are joined (paper, Fig. 2 c).

The builder makes edges by this rule, and whoever is given a graph can make them again from its
nodes. Both take the numbers that a payload carries, as they are carried, so both come to the same
edges; where several features are equally far, on the same release of SciPy.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree


def joined_pairs(position: NDArray[np.float32], size: NDArray[np.float32], objects: int,
                 neighbours: int, has_scene: bool = False) -> NDArray[np.uint32]:
    """
    Return the edges of some nodes, sorted, source < target, shape (m, 2).

    Every two objects; a feature and every box that holds it, or else the nearest object; a
    feature and its nearest features. With the whole scene as the last object (the graph variant
    "anchors"): every two objects; a feature and every other box that holds it, or else the scene.

    Parameters
    ----------
    position : float32, (n, 2)
        Centres, pixels; objects first.
    size : float32, (n, 2)
        Width and height of the boxes of objects, pixels; of features it is not looked at.
    objects : int
    neighbours : int
        Nearest features that each feature is joined with; none with a scene.
    has_scene : bool
        Whether the last object is the scene.

    """
    features = position[objects:]
    pairs = np.concatenate([
        np.stack(np.triu_indices(objects, 1), axis=1),
        _spokes(features, position[:objects], size[:objects], has_scene),
        _neighbour_edges(features, 0 if has_scene else neighbours) + objects])
    # As one number each, which sorts several times faster than rows do.
    key = np.unique(pairs[:, 0] * len(position) + pairs[:, 1])
    return np.stack(np.divmod(key, max(len(position), 1)), axis=1).astype(np.uint32)


def _spokes(feature: NDArray[np.float32], centre: NDArray[np.float32],
            size: NDArray[np.float32], has_scene: bool) -> NDArray[np.int64]:
    """Return the edges (object, feature), shape (e, 2)."""
    if not len(centre) or not len(feature):
        return np.zeros((0, 2), np.int64)
    inside = np.all(np.abs(feature[:, None] - centre[None]) <= size[None] / 2, axis=2)
    if has_scene:
        inside[:, -1] = ~inside[:, :-1].any(axis=1)
    else:
        lost = ~inside.any(axis=1)
        distance = np.linalg.norm(feature[lost, None] - centre[None], axis=2)
        inside[lost, distance.argmin(axis=1)] = True
    row, owner = np.nonzero(inside)
    return np.stack([owner, row + len(centre)], axis=1)


def _neighbour_edges(position: NDArray[np.float32], neighbours: int) -> NDArray[np.int64]:
    """Return the edges of each feature with its k nearest, source < target, with repeats."""
    count = len(position)
    nearest = min(neighbours + 1, count)
    if nearest < 2:
        return np.zeros((0, 2), np.int64)
    _, near = cKDTree(position).query(position, nearest)
    # Features of several octaves share a place: a feature need not be its own first neighbour,
    # and where more than k others do, none of its own neighbours; then one of those goes.
    own = near == np.arange(count)[:, None]
    own[~own.any(axis=1), -1] = True
    pairs = np.stack([np.repeat(np.arange(count), nearest - 1), near[~own]], axis=1)
    return np.sort(pairs, axis=1).astype(np.int64)
