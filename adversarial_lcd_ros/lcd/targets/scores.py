# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Similarity scores from which the targets are put together.

Each compares one query with all references of a Comparison; shape (r,). Classes keep what flips
of a few edges leave as it was.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from adversarial_lcd_ros.lcd import kernels
from adversarial_lcd_ros.lcd.views import Comparison, View


def share(total: NDArray[np.float64], count: int,
          counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return sums over the geometric means of two counts, 0 where there is nothing to count."""
    norm = np.sqrt(count * counts.astype(np.float64))
    shares: NDArray[np.float64] = np.where(norm > 0, total / np.maximum(norm, 1), 0)
    return shares


def edge_score(query: View, nodes: Comparison) -> NDArray[np.float64]:
    """
    Return how many edges recur between matched features, over the mean number of edges.

    Sum of w_u w_v over the query's edges (u, v) whose matches are joined in the reference.
    """
    total = kernels.total_of_common(query.graph.edge_key, *nodes.credit, len(nodes))
    share: NDArray[np.float64] = total / np.maximum((query.graph.edge_count + nodes.edges) / 2, 1)
    return share


def descriptor_score(query: View, nodes: Comparison) -> NDArray[np.float64]:
    """Return the summed weight of matched features, over the mean number of features."""
    return share(nodes.total(nodes.match_owner, nodes.match_weight), query.features,
                 nodes.features)


class NeighbourhoodScore:
    """
    How alike matched features are together with their neighbours.

    Sum of sqrt(cosine - 0.4) after one continuous WL iteration, over the mean number of
    features. What each match adds is kept of the base, the graph that this is made of; for
    another with the same nodes only matches of nodes whose edges changed are computed.
    """

    def __init__(self, base: View, nodes: Comparison) -> None:
        self._nodes = nodes
        self._base = np.zeros(len(nodes.match_query))
        everything = np.arange(base.graph.node_count)
        self._write(everything, base.iterated(everything), self._base)

    def _write(self, changed: NDArray[np.int64], rows: NDArray[np.float64],
               score: NDArray[np.float64]) -> None:
        kernels.write_match_scores(changed, rows, self._nodes.match_start,
                                   self._nodes.match_x1, score)

    def of(self, query: View, changed: NDArray[np.int64], rows: NDArray[np.float64]
           ) -> NDArray[np.float64]:
        """
        Return the score with every reference, shape (r,).

        Parameters
        ----------
        query : View
            The base after flips.
        changed : int64, (k,)
            Nodes whose edges differ from the base's.
        rows : float64, (k, 256)
            Their features in the query.

        """
        score = self._base.copy()
        self._write(changed, rows, score)
        nodes = self._nodes
        return share(nodes.total(nodes.match_owner, score), query.features, nodes.features)


class ObjectScore:
    """
    The summed cosine of assigned objects, over the mean number of objects.

    Of the base, the graph that this is made of, cosines and sums are kept: objects are assigned
    anew only where a cosine changed.
    """

    def __init__(self, base: View, nodes: Comparison) -> None:
        self._nodes = nodes
        self._cosine = object_cosines(base, nodes)
        self._total = np.zeros(len(nodes))
        self._assign(self._cosine, range(len(nodes)), self._total)

    def _assign(self, cosine: NDArray[np.float64], references: Iterable[int],
                total: NDArray[np.float64]) -> None:
        for place in references:
            _, _, chosen = assign_objects(cosine[:, self._nodes.objects_of(place)])
            total[place] = chosen.sum()

    def of(self, query: View, changed: NDArray[np.int64], rows: NDArray[np.float64]
           ) -> NDArray[np.float64]:
        """Return the score with every reference, shape (r,); see ``NeighbourhoodScore.of``."""
        nodes, total = self._nodes, self._total
        # Ascending: objects are the first of the changed nodes.
        objects = int(np.searchsorted(changed, query.objects))
        if objects:
            cosine, total = self._cosine.copy(), total.copy()
            kernels.write_cosines(changed[:objects], rows[:objects], nodes.object_x1,
                                  nodes.same_class, cosine)
            differs = (cosine != self._cosine).any(axis=0)
            self._assign(cosine, np.unique(nodes.object_owner[differs]), total)
        return share(total, query.objects, nodes.objects)


def object_cosines(query: View, nodes: Comparison) -> NDArray[np.float64]:
    """
    Return the cosines between objects of the same class after one WL iteration, else 0.

    Returns
    -------
    float64, (objects, sum of the references' objects)
        ``nodes.objects_of`` tells which columns are whose.

    """
    objects = np.arange(query.objects)
    cosine = np.zeros((query.objects, len(nodes.object_x1)))
    kernels.write_cosines(objects, query.iterated(objects), nodes.object_x1, nodes.same_class,
                          cosine)
    return cosine


def assign_objects(cosine: NDArray[np.float64]) -> tuple[
        NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """
    Return the best one-to-one assignment between objects.

    Parameters
    ----------
    cosine : float64, (objects of the query, objects of the reference)

    Returns
    -------
    query, reference : int64, (k,)
        Nodes of the assigned objects.
    cosine : float64, (k,)
        Above 0.

    """
    rows, columns = linear_sum_assignment(cosine, maximize=True)
    chosen = cosine[rows, columns]
    kept = chosen > 0
    return rows[kept], columns[kept], chosen[kept]
