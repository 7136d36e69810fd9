# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What every target has in common; the least that one of your own needs.

Subclass ``Target``, give it a ``name`` and ``channels``, and override ``compare``;
"adversarial-lcd train --targets package.module:Class" fits its decision. The other class
attributes say what else is true of it; each saves time where it is given.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.bound import Bound
from adversarial_lcd_ros.lcd.single_flips import FlipChannel
from adversarial_lcd_ros.lcd.views import Comparison, Feels, View

# Scores of a View whose nodes are known, shape (r, channels).
Scores = Callable[[View], NDArray[np.float64]]


class Target(ABC):
    """
    Compares two graphs; a trained decision turns the scores into a probability.

    Attributes
    ----------
    name : str
        The value of the ``target`` setting, and part of the name of its trained decision.
    channels : tuple of str
        Names of the scores that ``compare`` returns, each at least 0, higher for more alike.
    feels : Feels
        Flips that can change a score.
    graph_variant : str
        Variant of graphs (BuilderConfig) that it needs; '': it takes any.
    flip_channels : tuple of FlipChannel classes
        What scores all single flips at once, one for each channel; without, flips are made and
        judged one by one.
    bounds : sequence of Bound classes
        What no few flips can do to each channel (lcd/bound_channels.py); without, there are no
        certificates.
    trainer : str
        ``package.module:Class`` that trains the network of a target that has one
        (training/gnn.py); '': it needs none. Its network is the ONNX file beside its decision.
    query_s, flip_s : float
        About how long a query of a graph of 300 nodes takes, with its share of the search, and a
        flip scored by the yardstick; seconds on one core. They only tell how long an evaluation
        may take.

    """

    name: ClassVar[str]
    channels: ClassVar[tuple[str, ...]]
    feels: ClassVar[Feels] = Feels.EVERY
    graph_variant: ClassVar[str] = ''
    flip_channels: ClassVar[Sequence[type[FlipChannel]]] = ()
    bounds: ClassVar[Sequence[type[Bound]]] = ()
    trainer: ClassVar[str] = ''
    query_s: ClassVar[float] = 0.4e-3
    flip_s: ClassVar[float] = 0.3e-6

    @classmethod
    def open(cls, network: Path | None) -> Target:
        """Return the target; one with a network overrides this to take it from its file."""
        return cls()

    @abstractmethod
    def compare(self, query: View, nodes: Comparison) -> NDArray[np.float64]:
        """
        Return the scores of a query with every reference, shape (r, channels).

        Parameters
        ----------
        query : View
            Its edges may differ from those of the graph that ``nodes`` was made of.
        nodes : Comparison
            The query's nodes beside r references.

        """

    def prepare(self, base: View, nodes: Comparison) -> Scores:
        """
        Return what scores graphs with the base's nodes exactly as ``compare`` does.

        A target that can reuse what it computed for a graph that differs in a few edges
        overrides this.

        Parameters
        ----------
        base : View
            The graph that others are expected to be near to.
        nodes : Comparison

        """
        return lambda query: self.compare(query, nodes)
