# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Balanced pairs of frames for the pair protocol: the paper's "accuracy"."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE


@dataclass(frozen=True, eq=False)
class Pairs:
    """
    Pairs to be judged: query frame, earlier reference frame, and the truth, each (k,).

    Attributes
    ----------
    query, reference : int64
        Frame indices, reference < query.
    is_loop : bool
        Same place or different places.

    """

    query: NDArray[np.int64]
    reference: NDArray[np.int64]
    is_loop: NDArray[np.bool_]


def sample_pairs(relation: NDArray[np.int8], rng: np.random.Generator, count: int,
                 time_blocks: int = 20) -> Pairs:
    """
    Draw ``count`` loops and as many pairs of different places, spread over time.

    The queries' timeline is cut into blocks that take turns, and within a block every query
    takes its turn: a place where the camera lingered does not outweigh the rest. No pair is
    drawn twice.

    Parameters
    ----------
    relation : int8, (n, n)
        From ``FrameLabels``.
    rng : numpy.random.Generator
        Source of the draw.
    count : int
        Pairs of each of the two classes.
    time_blocks : int
        Number of blocks.

    Raises
    ------
    EvaluationError
        There are fewer than ``count`` pairs of a class.

    """
    loops = _draw(relation, POSITIVE, rng, count, time_blocks)
    others = _draw(relation, NEGATIVE, rng, count, time_blocks)
    both = np.concatenate([loops, others])
    return Pairs(both[:, 0], both[:, 1], np.arange(len(both)) < len(loops))


def _draw(relation: NDArray[np.int8], value: int, rng: np.random.Generator, count: int,
          time_blocks: int) -> NDArray[np.int64]:
    pair = np.argwhere(np.tril(relation, -1) == value)
    if not 0 < count <= len(pair):
        what = 'loops' if value == POSITIVE else 'pairs of different places'
        raise EvaluationError(f'{count} pairs of each class were asked for: the sequence has '
                              f'{len(pair)} {what}; expected 1 to that many')
    pair = rng.permutation(pair)
    turn_of_query = _turns(pair[:, 0])
    block = pair[:, 0] * time_blocks // len(relation)
    order = np.argsort(turn_of_query, kind='stable')
    turn_of_block = np.empty(len(pair), np.int64)
    turn_of_block[order] = _turns(block[order])
    chosen: NDArray[np.int64] = pair[np.argsort(turn_of_block, kind='stable')[:count]]
    return chosen


def _turns(group: NDArray[np.int64]) -> NDArray[np.int64]:
    # For each element, how many of its group stand before it.
    order = np.argsort(group, kind='stable')
    first = np.searchsorted(group[order], group[order], side='left')
    turn = np.empty(len(group), np.int64)
    turn[order] = np.arange(len(group)) - first
    return turn
