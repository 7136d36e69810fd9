# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How far the poses that features claim are from the truth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.evaluation.maps.cases import Poses
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.slam.closures import Pairs
from adversarial_lcd_ros.slam.motions import Motions, angles_rad, between, lengths_m

QUANTILES = (0.5, 0.9)
# A shorter motion has no direction that one camera could see.
LEAST_MOTION_M = 0.1


def claim_errors(pairs: Mapping[tuple[str, str], Pairs], truth: Motions,
                 measured: Poses) -> list[Row]:
    """
    Return how far measured poses are from the true ones, a row for each run.

    Parameters
    ----------
    pairs : mapping
        Name and setting of a run to its closures.
    truth : float64, (n, 4, 4)
        Camera to world.
    measured : mapping
        (match, query) to the newer camera as seen from the older one; None: features give none.

    Returns
    -------
    list of Row
        ``right``, ``false``: closures; ``right_posed``, ``false_posed``: those that got a pose.
        Of right ones with a pose: ``rotation_deg``, ``translation_m``, ``direction_deg``, at the
        quantiles ``QUANTILES``; the last over ``moved`` closures alone, those whose true motion is
        at least ``LEAST_MOTION_M``. ``true_m``: how long the true motions are.

    """
    return [_row(run, setting, of, truth, measured) for (run, setting), of in pairs.items()]


def _row(run: str, setting: str, pairs: Pairs, truth: Motions, measured: Poses) -> Row:
    keys = list(zip(pairs.match.tolist(), pairs.query.tolist(), strict=True))
    posed = np.array([measured.get(key) is not None for key in keys], bool)
    right = ~pairs.is_false & posed
    claimed = np.array([measured[keys[row]] for row in np.flatnonzero(right)]).reshape(-1, 4, 4)
    true = between(truth[pairs.match[right]], truth[pairs.query[right]])
    long = lengths_m(true) >= LEAST_MOTION_M
    return {'run': run, 'setting': setting,
            'right': int((~pairs.is_false).sum()), 'right_posed': int(right.sum()),
            'false': int(pairs.is_false.sum()),
            'false_posed': int((pairs.is_false & posed).sum()), 'moved': int(long.sum()),
            'rotation_deg': _quantiles(np.degrees(angles_rad(between(true, claimed)))),
            'direction_deg': _quantiles(_angles_deg(true[long, :3, 3], claimed[long, :3, 3])),
            'translation_m': _quantiles(np.linalg.norm(
                true[:, :3, 3] - claimed[:, :3, 3], axis=1)),
            'true_m': _quantiles(lengths_m(true))}


def _angles_deg(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    length = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    cosine = np.einsum('ni,ni->n', first, second) / np.maximum(length, 1e-12)
    angle: NDArray[np.float64] = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return angle


def _quantiles(values: NDArray[np.float64]) -> list[Any]:
    return [float(value) for value in np.quantile(values, QUANTILES)] if len(values) else [
        None] * len(QUANTILES)
