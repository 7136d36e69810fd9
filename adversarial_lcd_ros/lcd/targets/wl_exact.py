# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The textbook Weisfeiler-Lehman subtree kernel on exact labels: brittle, and here to show it."""

from __future__ import annotations

from typing import ClassVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.graph import OBJECT_TIER
from adversarial_lcd_ros.lcd.targets.base import Target
from adversarial_lcd_ros.lcd.views import Comparison, View
from adversarial_lcd_ros.weisfeiler_lehman.histogram import Histogram, histogram

# The least depth at which edges count at all, and the best of 0 to 3 across the training sequences
# (docs/tried.md): each further one adds labels that recur in no other view.
ITERATIONS = 1
# Classes and words are counted from 0 alike: one bit keeps an object from being a feature.
_OBJECT_BIT = np.uint32(1 << 31)


class WlExactTarget(Target):
    """
    Labels of nodes and of their neighbourhoods that are the same, to the last neighbour.

    Shervashidze et al., "Weisfeiler-Lehman graph kernels" (2011): histograms of the labels of
    iterations 0 to h, their scalar product over the geometric mean of the products with
    themselves.
    """

    name: ClassVar[str] = 'wl_exact'
    channels: ClassVar[tuple[str, ...]] = ('kernel',)
    query_s: ClassVar[float] = 1.3e-3
    flip_s: ClassVar[float] = 1.3e-3

    def __init__(self) -> None:
        # A keyframe is compared with many queries.
        self._known: WeakKeyDictionary[View, tuple[Histogram, int]] = WeakKeyDictionary()

    def compare(self, query: View, nodes: Comparison) -> NDArray[np.float64]:
        """Return the normalised kernel of a query with every reference, shape (r, 1)."""
        mine, own = self._histogram(query)
        kernels = np.zeros((len(nodes), 1))
        for place, reference in enumerate(nodes.references):
            theirs, other = self._histogram(reference)
            # Only a graph without nodes has no product with itself, and none with others.
            kernels[place] = mine.kernel(theirs) / max(np.sqrt(float(own) * other), 1)
        return kernels

    def _histogram(self, view: View) -> tuple[Histogram, int]:
        """Return the labels of a graph, and their product with themselves."""
        if view not in self._known:
            graph = view.graph
            label = np.where(graph.tier == OBJECT_TIER, graph.label | _OBJECT_BIT, graph.label)
            found = histogram(graph, label, ITERATIONS)
            self._known[view] = found, found.kernel(found)
        return self._known[view]
