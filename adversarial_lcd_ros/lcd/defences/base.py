# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What every defence has in common; the least that one of your own needs.

Subclass ``Defence``, give it a ``name``, and override what it does: ``prepare`` changes a graph
before anybody looks at it, ``compare`` what counts when two graphs are compared, ``support`` has
the last word on a loop; ``unexplained`` is for whoever watches. The detector, the yardstick that
scores all single flips, and the pairs that decisions are trained and measured on all come to it
through lcd/scoring.py.
"""

from __future__ import annotations

from typing import ClassVar

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.views import Comparison


class Defence:
    """
    Stands between a graph that was received and what is decided on it.

    Parameters
    ----------
    config : LcdConfig
        Settings of the detector; those of the defence are among them.

    Attributes
    ----------
    name : str
        The value of the ``defences`` setting.
    ignores_edges : bool
        What ``prepare`` returns hangs on the nodes alone: no flip makes a difference.

    """

    name: ClassVar[str]
    ignores_edges: ClassVar[bool] = False

    def __init__(self, config: LcdConfig) -> None:
        self.config = config

    def prepare(self, graph: MultiTierGraph) -> MultiTierGraph:
        """
        Return the graph to judge in place of one received, queries and keyframes alike.

        Its edges may differ, its nodes must not: what is known of them is kept between flips.
        """
        return graph

    def compare(self, nodes: Comparison) -> Comparison:
        """
        Return what counts when a query is compared with references.

        Parameters
        ----------
        nodes : Comparison
            The query's nodes beside r references; the query's edges must not be looked at, since
            they are flipped without asking again. ``Comparison.with_credit`` drops edges that
            would recur.

        """
        return nodes

    def unexplained(self, graph: MultiTierGraph) -> int:
        """Return how many edges of a graph as received cannot be right: said, not judged by."""
        return 0

    def support(self, query: MultiTierGraph, match: MultiTierGraph) -> float:
        """
        Return how far a declared loop is borne out: from 1 on it stands.

        Below, no loop is declared, and its probability is the threshold times the support.
        Edges must not be looked at: those of the query are flipped without asking again, those of
        the match, a keyframe, are what ``prepare`` has made of them.
        """
        return 1.0
