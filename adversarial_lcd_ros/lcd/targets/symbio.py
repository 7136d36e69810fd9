# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Matched features, weighed by how alike the objects are that they hang on: hubs decide."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import ANCHORS
from adversarial_lcd_ros.lcd.bound import Bound
from adversarial_lcd_ros.lcd.object_bound import ObjectMatchBound
from adversarial_lcd_ros.lcd.object_matches import ObjectMatches
from adversarial_lcd_ros.lcd.single_flips import FlipChannel, Flips
from adversarial_lcd_ros.lcd.targets.base import Scores, Target
from adversarial_lcd_ros.lcd.targets.scores import share
from adversarial_lcd_ros.lcd.views import Comparison, Feels, View

# Weisfeiler-Lehman iterations that are summed; the first looks at classes alone.
ITERATIONS = 3
# What objects of different classes count: detectors take a chair for a couch in the next frame.
OTHER_CLASS = 0.5


class ObjectMatchFlips:
    """``SymbioTarget``: a flip at a feature changes its matches, one between objects all."""

    def __init__(self, base: View, nodes: Comparison, average: NDArray[np.float64]) -> None:
        self._base, self._nodes, self._average = base, nodes, average
        self._matches = ObjectMatches.with_each(base, nodes, ITERATIONS, OTHER_CLASS)

    def after(self, flips: Flips) -> NDArray[np.float64]:
        """Return the score after each single flip, shape (k, candidates)."""
        view, (first, second) = flips.view, flips.pairs.T
        spokes = np.flatnonzero((first < view.objects) & (second >= view.objects))
        total = np.empty((len(flips.pairs), len(self._matches)))
        for column, matches in zip(total.T, self._matches, strict=True):
            column[:] = matches.total(view)
            column[spokes] = matches.after_spokes(view)[first[spokes], second[spokes]]
        for place in np.flatnonzero(second < view.objects):
            flipped = View(view.graph.flip(flips.pairs[place]), self._base)
            total[place] = [matches.total(flipped) for matches in self._matches]
        return share(total, view.features, self._nodes.features) @ self._average.T


class ObjectMatchRange(ObjectMatchBound):
    """What no few flips can do to the score, by the numbers of this target."""

    iterations: ClassVar[int] = ITERATIONS
    other_class: ClassVar[float] = OTHER_CLASS


class SymbioTarget(Target):
    """
    Matches of features, each times a soft Weisfeiler-Lehman kernel of the objects they hang on.

    Two objects are alike by their class and by the classes of the objects that they are joined
    with. A match counts by the mean over the objects of both its ends, and nothing if one of
    them has none. Edges between features do not count.
    """

    name: ClassVar[str] = 'symbio'
    channels: ClassVar[tuple[str, ...]] = ('matches',)
    feels: ClassVar[Feels] = Feels.AT_OBJECTS
    graph_variant: ClassVar[str] = ANCHORS
    flip_channels: ClassVar[Sequence[type[FlipChannel]]] = (ObjectMatchFlips,)
    bounds: ClassVar[Sequence[type[Bound]]] = (ObjectMatchRange,)
    iterations: ClassVar[int] = ITERATIONS
    other_class: ClassVar[float] = OTHER_CLASS

    def compare(self, query: View, nodes: Comparison) -> NDArray[np.float64]:
        """Return the score of a query with every reference, shape (r, 1)."""
        return self.prepare(query, nodes)(query)

    def prepare(self, base: View, nodes: Comparison) -> Scores:
        """Return what scores graphs with the nodes of a base: which edges they have is left."""
        each = ObjectMatches.with_each(base, nodes, self.iterations, self.other_class)

        def scores(query: View) -> NDArray[np.float64]:
            total = np.array([matches.total(query) for matches in each], np.float64)
            return share(total, query.features, nodes.features)[:, None]
        return scores
