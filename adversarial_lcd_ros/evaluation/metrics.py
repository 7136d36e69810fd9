# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Figures of a detector, and of what an attack took from it.

The figure of a decline is balanced accuracy. The paper quotes accuracy on balanced pairs; in a
replay the classes are what they are (240 loops to 61 new places on flat_tour).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import matthews_corrcoef, precision_recall_curve

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.outcomes import (
    UNTOLD_MATCH,
    Outcomes,
    check_lengths,
    outcomes,
    right,
    told_kind,
)
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE


@dataclass(frozen=True, eq=False)
class Curve:
    """Precision and recall at every threshold (descending recall), each (k,)."""

    threshold: NDArray[np.float64]
    precision: NDArray[np.float64]
    recall: NDArray[np.float64]


@dataclass(frozen=True)
class Metrics:
    """
    Figures of one run over the scored frames. None: not defined, a class is empty.

    Attributes
    ----------
    positives, negatives : int
        Frames with and without a loop to be found.
    tp, fn, fp, tn : int
        Outcomes; fn includes wrong matches.
    wrong_matches : int
        Loops that were declared with another place.
    untold_matches : int
        Frames left out of all figures below: declared with a match that cannot be told.
    accuracy : float or None
        (tp + tn) / (tp + fn + fp + tn); None without scored frames.
    balanced_accuracy : float or None
        Mean of recall and specificity; None if a class is empty.
    precision : float or None
        tp / (tp + fp + wrong_matches); None if nothing was declared.
    recall, specificity : float or None
        tp / (tp + fn), tn / (tn + fp); None without such frames.
    recall_at_100_precision : float or None
        Largest recall of a threshold at which no declaration is wrong; 0 if there is none.
    average_precision : float or None
        Area under the precision-recall curve as a sum of steps; None without positives.
    mcc : float or None
        Matthews correlation coefficient, 0 if all decisions are alike; None if a class is empty.

    """

    positives: int
    negatives: int
    tp: int
    fn: int
    fp: int
    tn: int
    wrong_matches: int
    untold_matches: int
    accuracy: float | None
    balanced_accuracy: float | None
    precision: float | None
    recall: float | None
    specificity: float | None
    recall_at_100_precision: float | None
    average_precision: float | None
    mcc: float | None


@dataclass(frozen=True)
class Effect:
    """
    What changed from one run to another over the same frames.

    Attributes
    ----------
    suppressed : int
        Loops found before and not after (TP to FN or WM).
    diverted : int
        Those of them that are now declared with another place (TP to WM).
    invented : int
        Loops declared after where there is none (TN to FP).
    regained, withdrawn : int
        The opposite of suppressed and of invented: what the attack repaired by accident.
    left_out : int
        Frames in no other figure here: of their match before, or after, nobody can say whether it
        is right.
    accuracy_decline_pp, decline_pp : float or None
        Accuracy and balanced accuracy before minus after, percentage points; positive: lost.

    """

    suppressed: int
    diverted: int
    invented: int
    regained: int
    withdrawn: int
    left_out: int
    accuracy_decline_pp: float | None
    decline_pp: float | None


def measure(kind: NDArray[np.int8], is_loop: NDArray[np.bool_],
            probability: NDArray[np.float64], match_correct: NDArray[np.bool_],
            match_told: NDArray[np.bool_] | None = None) -> Metrics:
    """
    Return the figures of one run; never fails on an empty class.

    Parameters
    ----------
    kind, is_loop, match_correct, match_told : (n,)
        As in ``outcomes``.
    probability : float64, (n,)
        The detector's, 0 to 1: orders the decisions for the precision-recall curve.

    Raises
    ------
    EvaluationError
        Lengths differ, or a probability is not within 0 to 1.

    """
    check_lengths(kind=kind, probability=probability)
    if not np.all((probability >= 0) & (probability <= 1)):
        raise EvaluationError('a probability is not within 0 to 1: the detector is broken')
    told = np.ones(len(kind), bool) if match_told is None else np.asarray(match_told, bool)
    outcome = outcomes(kind, is_loop, match_correct, told)
    count = {name: int((outcome == name).sum()) for name in ('TP', 'WM', 'FN', 'FP', 'TN')}
    declared = count['TP'] + count['WM'] + count['FP']
    positives = count['TP'] + count['WM'] + count['FN']
    negatives = count['TN'] + count['FP']
    recall, specificity = _ratio(count['TP'], positives), _ratio(count['TN'], negatives)
    both = recall is not None and specificity is not None
    curve = precision_recall(kind, probability, match_correct, told)
    return Metrics(
        positives=int((kind == POSITIVE).sum()), negatives=int((kind == NEGATIVE).sum()),
        tp=count['TP'], fn=count['FN'] + count['WM'],
        fp=count['FP'], tn=count['TN'], wrong_matches=count['WM'],
        untold_matches=int((outcome == UNTOLD_MATCH).sum()),
        accuracy=_ratio(count['TP'] + count['TN'], positives + negatives),
        balanced_accuracy=balanced_accuracy(kind, outcome),
        precision=_ratio(count['TP'], declared), recall=recall, specificity=specificity,
        recall_at_100_precision=_recall_at_100_precision(curve),
        average_precision=_average_precision(curve),
        mcc=_mcc(kind, outcome) if both else None)


