"""
Similarity scores from which the targets are put together.

Each compares one query with all references of a Comparison; shape (r,).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from adversarial_lcd_ros.lcd.views import MIN_COSINE, Comparison, View


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
    edge_key = query.graph.edge_key
    if not len(edge_key):
        return np.zeros(len(nodes))
    place = np.minimum(np.searchsorted(edge_key, nodes.credit_key), len(edge_key) - 1)
    present = edge_key[place] == nodes.credit_key
    total = nodes.total(nodes.credit_owner[present], nodes.credit_weight[present])
    return total / ((len(edge_key) + nodes.edges) / 2)


def descriptor_score(query: View, nodes: Comparison) -> NDArray[np.float64]:
    """Return the summed weight of matched features, over the mean number of features."""
    return share(nodes.total(nodes.match_owner, nodes.match_weight), query.features,
                 nodes.features)


def neighbourhood_score(query: View, nodes: Comparison) -> NDArray[np.float64]:
    """
    Return how alike matched features are together with their neighbours.

    Sum of sqrt(cosine - 0.4) after one continuous WL iteration, over the mean number of features.
    """
    cosine = np.einsum('ij,ij->i', query.x1[nodes.match_query], nodes.match_x1)
    weight = np.sqrt(np.maximum(cosine - np.float32(MIN_COSINE), 0))
    return share(nodes.total(nodes.match_owner, weight), query.features, nodes.features)


def match_objects(query: View, nodes: Comparison) -> Iterator[
        tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float32]]]:
    """
    Yield for each reference the best one-to-one assignment between objects of the same class.

    Yields
    ------
    query, reference : int64, (k,)
        Nodes of the assigned objects.
    cosine : float32, (k,)
        Cosine of their features after one WL iteration, above 0.

    """
    everything = query.x1[:query.objects] @ nodes.object_x1.T
    labels = query.graph.label[:query.objects, None]
    ends = np.cumsum(nodes.objects)
    for view, end in zip(nodes.references, ends, strict=True):
        same = labels == view.graph.label[None, :view.objects]
        cosine = np.where(same, everything[:, end - view.objects:end], np.float32(0))
        rows, columns = linear_sum_assignment(cosine, maximize=True)
        chosen = cosine[rows, columns]
        kept = chosen > 0
        yield rows[kept], columns[kept], chosen[kept]


def object_score(query: View, nodes: Comparison) -> NDArray[np.float64]:
    """Return the summed cosine of assigned objects, over the mean number of objects."""
    total = np.array([float(cosine.sum()) for _, _, cosine in match_objects(query, nodes)])
    return share(total, query.objects, nodes.objects)
