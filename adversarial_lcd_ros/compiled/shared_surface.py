# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How much of the surface in one depth image another one sees, too; compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.hamming import compiled

# The same surface: within this share of the depth and this many metres.
SAME_SHARE, SAME_M = 0.03, 0.03
_NEAREST_M = 0.05


@compiled
def shared_surface(depth: NDArray[np.float32], turn: NDArray[np.float64],
                   centre: NDArray[np.float64], focal: float) -> NDArray[np.float32]:
    """
    Return the share of the surface in depth image i that depth image j sees, too.

    Every ray of i is a point; it is seen in j where j's depth image has the same depth there.

    Parameters
    ----------
    depth : float32, (n, rows, columns)
        Metres along the optical axis; 0: unknown.
    turn, centre : float64, (n, 3, 3) and (n, 3)
        Camera to world; camera centres, metres.
    focal : float
        Pixels of the depth image; square pixels, central principal point.

    Returns
    -------
    float32, (n, n)
        NaN where image i knows no depth.

    """
    frames, rows, columns = depth.shape
    share = np.full((frames, frames), np.nan, np.float32)
    for i in range(frames):
        for j in range(frames):
            between = turn[j].T @ turn[i]
            offset = turn[j].T @ (centre[i] - centre[j])
            known, seen = 0, 0
            for row in range(rows):
                for column in range(columns):
                    z = depth[i, row, column]
                    if z <= 0:
                        continue
                    known += 1
                    x = (column + 0.5 - columns / 2) / focal * z
                    y = (row + 0.5 - rows / 2) / focal * z
                    ahead = between[2, 0] * x + between[2, 1] * y + between[2, 2] * z + offset[2]
                    if ahead < _NEAREST_M:
                        continue
                    across = between[0, 0] * x + between[0, 1] * y + between[0, 2] * z + offset[0]
                    down = between[1, 0] * x + between[1, 1] * y + between[1, 2] * z + offset[1]
                    u = int(np.floor(across / ahead * focal + columns / 2))
                    v = int(np.floor(down / ahead * focal + rows / 2))
                    if 0 <= u < columns and 0 <= v < rows and depth[j, v, u] > 0:
                        seen += abs(depth[j, v, u] - ahead) <= SAME_SHARE * ahead + SAME_M
            if known:
                share[i, j] = seen / known
    return share
