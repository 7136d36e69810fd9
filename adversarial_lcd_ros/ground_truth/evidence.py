# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is known of the surface that two views share, whatever told it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LabelConfig


@dataclass(frozen=True, eq=False)
class Evidence:
    """
    What is known of every two views, each bool, (n, n), symmetric. All false: nothing.

    Attributes
    ----------
    loop : bool
        So much in common that a detector may be asked to see it.
    shared : bool
        The views have something in common: a match may rightly name the other.
    scaled : bool
        One view holds the other as a small part: seen from nearer or further, a change of scale.
    elsewhere : bool
        Certainly other places: the views share nothing.
    left : bool
        A camera that comes from one to the other has looked away.

    """

    loop: NDArray[np.bool_]
    shared: NDArray[np.bool_]
    scaled: NDArray[np.bool_]
    elsewhere: NDArray[np.bool_]
    left: NDArray[np.bool_]


def from_shares(share: NDArray[np.float64], config: LabelConfig) -> Evidence:
    """
    Return what follows from exact shares.

    Parameters
    ----------
    share : float, (n, n)
        Share of the surface in view i that view j sees, too, 0 to 1; NaN where nobody knows.
    config : LabelConfig
        ``loop_share``, ``shared_share`` and ``elsewhere_share``.

    """
    # NaN compares as false: nothing is known of such a pair, from either side.
    less, more = np.minimum(share, share.T), np.maximum(share, share.T)
    shared, same = more >= config.shared_share, less >= config.shared_share
    return Evidence(less >= config.loop_share, shared, shared & (less < config.shared_share),
                    more < config.elsewhere_share, ~same & ~np.isnan(less))
