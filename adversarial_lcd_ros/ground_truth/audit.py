# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Evidence from pictures and true poses alone: what can be shown to be shared, and what cannot.

Depth comes from motion: 600 ORB features a picture are matched with frames up to four seconds
apart and some centimetres aside. Matches within 3 pixels of the true epipolar line give a depth; a
feature without one lies as deep as those around it or, after a turn in place, anywhere from 0.3 m
on.

Every feature of a view is put into every older view at its depth, and the other way round: hidden
behind what is nearer there, or somewhere on a short piece of its epipolar line. One there that
looks alike (64 of 256 bits) is found. By chance as many are found as at the three mirror images of
that place: another relative pose.

Right: at least 12 found, and so many by chance less often than once in 10,000 times (Poisson).
Elsewhere: no more found than by chance (1 %), nor in the frames 0.2 s before and after; less than
a tenth of either view would be in sight from so much nearer, further or aside that ORB could not
know it again; and features cover 45 % of the newer view: blank walls cannot be known again. A loop
is right and near: within 0.5 m, 25 degrees, and 60 % of possible overlap.
"""

from __future__ import annotations

from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter
from scipy.stats import poisson

from adversarial_lcd_ros.compiled import sightings
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.ground_truth.evidence import Evidence
from adversarial_lcd_ros.ground_truth.motion_depth import Camera, inverse_depths
from adversarial_lcd_ros.ground_truth.view_features import ViewFeatures
from adversarial_lcd_ros.sequences.sequence import Progress

# A match may be this far from where the poses put it; a segment that is searched at most so
# long. Shares of the image width.
RADIUS, LONGEST = 0.01, 0.1
TRIANGULATION_PX = 3.0
BITS = 64
ZOOM, STEEPEST = 1.8, 0.77
# Counts of all pairs take 24 bytes each: these frames 0.6 GB.
MAX_FRAMES = 5000
# Matches support a pair if so many would come by chance this rarely; nothing was found if as many
# come by chance at least this often, here and in the frames just before and after.
SUPPORT, SUPPORT_LEAST, NOTHING, AROUND_S = 1e-4, 12, 0.01, 0.2
# Chance is counted at three places only: it is never taken to be less than this.
_CHANCE_LEAST = 0.5
# A pair cannot be told if this share of a view would be seen, but could not be recognised.
UNTESTED = 0.1
# Nor, if less of the newer view than this has features: a wall without any may have been seen.
COVERED = 0.45
# A change of scale: so much of one view would be seen in the other, so little the other way.
SCALE_LARGE, SCALE_SMALL = 0.5, 0.3


@dataclass(frozen=True, eq=False)
class Sightings:
    """
    Counts of every pair of views, int32, (n, n, 6), and the features of every view.

    Attributes
    ----------
    count : int32, (n, n, 6)
        Of view i in view j; the columns of ``compiled.sightings``.
    features : int64, (n,)
    covered : float64, (n,)
        Share of the image with features in sight: what is blank cannot be found again.

    """

    count: NDArray[np.int32]
    features: NDArray[np.int64]
    covered: NDArray[np.float64]


def look(features: ViewFeatures, camera: Camera, candidates: NDArray[np.int64],
         progress: Progress | None = None) -> Sightings:
    """
    Look for the features of every view in all views that are old enough, and the other way.

    Parameters
    ----------
    features : ViewFeatures
    camera : Camera
    candidates : int64, (n,)
        Frames 0 .. candidates[i] - 1 are old enough for frame i.
    progress : callable, optional
        Called with frames done and to do.

    Raises
    ------
    EvaluationError
        There are too many frames.

    """
    frames = len(features.count)
    if frames > MAX_FRAMES:
        raise EvaluationError(f'{frames} frames to compare: expected {MAX_FRAMES} at most; take a '
                              'part of the sequence, or label by poses alone (rule overlap)')
    near, far, known = inverse_depths(features, camera, TRIANGULATION_PX)
    columns = math.ceil(camera.width / sightings.CELL_PX)
    rows = math.ceil(camera.height / sightings.CELL_PX)
    start, order = sightings.in_cells(features.position, features.count, columns, rows)
    depth = _depth_maps(features, near, far, known, columns, rows)
    _fill(features, near, far, known, depth)
    words = features.words
    result = np.zeros((frames, frames, sightings.COLUMNS), np.int32)
    for frame in np.flatnonzero(camera.located):
        old = np.flatnonzero(camera.located[:candidates[frame]])
        pairs = np.stack([np.full(len(old), frame), old], axis=1)
        for one in (pairs, np.ascontiguousarray(pairs[:, ::-1])):
            result[one[:, 0], one[:, 1]] = sightings.count_sightings(
                one, features.position, words, features.count, near, far, camera.turn,
                camera.centre, (camera.width, camera.height, camera.focal), depth,
                (start, order, columns, rows), RADIUS * camera.width, LONGEST * camera.width,
                ZOOM, STEEPEST, BITS)
        if progress:
            progress(int(frame) + 1, frames)
    return Sightings(result, features.count, _covered(features, columns, rows))


def evidence(seen: Sightings, time_s: NDArray[np.float64], candidates: NDArray[np.int64],
             likely: NDArray[np.bool_], left: NDArray[np.bool_]) -> Evidence:
    """
    Return what the counts show.

    Shared: more is found where the true poses put it than chance allows. Elsewhere: no more is
    found than by chance, neither here nor in the frames just before and after, and next to
    nothing would be in sight that could not be recognised, such as surfaces seen from much
    nearer. All else cannot be told.

    Parameters
    ----------
    seen : Sightings
    time_s : float64, (n,)
        Of the frames, ascending.
    candidates : int64, (n,)
        As in ``look``.
    likely : bool, (n, n)
        Loops by their poses, if nothing is in between.
    left : bool, (n, n)
        By poses, a camera that comes from one to the other has looked away.

    """
    count = seen.count.astype(np.float64)
    looked = np.arange(len(candidates))[None, :] < candidates[:, None]
    looked |= looked.T
    total = count + count.transpose(1, 0, 2)
    found = total[..., sightings.FOUND]
    chance = np.maximum(total[..., sightings.BY_CHANCE] / sightings.MIRRORED, _CHANCE_LEAST)
    rarity = np.where(looked, poisson.sf(found - 1, chance), 1.0)
    shared = (rarity < SUPPORT) & (found >= SUPPORT_LEAST)
    nothing = minimum_filter(rarity, 2 * _frames_around(time_s) + 1, mode='nearest') > NOTHING
    share = count / np.maximum(seen.features, 1)[:, None, None]
    untested = share[..., sightings.UNTESTED]
    agreeing = share[..., sightings.AGREEING]
    less, more = np.minimum(agreeing, agreeing.T), np.maximum(agreeing, agreeing.T)
    newer = np.maximum(*np.indices(looked.shape))
    elsewhere = (looked & nothing & (np.maximum(untested, untested.T) < UNTESTED)
                 & (seen.covered[newer] >= COVERED))
    scaled = looked & ~elsewhere & (more >= SCALE_LARGE) & (less < SCALE_SMALL)
    return Evidence(likely & shared & ~scaled, shared, scaled, elsewhere, left | elsewhere)


def _frames_around(time_s: NDArray[np.float64]) -> int:
    # At least one, but no more of a slow sequence: it looks elsewhere soon.
    if len(time_s) < 2:
        return 0
    return max(round(AROUND_S / max(float(np.median(np.diff(time_s))), 1e-3)), 1)


def _cells(features: ViewFeatures, frame: NDArray[np.int64], k: NDArray[np.int64]
           ) -> list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]]:
    # Where these features are in maps with a margin of one cell, and all places around.
    cell = (features.position[frame, k] / sightings.CELL_PX).astype(np.int64) + 1
    return [(frame, cell[:, 1] + down, cell[:, 0] + across)
            for across in (-1, 0, 1) for down in (-1, 0, 1)]


def _depth_maps(features: ViewFeatures, near: NDArray[np.float32], far: NDArray[np.float32],
                known: NDArray[np.bool_], columns: int, rows: int) -> NDArray[np.float32]:
    # Least and largest depth in each cell and those around it; 0 where less than two are known.
    least = np.full((len(features.count), rows + 2, columns + 2), np.inf, np.float32)
    most = np.zeros_like(least)
    number = np.zeros(least.shape, np.int64)
    frame, k = np.nonzero(known)
    depth = 2 / (near[frame, k] + far[frame, k])
    for place in _cells(features, frame, k):
        np.minimum.at(least, place, depth)
        np.maximum.at(most, place, depth)
        np.add.at(number, place, 1)
    both = np.stack([np.where(number >= 2, least, 0), np.where(number >= 2, most, 0)], axis=-1)
    return np.ascontiguousarray(both[:, 1:-1, 1:-1], np.float32)


def _covered(features: ViewFeatures, columns: int, rows: int) -> NDArray[np.float64]:
    # Share of each image that has a feature in its cell or in one beside it.
    has = np.zeros((len(features.count), rows + 2, columns + 2), bool)
    taken = np.arange(features.position.shape[1])[None, :] < features.count[:, None]
    for place in _cells(features, *np.nonzero(taken)):
        has[place] = True
    return np.asarray(has[:, 1:-1, 1:-1].mean(axis=(1, 2)), np.float64)


def _fill(features: ViewFeatures, near: NDArray[np.float32], far: NDArray[np.float32],
          known: NDArray[np.bool_], depth: NDArray[np.float32]) -> None:
    # What has no depth of its own lies as deep as what is around it.
    cell = (features.position / sightings.CELL_PX).astype(np.int64)
    around = depth[np.arange(len(depth))[:, None], cell[..., 1], cell[..., 0]]
    use = ~known & (around[..., 1] > 0)
    near[use], far[use] = 1 / around[use, 0], 1 / around[use, 1]
