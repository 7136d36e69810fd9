# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Which frames and pairs of frames are loops, from ground truth only (docs/labels.md).

Two questions are kept apart. A *pair* of frames shows the same place, different places, or
something between (``relation``, for the pair protocol). A *frame* of a replay has a loop to be
found among its earlier frames, has none, or lies between (``label_frames``, for the live one).
What two views share is told by evidence (``evidence``), or guessed from poses (``overlap``);
``judgement`` has both.

A new place is a frame without even a possible loop (``possible_overlap``): by the rule for pairs
hardly any frame would be one, since within a room some earlier view always shares a little. The
same bound tells a wrong match, and that a camera has looked elsewhere in between.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adversarial_lcd_ros.config import LabelConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.ground_truth.evidence import Evidence
from adversarial_lcd_ros.ground_truth.judgement import Judgement, judge_evidence, judge_poses
from adversarial_lcd_ros.poses.trajectory import nearest_in_time
from adversarial_lcd_ros.sequences import PLACE_INDEX, Trajectory

POSITIVE, UNSCORED, NEGATIVE = 1, 0, -1
NO_MATCH = -1
# What is said of a match: WRONG shares too little, or is too young; ELSEWHERE shares nothing, for
# certain; of UNTOLD nobody can say whether it is right.
RIGHT, WRONG, ELSEWHERE, UNTOLD = 'right', 'wrong', 'elsewhere', 'untold'
# What told labels, where nothing but ground truth poses did.
BY_POSES, BY_INDEX, BY_NOTHING = 'poses alone', 'numbers of places', 'no ground truth'
# The relation of all pairs takes a few bytes a pair: 20,000 frames are about 1.6 GB.
MAX_FRAMES = 20_000


@dataclass(frozen=True, eq=False)
class FrameLabels:
    """
    What ground truth says about every frame of a replay.

    Attributes
    ----------
    stamp_ns : int64, (n,)
        Frames, ascending.
    kind : int8, (n,)
        +1: a loop is there to be found. -1: there is none, only other places. 0: not scored.
    relation : int8, (n, n)
        Of every pair: +1 loop, -1 different places, 0 between, too close in time, or unknown.
    possible : bool, (n, n)
        Pairs that a loop closure may rightly name: the views share enough.
    elsewhere : bool, (n, n)
        Pairs that it may certainly not: the views share nothing.
    wrong : bool, (n, n)
        Pairs that it may not: elsewhere, and by poses alone also those that share too little.
        What is neither possible nor wrong cannot be told.
    scaled : bool, (n, n)
        Pairs that are a change of scale: one view holds the other as a small part. Where that
        is shown, they are possible, too.
    candidates : int64, (n,)
        The frames 0 .. candidates[i] - 1 are old enough to close a loop with frame i.
    located : bool, (n,)
        A ground truth pose is near the frame.
    told_by : str
        What told them, in words: 'co-visibility', 'depth images', 'audit', or one of the
        constants above.

    """

    stamp_ns: NDArray[np.int64]
    kind: NDArray[np.int8]
    relation: NDArray[np.int8]
    possible: NDArray[np.bool_]
    elsewhere: NDArray[np.bool_]
    wrong: NDArray[np.bool_]
    scaled: NDArray[np.bool_]
    candidates: NDArray[np.int64]
    located: NDArray[np.bool_]
    told_by: str = BY_POSES

    @cached_property
    def names(self) -> list[str]:
        """Return the kind of every frame in words, as in per_query.csv."""
        words = np.select(
            [self.kind == POSITIVE, self.kind == NEGATIVE, ~self.located, self.candidates == 0,
             self.has_scale_only],
            ['positive', 'negative', 'no_ground_truth', 'no_candidate', 'scale'], 'between')
        return [str(word) for word in words]

    @cached_property
    def has_scale_only(self) -> NDArray[np.bool_]:
        """Tell which frames share with old enough ones by changes of scale only, bool (n,)."""
        old = np.arange(len(self.kind))[None, :] < self.candidates[:, None]
        at_scale = self.possible & ~self.scaled & old
        return np.asarray((self.scaled & old).any(axis=1) & ~at_scale.any(axis=1))

    def count(self, name: str) -> int:
        """Return the number of frames of a kind in words."""
        return self.names.count(name)

    def is_correct(self, query: ArrayLike, match: ArrayLike) -> NDArray[np.bool_]:
        """
        Tell for each query frame whether a closure with the matched frame is right.

        The match must be old enough to be a loop and the two views must share enough
        (``possible``). A match that shares less than a loop does is right on a frame that has
        one.

        Parameters
        ----------
        query, match : int, (k,)
            Frame indices; NO_MATCH where the detector named none.

        """
        return np.asarray(self.judge(query, match) == RIGHT)

    def judge(self, query: ArrayLike, match: ArrayLike) -> NDArray[np.str_]:
        """
        Return what is said of matches: RIGHT, WRONG, ELSEWHERE, UNTOLD, or '' where none is named.

        Parameters
        ----------
        query, match : int, (k,)
            As for ``is_correct``.

        """
        queries, matches = np.asarray(query, np.int64), np.asarray(match, np.int64)
        named = np.maximum(matches, 0)
        old_enough = matches < self.candidates[queries]
        return np.select(
            [matches < 0, self.elsewhere[queries, named],
             self.wrong[queries, named] | (self.located[queries] & ~old_enough),
             self.possible[queries, named]], ['', ELSEWHERE, WRONG, RIGHT], UNTOLD)