def precision_recall(kind: NDArray[np.int8], probability: NDArray[np.float64],
                     match_correct: NDArray[np.bool_],
                     match_told: NDArray[np.bool_]) -> Curve | None:
    """
    Return precision over recall of one run; None without positives.

    Parameters
    ----------
    kind, probability, match_correct, match_told : (n,)
        As in ``measure``.

    """
    # A frame with a wrong match can be no true positive at any threshold: to sklearn it is a
    # negative. Recall is then of the loops that were matched, and is scaled to all loops but
    # those that are declared with a match that cannot be told.
    scored, is_loop = kind != 0, kind == POSITIVE
    if not is_loop.any():
        return None
    known = scored & match_told
    found = (is_loop & match_correct)[known]
    if not found.any():  # sklearn warns and answers recall 1
        threshold = np.unique(probability[scored])
        return Curve(threshold, np.zeros(len(threshold)), np.zeros(len(threshold)))
    precision, recall, threshold = precision_recall_curve(found, probability[known])
    untold = np.sort(probability[is_loop & ~match_told])
    declared = len(untold) - np.searchsorted(untold, threshold)
    # sklearn's last point, (1, 0), stands for a threshold at which nothing is declared.
    return Curve(threshold, precision[:-1],
                 recall[:-1] * found.sum() / (is_loop.sum() - declared))


def balanced_accuracy(kind: NDArray[np.int8], outcome: Outcomes) -> float | None:
    """Return the mean of the shares of right decisions of both kinds; None if one is empty."""
    correct, kind = right(outcome), told_kind(kind, outcome)
    rates = [_ratio(int(correct[kind == value].sum()), int((kind == value).sum()))
             for value in (POSITIVE, NEGATIVE)]
    known = [rate for rate in rates if rate is not None]
    return sum(known) / 2 if len(known) == 2 else None


def effect(kind: NDArray[np.int8], before: Outcomes, after: Outcomes) -> Effect:
    """
    Return what changed between two runs over the same frames.

    Parameters
    ----------
    kind : int8, (n,)
        As in ``outcomes``.
    before, after : str, (n,)
        ``outcomes`` of the two runs.

    """
    check_lengths(kind=kind, before=before, after=after)
    told = told_kind(kind, before, after)
    left_out, kind = int((told != kind).sum()), told
    lost = np.where(right(before), 1, 0) - np.where(right(after), 1, 0)
    by_class = [lost[kind == value] for value in (POSITIVE, NEGATIVE)]
    scored = np.concatenate(by_class)
    return Effect(
        suppressed=int(((kind == POSITIVE) & (before == 'TP') & (after != 'TP')).sum()),
        diverted=int(((before == 'TP') & (after == 'WM')).sum()),
        invented=int(((before == 'TN') & (after == 'FP')).sum()),
        regained=int(((kind == POSITIVE) & (before != 'TP') & (after == 'TP')).sum()),
        withdrawn=int(((before == 'FP') & (after == 'TN')).sum()), left_out=left_out,
        accuracy_decline_pp=100.0 * float(scored.mean()) if len(scored) else None,
        decline_pp=(50.0 * float(by_class[0].mean() + by_class[1].mean())
                    if all(map(len, by_class)) else None))


def first_closure_latency_s(stamp_ns: NDArray[np.int64], kind: NDArray[np.int8],
                            outcome: Outcomes) -> float | None:
    """Return seconds from the first loop to the first found one; None if none was found."""
    loops, found = np.flatnonzero(kind == POSITIVE), np.flatnonzero(outcome == 'TP')
    if not len(found):
        return None
    return float(stamp_ns[found[0]] - stamp_ns[loops[0]]) * 1e-9


def _ratio(part: int, whole: int) -> float | None:
    return part / whole if whole else None


def _recall_at_100_precision(curve: Curve | None) -> float | None:
    if curve is None:
        return None
    return float(curve.recall[curve.precision == 1.0].max(initial=0.0))


def _average_precision(curve: Curve | None) -> float | None:
    if curve is None:
        return None
    return float(-(np.diff(curve.recall, append=0.0) * curve.precision).sum())


def _mcc(kind: NDArray[np.int8], outcome: Outcomes) -> float:
    scored = told_kind(kind, outcome) != 0
    return float(matthews_corrcoef(kind[scored] == POSITIVE,
                                   np.isin(outcome[scored], ('TP', 'FP'))))
