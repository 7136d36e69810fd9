"""Object-anchored subgraphs: nearest to the paper's "semantic objects as main anchors"."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.targets.scores import match_objects, share
from adversarial_lcd_ros.lcd.views import Comparison, NodeMatch, View


class AnchoredTarget:
    """
    Objects of the same class, each with the features that hang on it.

    Edges between features do not count.
    """

    name: ClassVar[str] = 'anchored'
    channels: ClassVar[tuple[str, ...]] = ('spokes', 'objects')

    def compare(self, query: View, nodes: Comparison) -> NDArray[np.float64]:
        """Return the scores (spokes, objects) of a query with every reference, shape (r, 2)."""
        # Objects come first and source < target: an edge from an object to a feature is a spoke.
        ends = query.graph.edge.astype(np.int64)
        ends = ends[(ends[:, 0] < query.objects) & (ends[:, 1] >= query.objects)]
        spokes, objects = np.zeros(len(nodes)), np.zeros(len(nodes))
        for place, (rows, columns, cosine) in enumerate(match_objects(query, nodes)):
            objects[place] = cosine.sum()
            spokes[place] = _spokes(ends, rows, columns, nodes.matches[place],
                                    query, nodes.references[place])
        return np.stack([share(spokes, query.features, nodes.features),
                         share(objects, query.objects, nodes.objects)], axis=1)


def _spokes(ends: NDArray[np.int64], rows: NDArray[np.int64], columns: NDArray[np.int64],
            match: NodeMatch, query: View, reference: View) -> float:
    """Return the summed weight of features that hang on matched objects in both graphs."""
    partner = np.full(query.graph.node_count, -1, np.int64)
    weight = np.zeros(query.graph.node_count, np.float32)
    partner[rows] = columns
    partner[match.query], weight[match.query] = match.reference, match.weight
    ends = ends[(partner[ends] >= 0).all(axis=1)]
    common = reference.graph.has_edges(partner[ends])
    return float(weight[ends[common, 1]].sum())