def label_frames(trajectory: Trajectory, stamp_ns: ArrayLike, image_size: tuple[int, int],
                 config: LabelConfig, evidence: Evidence | None = None) -> FrameLabels:
    """
    Label every frame of a replay for the live protocol.

    Positive: at least one earlier frame makes a loop with it (``relation`` +1). Negative: every
    frame old enough would be a wrong match. All else is not scored: frames between, frames of
    which only a change of scale is known, frames so early that no frame is old enough (silence
    is trivially right there), and frames without a ground truth pose. Candidates without a pose
    are ignored.

    Parameters
    ----------
    trajectory : Trajectory
        Ground truth; frame_id 'world' (metres) or 'place_index'.
    stamp_ns : int, (n,)
        Frames of the replay, strictly ascending.
    image_size : (int, int)
        Width and height, pixels.
    config : LabelConfig
        Thresholds.
    evidence : Evidence, optional
        Of these frames (``labelling.label_views`` finds it). Without it poses alone decide,
        whatever the rule: by "distance" where that is chosen and else by "overlap"; ``told_by``
        of the result says so.

    Raises
    ------
    EvaluationError
        Stamps do not ascend, there are too many frames, or none has a ground truth pose.

    """
    stamps = _checked_stamps(stamp_ns)
    rows, located = located_poses(trajectory, stamps, config)
    judgement = (judge_poses(rows, image_size, config) if evidence is None
                 else judge_evidence(evidence))
    known = located[:, None] & located[None, :]
    judgement = Judgement(*(getattr(judgement, part.name) & known
                            for part in fields(judgement)))
    candidates = count_old_enough(stamps, config.min_gap_s)
    pairs = _relation(judgement, candidates)
    return FrameLabels(stamps, _kinds(pairs, judgement.wrong, candidates, located), pairs,
                       judgement.possible, judgement.far, judgement.wrong, judgement.scaled,
                       candidates, located,
                       BY_INDEX if trajectory.frame_id == PLACE_INDEX else BY_POSES)


def unlabelled(stamp_ns: ArrayLike) -> FrameLabels:
    """Return the labels of a replay without ground truth: no frame is scored."""
    stamps = _checked_stamps(stamp_ns)
    count = len(stamps)
    # Views of one value: nothing is known of any pair, and that takes no memory.
    nothing = np.broadcast_to(np.False_, (count, count))
    return FrameLabels(stamps, np.zeros(count, np.int8), nothing.view(np.int8), nothing,
                       nothing, nothing, nothing, np.zeros(count, np.int64), np.zeros(count, bool),
                       BY_NOTHING)


