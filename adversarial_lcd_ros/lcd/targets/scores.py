"""Similarity scores of two graphs from which the targets are put together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from adversarial_lcd_ros.lcd.views import MIN_COSINE, NodeMatch, View


def soft_weight(cosine: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return sqrt(cosine - 0.4), 0 below: how much a match counts."""
    weight: NDArray[np.float32] = np.sqrt(np.maximum(cosine - np.float32(MIN_COSINE), 0))
    return weight


def share(total: float, a: int, b: int) -> float:
    """Return a sum over the geometric mean of two counts, 0 where there is nothing to count."""
    return float(total / np.sqrt(a * b)) if a and b else 0.0


def edge_score(query: View, reference: View, match: NodeMatch) -> float:
    """
    Return how many edges recur between matched features, over the mean number of edges.

    Sum of w_u w_v over the query's edges (u, v) whose matches are joined in the reference.
    """
    mean_edges = (query.graph.edge_count + reference.graph.edge_count) / 2
    if not mean_edges:
        return 0.0
    ends = query.graph.edge.astype(np.int64)
    u, v = ends[:, 0], ends[:, 1]
    both = (match.partner[u] >= 0) & (match.partner[v] >= 0)
    u, v = u[both], v[both]
    mapped = np.stack([match.partner[u], match.partner[v]], axis=1)
    common = reference.graph.has_edges(mapped)
    weight = match.partner_weight[u[common]] * match.partner_weight[v[common]]
    return float(weight.sum()) / mean_edges


def node_score(query: View, reference: View, match: NodeMatch, iteration: int) -> float:
    """
    Return the soft sum of matched features, over the geometric mean of their numbers.

    Parameters
    ----------
    query, reference, match
        The pair.
    iteration : int
        0: descriptors alone; 1: descriptors mixed with their neighbours' (continuous WL).

    """
    weight = match.weight
    if iteration:
        weight = soft_weight(
            np.einsum('ij,ij->i', query.x1[match.query], reference.x1[match.reference]))
    return share(weight.sum(), query.features, reference.features)


def match_objects(query: View, reference: View) -> tuple[NDArray[np.int64], NDArray[np.int64],
                                                         NDArray[np.float32]]:
    """
    Return the best one-to-one assignment between objects of the same class.

    Returns
    -------
    query, reference : int64, (k,)
        Nodes of the assigned objects.
    cosine : float32, (k,)
        Cosine of their features after one WL iteration, above 0.

    """
    cosine = query.x1[:query.objects] @ reference.x1[:reference.objects].T
    same = (query.graph.label[:query.objects, None]
            == reference.graph.label[None, :reference.objects])
    cosine = np.where(same, cosine, np.float32(0))
    rows, columns = linear_sum_assignment(cosine, maximize=True)
    chosen = cosine[rows, columns]
    kept = chosen > 0
    return rows[kept], columns[kept], chosen[kept]


def object_score(query: View, reference: View) -> float:
    """Return the summed cosine of assigned objects, over the geometric mean of their numbers."""
    cosine = match_objects(query, reference)[2]
    return share(cosine.sum(), query.objects, reference.objects)
