# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scores of the target wl after every single flip of a graph, at once; see flips.py."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from adversarial_lcd_ros.lcd import flip_kernels, kernels
from adversarial_lcd_ros.lcd.single_flips import Flips
from adversarial_lcd_ros.lcd.targets.scores import assign_objects, object_cosines, share
from adversarial_lcd_ros.lcd.views import Comparison, View

_ROUNDING = 1e-13


class EdgeFlips:
    """``edge_score``: a flip changes the number of edges, and perhaps earns a credit."""

    def __init__(self, base: View, nodes: Comparison, average: NDArray[np.float64]) -> None:
        self._nodes, self._average = nodes, average
        self._key, self._first = np.unique(nodes.credit[0], return_index=True)

    def after(self, flips: Flips) -> NDArray[np.float64]:
        """Return the score after each single flip, shape (k, candidates)."""
        compared, average = self._nodes, self._average
        key, weight, owner = compared.credit
        graph = flips.view.graph
        now = kernels.total_of_common(graph.edge_key, key, weight, owner, len(compared))
        flipped = flips.pairs[:, 0] * graph.node_count + flips.pairs[:, 1]
        place = np.searchsorted(self._key, flipped)
        place[place == len(self._key)] = 0
        earns = self._key[place] == flipped if len(self._key) else np.zeros(len(place), bool)
        scores = np.empty((len(flipped), len(average)))
        for step, rows in ((1, ~flips.present), (-1, flips.present)):
            norm = np.maximum((graph.edge_count + step + compared.edges) / 2, 1)
            scores[rows] = average @ (now / norm)
            if len(self._key):
                credit = np.add.reduceat((average / norm)[:, owner].T * weight[:, None],
                                         self._first)
                scores[rows & earns] += step * credit[place[rows & earns]]
        return _settled(scores, average @ now)


class NeighbourhoodFlips:
    """``NeighbourhoodScore``: a flip changes what matches of its two ends add."""

    def __init__(self, base: View, nodes: Comparison, average: NDArray[np.float64]) -> None:
        self._feature, self._start = nodes.match_x1, nodes.match_start
        self._product = base.x0.astype(np.float64) @ self._feature.T.astype(np.float64)
        self._share = share(average, base.features, nodes.features)[:, nodes.match_owner].T.copy()
        self._change = np.zeros((0, len(average)))

    def after(self, flips: Flips) -> NDArray[np.float64]:
        """Return the score after each single flip, shape (k, candidates)."""
        everything = np.arange(flips.view.graph.node_count)
        score = np.zeros(len(self._feature))
        kernels.write_match_scores(everything, flips.view.iterated(everything), self._start,
                                   self._feature, score)
        near = flip_kernels.near_products(everything, self._start[:-1], self._start[1:],
                                          flips.moments, self._product)
        if flips.changed is None:
            stale = np.arange(len(flips.pairs))
            self._change = np.zeros((len(flips.pairs), self._share.shape[1]))
        else:  # what a flip changes hangs on the edges of its ends alone
            touched = np.isin(everything, flips.changed)
            stale = np.flatnonzero(touched[flips.pairs[:, 0]] | touched[flips.pairs[:, 1]])
        self._change[stale] = flip_kernels.match_changes(
            flips.pairs[stale], flips.present[stale], flips.length[stale], flips.moments,
            self._start, self._feature, self._product, near, score, self._share)
        base = score @ self._share
        return _settled(base + self._change, base)


def _settled(total: NDArray[np.float64], base: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return sums with 0 where all terms of the base were taken away, not what rounding left."""
    return np.where(total > _ROUNDING * base, total, 0)


class ObjectFlips:
    """``ObjectScore``: only flips between an object and a feature change an object's row."""

    def __init__(self, base: View, nodes: Comparison, average: NDArray[np.float64]) -> None:
        self._nodes, self._average = nodes, average
        self._feature = nodes.object_x1
        self._scores = np.zeros((0, len(average)))
        self._product = base.x0.astype(np.float64) @ self._feature.T.astype(np.float64)

    def after(self, flips: Flips) -> NDArray[np.float64]:
        """Return the score after each single flip, shape (k, candidates)."""
        if flips.changed is None or (flips.changed < flips.view.objects).any():
            self._scores = self._all(flips)
        return self._scores

    def _all(self, flips: Flips) -> NDArray[np.float64]:
        nodes, view = self._nodes, flips.view
        cosine = object_cosines(view, nodes)
        total = np.array([assign_objects(cosine[:, nodes.objects_of(place)])[2].sum()
                          for place in range(len(nodes))])
        scores = np.tile(share(total, view.objects, nodes.objects), (len(flips.pairs), 1))
        touching = np.flatnonzero((flips.pairs[:, 0] < view.objects)
                                  & (flips.pairs[:, 1] >= view.objects))
        flipped = self._cosines(flips, touching)
        for node in np.unique(flips.pairs[touching, 0]):
            mine = flips.pairs[touching, 0] == node
            for place in range(len(nodes)):
                columns = nodes.objects_of(place)
                if nodes.same_class[node, columns].any():
                    best = _reassigned(cosine[:, columns], node, flipped[mine, columns])
                    norm = np.sqrt(view.objects * float(nodes.objects[place]))
                    scores[touching[mine], place] = best / norm
        return scores @ self._average.T

    def _cosines(self, flips: Flips, touching: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the cosines of the touched object after each flip, (k, objects)."""
        objects = np.arange(flips.view.objects)
        first = np.zeros(len(objects), np.int64)
        near = flip_kernels.near_products(objects, first, first + len(self._feature),
                                          flips.moments, self._product)
        cosine: NDArray[np.float64] = flip_kernels.object_rows(
            flips.pairs[touching, 0], flips.pairs[touching, 1], flips.present[touching],
            flips.length[touching], flips.moments, self._feature, self._product,
            near.reshape(len(objects), len(self._feature)),
            self._nodes.same_class)
        return cosine


def _reassigned(cosine: NDArray[np.float64], node: int,
                rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """
    Return the summed cosine of the best assignment with one object's row replaced.

    Whatever that object is assigned to, the others are assigned as without both.

    Parameters
    ----------
    cosine : float64, (objects, references)
    node : int
        The object.
    rows : float64, (k, references)
        In its place.

    """
    others = np.delete(cosine, node, axis=0)
    choices = [(rows[:, column], *_total(np.delete(others, column, axis=1)))
               for column in range(cosine.shape[1])]
    if len(cosine) > cosine.shape[1]:
        choices.append((np.zeros(len(rows)), *_total(others)))
    value = np.stack([own + rest for own, rest, _ in choices])
    # Assignments maximise the sum of all cosines; only those above 0 count.
    counted = np.stack([np.maximum(own, 0) + above for own, _, above in choices])
    best: NDArray[np.float64] = counted[value.argmax(axis=0), np.arange(len(rows))]
    return best


def _total(cosine: NDArray[np.float64]) -> tuple[float, float]:
    chosen = cosine[linear_sum_assignment(cosine, maximize=True)]
    return float(chosen.sum()), float(np.maximum(chosen, 0).sum())
