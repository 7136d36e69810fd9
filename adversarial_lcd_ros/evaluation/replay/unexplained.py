# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Edges that nodes do not explain, in the graphs that a detector got: what an operator is told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.scoring import Scoring


def unexplained_edges(graphs: Mapping[str, Sequence[MultiTierGraph]],
                      lcd: LcdConfig) -> dict[str, dict[str, float]] | None:
    """
    Return how many edges of each run the detector's defences have no explanation for.

    Parameters
    ----------
    graphs : mapping of str to sequence of MultiTierGraph
        By name of the run, those that the detector was sent, as recorded.
    lcd : LcdConfig
        Of the detector.

    Returns
    -------
    dict of str to dict, or None
        By run: ``mean`` of the edges a graph, and in how many ``graphs`` there is one; the same as
        /diagnostics of the node counts. None if no defence counts edges.

    """
    scoring = Scoring.of(lcd)
    if not scoring.counts_edges:
        return None
    found = {name: [scoring.unexplained(graph) for graph in run] for name, run in graphs.items()}
    return {name: {'mean': sum(counts) / max(len(counts), 1),
                   'graphs': sum(count > 0 for count in counts)}
            for name, counts in found.items()}
