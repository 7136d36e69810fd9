# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Defences of a user's own, by what they do: the tests name them as own_defences:Class."""

from dataclasses import replace

import numpy as np

from adversarial_lcd_ros.lcd.defences import Defence


def without(graph, dropped):
    return replace(graph, edge=graph.edge[~dropped], edge_length=graph.edge_length[~dropped])


class DropsLongEdges(Defence):
    """Judges a graph without its longer edges."""

    name = 'drops_long_edges'

    def prepare(self, graph):
        return without(graph, graph.edge_length > 0.3)


class DropsAllAtThree(Defence):
    """Judges a graph without its edges between features as soon as three end at an object."""

    name = 'drops_all_at_three'

    def prepare(self, graph):
        spokes = graph.edge[:, 0] < graph.object_count
        return without(graph, ~spokes) if spokes.sum() >= 3 else graph


class IgnoresEdges(Defence):
    """Judges a graph by its nodes alone."""

    name = 'ignores_edges'
    ignores_edges = True

    def prepare(self, graph):
        return without(graph, np.ones(graph.edge_count, bool))


class CountsLikeLengths(Defence):
    """Lets edges recur only where their lengths agree."""

    name = 'counts_like_lengths'

    def compare(self, nodes):
        def keeps(query, reference, pairs, edges):
            here, there = query.graph.length_between(pairs), reference.graph.length_between(edges)
            return np.abs(np.log((here + 0.01) / (there + 0.01))) < 0.3
        return nodes.with_credit(keeps)


class RefusesEven(Defence):
    """Bears a loop out, half or not at all, by when the match was seen."""

    name = 'refuses_even'

    def support(self, query, match):
        return (0.0, 0.5, 2.0)[match.stamp_ns // 10**9 % 3]


class CountsPreparations(Defence):
    """Judges a graph with one edge flipped, and tells how many it was asked for."""

    name = 'counts_preparations'
    asked = 0

    def prepare(self, graph):
        self.asked += 1
        return graph.flip([(0, 1)])


class MovesNodes(Defence):
    """Does what no defence may."""

    name = 'moves_nodes'

    def prepare(self, graph):
        return replace(graph, position=graph.position + 1)
