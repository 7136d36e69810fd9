"""What every target has in common."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.views import Comparison, View

# Scores of a View whose nodes are known, shape (r, channels).
Scores = Callable[[View], NDArray[np.float64]]


class Target(Protocol):
    """
    Compares two graphs; a trained decision turns the scores into a probability.

    Attributes
    ----------
    name : str
        The value of the ``target`` setting.
    channels : tuple of str
        Names of the scores that ``compare`` returns, each at least 0, higher for more alike.

    """

    name: ClassVar[str]
    channels: ClassVar[tuple[str, ...]]

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
        ...


@runtime_checkable
class IncrementalTarget(Target, Protocol):
    """A target that can reuse what it computed for a graph that differs in a few edges."""

    def prepare(self, base: View, nodes: Comparison) -> Scores:
        """
        Return what scores graphs with the base's nodes exactly as ``compare`` does.

        Parameters
        ----------
        base : View
            The graph that others are expected to be near to.
        nodes : Comparison

        """
        ...


def prepare(target: Target, base: View, nodes: Comparison) -> Scores:
    """Return what scores graphs with the nodes of a base; any target will do."""
    if isinstance(target, IncrementalTarget):
        return target.prepare(base, nodes)
    return lambda query: target.compare(query, nodes)
