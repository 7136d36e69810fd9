# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Attack a detector of one's own: any callable that says how sure it is, or just yes or no."""

from adversarial_lcd_ros import AttackConfig, Attacker, MultiTierGraph, open_graphs

tour = open_graphs('bags/flat_tour@0:0.05').graphs
place = tour[0]


def same_place(graph: MultiTierGraph) -> bool:
    """Tell whether a graph has as dense a tier of objects as the first of the tour."""
    edges = graph.edge[graph.edge[:, 1] < graph.object_count]
    wanted = place.edge[place.edge[:, 1] < place.object_count]
    return len(edges) >= len(wanted)


attacker = Attacker(AttackConfig(queries_per_edit=5))  # the paper's search
results = [attacker.process(graph, same_place) for graph in tour]
turned = sum(same_place(result.clean) != same_place(result.perturbed) for result in results)
queries = sum(result.queries for result in results)
print(f'{turned} of {len(results)} decisions turned over, {queries} queries')
