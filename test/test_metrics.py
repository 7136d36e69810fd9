# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from sklearn.metrics import average_precision_score, balanced_accuracy_score, matthews_corrcoef

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.metrics import (
    effect,
    first_closure_latency_s,
    measure,
    precision_recall,
)
from adversarial_lcd_ros.evaluation.outcomes import outcomes, right

FRAMES = st.lists(st.tuples(st.sampled_from([1, -1, 0]), st.integers(0, 10), st.booleans()),
                  min_size=0, max_size=60)


def arrays(frames, threshold=0.5):
    kind = np.array([frame[0] for frame in frames], np.int8)
    probability = np.array([frame[1] / 10 for frame in frames], float)
    correct = np.array([frame[2] for frame in frames], bool)
    return kind, probability >= threshold, probability, correct


def test_every_outcome():
    kind = np.array([1, 1, 1, -1, -1, 0], np.int8)
    is_loop = np.array([1, 1, 0, 1, 0, 1], bool)
    correct = np.array([1, 0, 1, 0, 0, 0], bool)
    assert outcomes(kind, is_loop, correct).tolist() == ['TP', 'WM', 'FN', 'FP', 'TN', '']
    found = measure(kind, is_loop, is_loop.astype(float), correct)
    assert (found.tp, found.fn, found.fp, found.tn, found.wrong_matches) == (1, 2, 1, 1, 1)
    assert found.precision == pytest.approx(1 / 3)  # a wrong match is a false alarm too
    assert found.recall == pytest.approx(1 / 3)
    assert found.specificity == 0.5
    assert found.accuracy == pytest.approx(2 / 5)
    assert found.balanced_accuracy == pytest.approx((1 / 3 + 1 / 2) / 2)


@given(FRAMES)
@settings(max_examples=100, deadline=None)
def test_figures_agree_with_a_plain_count(frames):
    kind, is_loop, probability, correct = arrays(frames)
    found = measure(kind, is_loop, probability, correct)
    assert found.tp + found.fn == found.positives
    assert found.fp + found.tn == found.negatives
    if found.positives and found.negatives:
        scored = kind != 0
        said = (is_loop & (correct | (kind < 0)))[scored]
        truth = kind[scored] > 0
        assert found.balanced_accuracy == pytest.approx(balanced_accuracy_score(truth, said))
        assert found.mcc == pytest.approx(matthews_corrcoef(truth, said))
    else:
        assert found.balanced_accuracy is None
        assert found.mcc is None
    best = 0.0
    for threshold in set(probability.tolist()):
        said = (probability >= threshold) & (kind != 0)
        hits = said & (kind > 0) & correct
        if said.any() and hits.sum() == said.sum():
            best = max(best, hits.sum() / found.positives)
    assert found.recall_at_100_precision == (pytest.approx(best) if found.positives else None)


def test_average_precision_is_sklearns_when_all_matches_are_right():
    rng = np.random.default_rng(0)
    kind = rng.choice([1, -1], 200).astype(np.int8)
    probability = np.clip(rng.normal(0.5 + 0.1 * kind, 0.2), 0, 1)
    found = measure(kind, probability >= 0.5, probability, np.ones(200, bool))
    assert found.average_precision == pytest.approx(average_precision_score(kind > 0, probability))
    # Half of the loops matched wrongly cannot be found at any threshold.
    wrong = np.ones(200, bool)
    wrong[np.flatnonzero(kind > 0)[::2]] = False
    curve = precision_recall(kind, probability, wrong, np.ones(200, bool))
    assert curve.recall.max() == pytest.approx(np.mean(wrong[kind > 0]))


def test_nothing_matched_and_nothing_at_all():
    kind, probability = np.array([1, -1], np.int8), np.array([0.9, 0.1])
    found = measure(kind, probability > 0.5, probability, np.zeros(2, bool))
    assert (found.average_precision, found.recall_at_100_precision, found.recall) == (0, 0, 0)
    empty = measure(np.zeros(0, np.int8), np.zeros(0, bool), np.zeros(0), np.zeros(0, bool))
    assert empty.accuracy is None
    assert empty.average_precision is None
    assert empty.precision is None


def test_broken_input_is_named():
    kind = np.array([1], np.int8)
    with pytest.raises(EvaluationError, match='probability'):
        measure(kind, np.ones(1, bool), np.array([np.nan]), np.ones(1, bool))
    with pytest.raises(EvaluationError, match='kind 1, is_loop 2'):
        outcomes(kind, np.ones(2, bool), np.ones(1, bool))


def test_effect_counts_both_ways():
    kind = np.array([1, 1, 1, 1, -1, -1, -1, 0], np.int8)
    before = np.array(['TP', 'TP', 'FN', 'TP', 'TN', 'TN', 'FP', ''])
    after = np.array(['FN', 'WM', 'TP', 'TP', 'FP', 'TN', 'TN', ''])
    found = effect(kind, before, after)
    assert (found.suppressed, found.diverted, found.invented) == (2, 1, 1)
    assert (found.regained, found.withdrawn) == (1, 1)
    assert found.decline_pp == pytest.approx(50 * (1 / 4 + 0))
    assert found.accuracy_decline_pp == pytest.approx(100 / 7)


@given(FRAMES, st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_decline_is_the_difference_of_the_two_runs(frames, seed):
    rng = np.random.default_rng(seed)
    kind, is_loop, probability, correct = arrays(frames)
    later = rng.random(len(kind))
    before = measure(kind, is_loop, probability, correct)
    after = measure(kind, later >= 0.5, later, correct)
    change = effect(kind, outcomes(kind, is_loop, correct), outcomes(kind, later >= 0.5, correct))
    if before.balanced_accuracy is None:
        assert change.decline_pp is None
    else:
        assert change.decline_pp == pytest.approx(
            100 * (before.balanced_accuracy - after.balanced_accuracy), abs=1e-9)


def test_latency_to_the_first_closure():
    stamp, kind = np.arange(4) * 10**9, np.array([-1, 1, 1, 1], np.int8)
    assert first_closure_latency_s(stamp, kind, np.array(['TN', 'FN', 'WM', 'TP'])) == 2
    assert first_closure_latency_s(stamp, kind, np.array(['TN', 'FN', 'WM', 'FN'])) is None


def test_a_match_of_which_nobody_knows_takes_its_frame_out():
    kind = np.array([1, 1, 1, -1], np.int8)
    is_loop, correct = np.array([1, 1, 0, 0], bool), np.array([1, 0, 0, 0], bool)
    told = np.array([1, 0, 0, 1], bool)
    probability = np.array([.9, .8, .3, .1])
    assert outcomes(kind, is_loop, correct, told).tolist() == ['TP', 'UM', 'FN', 'TN']
    found = measure(kind, is_loop, probability, correct, told)
    assert (found.positives, found.tp, found.fn, found.untold_matches) == (3, 1, 1, 1)
    assert (found.precision, found.recall, found.wrong_matches) == (1, 0.5, 0)
    # At the lowest threshold one loop is found, and of two others nobody knows.
    curve = precision_recall(kind, probability, correct, told)
    assert curve.recall.tolist() == [1.0, pytest.approx(1 / 3)]
    before, after = np.array(['TP', 'TP', 'TN']), np.array(['FN', 'UM', 'TN'])
    change = effect(np.array([1, 1, -1], np.int8), before, after)
    assert (change.suppressed, change.diverted, change.left_out) == (1, 0, 1)
    assert change.decline_pp == 50


def test_right_outcomes():
    assert right(np.array(['TP', 'TN', 'FN', 'WM', 'FP', ''])).tolist() == [True] * 2 + [False] * 4
