"""What every target has in common."""

from __future__ import annotations

from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.lcd.views import NodeMatch, View


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

    def compare(self, query: View, reference: View, match: NodeMatch) -> NDArray[np.float64]:
        """
        Return the scores of a pair, shape (len(channels),).

        Parameters
        ----------
        query, reference : View
        match : NodeMatch
            Of the two graphs' features; computed once for all flips of a query.

        """
        ...
