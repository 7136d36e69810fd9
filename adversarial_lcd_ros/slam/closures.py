# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Declared loop closures as edges of a map: which are right, and what each claims.

Ground truth has three answers to a declared closure: it may be right, it certainly shows another
place, or it cannot be told. Only the second kind is false here. What cannot be told makes no
edge and is counted: most of it are wide views of the same scene, for which a front end would find
a pose that nobody here knows, and any pose invented for it would be sabotage of our own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import MapConfig
from adversarial_lcd_ros.slam.motions import Motions, between, moved

# Returns the older frame's view of the newer one, (4, 4); None where features give no pose.
Measured = Callable[[int, int], NDArray[np.float64] | None]


@dataclass(frozen=True, eq=False)
class Pairs:
    """
    Declared closures in order of their queries; frames are rows of the map.

    Attributes
    ----------
    query, match : int64, (k,)
        The newer and the older frame.
    is_false : bool, (k,)
        The two certainly show different places.

    """

    query: NDArray[np.int64]
    match: NDArray[np.int64]
    is_false: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.query)

    def chosen(self, keep: NDArray[np.bool_]) -> Pairs:
        """Return those that a mask keeps."""
        return Pairs(self.query[keep], self.match[keep], self.is_false[keep])


@dataclass(frozen=True, eq=False)
class Closures:
    """
    Edges of a map.

    Attributes
    ----------
    pairs : Pairs
    relative : float64, (k, 4, 4)
        The newer frame as seen from the older one, as the front end claims.
    sigma : float64, (k, 6)
        What the back end is told of it, radians and metres.

    """

    pairs: Pairs
    relative: Motions
    sigma: NDArray[np.float64]

    def before(self, frames: int) -> Closures:
        """Return those of the first frames of a run."""
        return self.chosen(self.pairs.query < frames)

    def chosen(self, keep: NDArray[np.bool_]) -> Closures:
        """Return those that a mask keeps."""
        return Closures(self.pairs.chosen(keep), self.relative[keep], self.sigma[keep])


def claim(pairs: Pairs, truth: Motions, config: MapConfig, rng: np.random.Generator,
          measured: Measured | None = None) -> Closures:
    """
    Return the edges that a front end makes of declared closures.

    A right one claims its true relative pose with noise (``noisy_truth``), a false one that the
    camera is where it was (``identity``), or all of them one displacement (``consistent``); either
    may be measured from the features instead (``essential``). A pair whose features give no pose
    makes no edge.

    Parameters
    ----------
    pairs : Pairs
    truth : float64, (n, 4, 4)
        Camera to world.
    config : MapConfig
    rng : numpy.random.Generator
    measured : callable, optional
        Pose from the features of two frames, older and newer; needed for ``essential`` alone.

    """
    sigma = np.repeat([np.radians(config.closure_rotation_deg), config.closure_translation_m], 3)
    # By query: a frame errs alike in two runs of one seed, whatever else they declare.
    noise = rng.standard_normal((len(truth), 6))[pairs.query] * sigma
    relative = moved(between(truth[pairs.match], truth[pairs.query]), noise)
    relative[pairs.is_false] = (
        consistent(pairs.chosen(pairs.is_false), truth)
        if config.false_claim == 'consistent' and pairs.is_false.any() else np.eye(4))
    posed = np.ones(len(pairs), bool)
    by_features = ((pairs.is_false & (config.false_claim == 'essential'))
                   | (~pairs.is_false & (config.right_claim == 'essential')))
    for row in np.flatnonzero(by_features):
        found = measured(int(pairs.match[row]), int(pairs.query[row])) if measured else None
        posed[row] = found is not None
        relative[row] = np.eye(4) if found is None else found
    edges = Closures(pairs, relative, np.tile(sigma, (len(pairs), 1)))
    return edges.chosen(posed)


def consistent(pairs: Pairs, truth: Motions) -> Motions:
    """
    Return claims that agree with one another: all by the displacement of the first pair.

    That is what a forged object does that is carried from one place to another: every view of it
    there tells the same wrong motion. Nothing but the odometry speaks against it.

    Parameters
    ----------
    pairs : Pairs
        At least one.
    truth : float64, (n, 4, 4)

    """
    displaced = truth[pairs.match[0]] @ np.linalg.inv(truth[pairs.query[0]])
    return between(truth[pairs.match], displaced @ truth[pairs.query])
