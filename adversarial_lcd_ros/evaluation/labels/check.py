# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Labels by the audit alone, held against exact co-visibility."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from adversarial_lcd_ros.config import LabelConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.ground_truth.covisibility import find_covisibility, read_covisibility
from adversarial_lcd_ros.ground_truth.labelling import Views, label_views
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE
from adversarial_lcd_ros.sequences.sequence import Progress


def check_labels(views: Views, config: LabelConfig,
                 progress: Progress | None = None) -> dict[str, Any]:
    """
    Return how labels by the audit, or by another rule, agree with exact co-visibility.

    Parameters
    ----------
    views : Views
        Of a sequence with a covisibility.npz.
    config : LabelConfig
        Rule auto counts as audit: the co-visibility is hidden from it.
    progress : callable, optional
        Called with frames done and to do.

    Returns
    -------
    dict
        ``new_places`` labelled and the share of them that is exactly new (``elsewhere_share`` of
        their surface, or more, is in no old enough view); ``exactly_new`` frames and the share
        of them that is labelled so; ``loops`` and the share whose views share ``shared_share``
        both ways; ``right_pairs`` and the share of them that share less than
        ``elsewhere_share``, and ``wrong_pairs`` and the share of them that share more.

    Raises
    ------
    EvaluationError
        There is no covisibility.npz.

    """
    path = find_covisibility(views.source)
    if path is None:
        raise EvaluationError(f'{views.source} has no covisibility.npz to hold labels against')
    share = read_covisibility(path).shares(views.stamp_ns)
    rule = 'audit' if config.rule == 'auto' else config.rule
    labels = label_views(views, replace(config, rule=rule), progress).labels
    old = np.arange(len(share))[None, :] < labels.candidates[:, None]
    less, more = np.minimum(share, share.T), np.maximum(share, share.T)
    exactly_new = old.any(axis=1) & ((share < config.elsewhere_share) | ~old).all(axis=1)
    new = labels.kind == NEGATIVE
    loop, right = (labels.relation == POSITIVE) & old, labels.possible & old
    wrong = labels.elsewhere & old
    return {
        'rule': rule, 'new_places': int(new.sum()),
        'new_places_exactly_new': _share(exactly_new, new),
        'exactly_new': int(exactly_new.sum()), 'exactly_new_scored': _share(new, exactly_new),
        'loops': int(loop.sum()), 'loops_sharing': _share(less >= config.shared_share, loop),
        'right_pairs': int(right.sum()),
        'right_pairs_elsewhere': _share(more < config.elsewhere_share, right),
        'wrong_pairs': int(wrong.sum()),
        'wrong_pairs_sharing': _share(more >= config.elsewhere_share, wrong)}


def _share(part: ArrayLike, whole: ArrayLike) -> float | None:
    chosen = np.asarray(part)[np.asarray(whole)]
    return float(chosen.mean()) if len(chosen) else None
