"""What every target has in common."""

from __future__ import annotations

from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.views import Comparison, View


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
