# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.intervals import (
    balanced_accuracy_interval,
    block_frames,
    decline_interval,
)


def test_block_length_follows_the_frame_rate():
    stamps = (np.arange(300) / 30 * 1e9).astype(np.int64)
    assert block_frames(stamps, 2.0) == 60
    assert block_frames(stamps, 0.0) == 1
    assert block_frames(stamps[:10], 2.0) == 10
    with pytest.raises(EvaluationError, match='at least 2'):
        block_frames(stamps[:1])


def test_interval_covers_the_truth_as_often_as_it_says():
    # Independent frames, blocks of one: 95 % intervals should cover in about 95 of 100 runs.
    rng = np.random.default_rng(0)
    hits = 0
    for seed in range(100):
        kind = rng.choice([1, -1], 200).astype(np.int8)
        right = rng.random(200) < np.where(kind > 0, 0.8, 0.6)
        low, high = balanced_accuracy_interval(kind, right, 1, seed, replicates=500)
        hits += low <= 0.7 <= high
    assert 88 <= hits <= 100


def test_blocks_widen_the_interval_of_correlated_frames():
    rng = np.random.default_rng(0)
    kind = np.tile(np.repeat([1, -1], 20), 10).astype(np.int8)
    right = np.repeat(rng.random(20) < 0.7, 20)  # right or wrong for 20 frames on end
    width = [np.ptp(balanced_accuracy_interval(kind, right, block, 0)) for block in (1, 20)]
    assert width[1] > 2 * width[0]


def test_runs_are_compared_on_the_same_frames():
    # A constant difference has no spread, however noisy the two runs are.
    rng = np.random.default_rng(0)
    kind = np.r_[np.full(100, 1), np.full(100, -1)].astype(np.int8)
    right = rng.random(200) < 0.5
    assert decline_interval(kind, right, right, 10, 0) == (0.0, 0.0)
    nothing, everything = np.zeros(200, bool), np.ones(200, bool)
    assert decline_interval(kind, everything, nothing, 10, 0) == (100.0, 100.0)


def test_interval_contains_the_estimate_and_repeats_for_a_seed():
    rng = np.random.default_rng(1)
    kind = rng.choice([1, -1, 0], 300).astype(np.int8)
    before, after = rng.random(300) < 0.9, rng.random(300) < 0.6
    first = decline_interval(kind, before, after, 10, 7)
    lost = before.astype(int) - after
    estimate = 50 * (lost[kind > 0].mean() + lost[kind < 0].mean())
    assert first[0] < estimate < first[1]
    assert first == decline_interval(kind, before, after, 10, 7)
    assert first != decline_interval(kind, before, after, 10, 8)


def test_empty_class_and_bad_blocks():
    kind = np.ones(5, np.int8)
    assert balanced_accuracy_interval(kind, kind > 0, 1, 0) is None
    with pytest.raises(EvaluationError, match='blocks of 6 frames in 5'):
        balanced_accuracy_interval(kind, kind > 0, 6, 0)
