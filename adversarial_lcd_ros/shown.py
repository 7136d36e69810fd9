# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How a search, a perturbation or a surrogate appears in reports: facts on its class."""

from __future__ import annotations

from typing import ClassVar

# Where the ranks of what is not the paper's, and of ours, begin.
OTHERS_RANK, OURS_RANK = 20, 100


class Shown:
    """
    What has a name, and a place in tables and plots.

    Attributes
    ----------
    name : str
        The value of its setting.
    title : str
        In words; '': the name, with blanks.
    rank : int
        Place among the columns of a table: the paper's from 0 on, from 20 on what is new, from
        100 on ours, from 200 on yardsticks.
    colour : str
        Of its curves, the same in every plot; '': one by its name.
    marker, dash : str
        Of its curves, as matplotlib names them.

    """

    name: ClassVar[str] = ''
    title: ClassVar[str] = ''
    rank: ClassVar[int] = 50
    colour: ClassVar[str] = ''
    marker: ClassVar[str] = 'o'
    dash: ClassVar[str] = '-'