def located_poses(trajectory: Trajectory, stamps: NDArray[np.int64],
                  config: LabelConfig) -> tuple[Trajectory, NDArray[np.bool_]]:
    """
    Return the nearest pose of every frame, and which frames have one within the tolerance.

    Raises
    ------
    EvaluationError
        None has.

    """
    # Ground truth of real sequences has holes; a hole costs its frames, not the evaluation.
    row = nearest_in_time(trajectory.stamp_ns, stamps)
    tolerance_ns = round(config.pose_tolerance_s * 1e9)
    located: NDArray[np.bool_] = np.abs(trajectory.stamp_ns[row] - stamps) <= tolerance_ns
    if not located.any():
        raise EvaluationError(
            f'none of {len(stamps)} frames has a ground truth pose within '
            f'{config.pose_tolerance_s} s: is it the ground truth of this sequence?')
    return replace(trajectory, stamp_ns=stamps, position=trajectory.position[row],
                   quaternion=trajectory.quaternion[row]), located


def _checked_stamps(stamp_ns: ArrayLike) -> NDArray[np.int64]:
    stamps = np.asarray(stamp_ns, np.int64)
    if not 0 < len(stamps) <= MAX_FRAMES:
        raise EvaluationError(f'{len(stamps)} frames to label: expected 1 to {MAX_FRAMES}; take '
                              'a part of the sequence or every k-th frame')
    if np.any(np.diff(stamps) <= 0):
        at = int(np.flatnonzero(np.diff(stamps) <= 0)[0]) + 1
        raise EvaluationError(f'frame {at} is not later than the one before it: frames to label '
                              'must ascend in time')
    return stamps


def count_old_enough(stamps: NDArray[np.int64], min_gap_s: float) -> NDArray[np.int64]:
    """Return for each frame how many, the first ones, are so much older; never itself."""
    gap_ns = max(round(min_gap_s * 1e9), 1)
    count: NDArray[np.int64] = np.searchsorted(stamps, stamps - gap_ns, side='right')
    return count


def likely_loops(rows: Trajectory, image_size: tuple[int, int], config: LabelConfig
                 ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """
    Return what poses alone say: which pairs are loops if no wall is between, and which are left.

    Parameters
    ----------
    rows : Trajectory
        One pose a frame, with the stamps of the frames.
    image_size : (int, int)
        Width and height, pixels.
    config : LabelConfig
        Thresholds.

    """
    judgement = judge_poses(rows, image_size, replace(config, rule='overlap'))
    return judgement.near, judgement.left


def _relation(judgement: Judgement, candidates: NDArray[np.int64]) -> NDArray[np.int8]:
    """
    Return how every two frames are related, shape (n, n), symmetric.

    +1 same place: a loop. The views are near, at least ``min_gap_s`` apart, and the camera looked
    elsewhere at some time in between. -1 different places: the views share almost nothing,
    whichever side one looks from. 0 all else, also every pair less than ``min_gap_s`` apart.
    """
    count = len(candidates)
    index = np.arange(count)
    # The newest earlier frame that looked elsewhere: a loop partner must be older than that.
    elsewhere = np.tril(judgement.left, -1)
    newest = np.where(elsewhere.any(axis=1), count - 1 - elsewhere[:, ::-1].argmax(axis=1), -1)
    old_enough = index[None, :] < candidates[:, None]
    pairs: NDArray[np.int8] = np.zeros((count, count), np.int8)
    pairs[judgement.far & old_enough] = NEGATIVE
    pairs[judgement.near & old_enough & (index[None, :] < newest[:, None])] = POSITIVE
    symmetric: NDArray[np.int8] = pairs + pairs.T  # candidates are below the diagonal only
    return symmetric


def _kinds(pairs: NDArray[np.int8], wrong: NDArray[np.bool_], candidates: NDArray[np.int64],
           located: NDArray[np.bool_]) -> NDArray[np.int8]:
    old_enough = np.arange(len(candidates))[None, :] < candidates[:, None]
    asked = old_enough & located[None, :]
    kind: NDArray[np.int8] = np.zeros(len(candidates), np.int8)
    kind[asked.any(axis=1) & located & (wrong | ~asked).all(axis=1)] = NEGATIVE
    kind[((pairs == POSITIVE) & old_enough).any(axis=1)] = POSITIVE
    return kind
