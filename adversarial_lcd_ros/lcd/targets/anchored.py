"""Object-anchored subgraphs: nearest to the paper's "semantic objects as main anchors"."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.targets.scores import match_objects, share
from adversarial_lcd_ros.lcd.views import NodeMatch, View


class AnchoredTarget:
    """
    Objects of the same class, each with the features that hang on it.

    Edges between features do not count.
    """

    name: ClassVar[str] = 'anchored'
    channels: ClassVar[tuple[str, ...]] = ('spokes', 'objects')

    def compare(self, query: View, reference: View, match: NodeMatch) -> NDArray[np.float64]:
        """Return the scores (spokes, objects) of a pair."""
        rows, columns, cosine = match_objects(query, reference)
        anchor = np.full(query.objects, -1, np.int64)
        anchor[rows] = columns
        # Objects come first and source < target: an edge from an object to a feature is a spoke.
        ends = query.graph.edge.astype(np.int64)
        ends = ends[(ends[:, 0] < query.objects) & (ends[:, 1] >= query.objects)]
        ends = ends[(anchor[ends[:, 0]] >= 0) & (match.partner[ends[:, 1]] >= 0)]
        mapped = np.stack([anchor[ends[:, 0]], match.partner[ends[:, 1]]], axis=1)
        common = reference.graph.has_edges(mapped)
        spokes = float(match.partner_weight[ends[common, 1]].sum())
        return np.array([share(spokes, query.features, reference.features),
                         share(cosine.sum(), query.objects, reference.objects)])
