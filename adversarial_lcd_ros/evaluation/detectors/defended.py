# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What defences cost a detector that nobody attacks: live rows beside those without them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adversarial_lcd_ros.evaluation import intervals, wording
from adversarial_lcd_ros.evaluation.markdown import table
from adversarial_lcd_ros.evaluation.outcomes import Outcomes, right, told_kind
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE
from adversarial_lcd_ros.registry import NONE

_HEAD = ('sequence', 'target', 'defence', 'loops / new places', 'balanced accuracy',
         'points lost', 'precision', 'recall', 'true loops kept', 'of those past the same alone')


def settings_of(row: Row) -> tuple[str, bool, str]:
    """Return what tells rows of a target on a sequence and by a protocol apart."""
    return row.get('defences', NONE), row['geometric_check'], row.get('changed', '')


def defended_table(rows: Sequence[Row]) -> list[str]:
    """
    Return a table of the live rows that have others of the same target beside them, or nothing.

    Points lost are less than those of the first row without a defence, paired by frame. Kept are
    true loops of that row; where another row has the same defences and fewer settings, as
    ``geometric_check`` before ``geometric_hull``, the share of its true loops that are left
    stands behind. Intervals: 95 %, over blocks of frames.
    """
    groups: dict[tuple[str, int, str], list[Row]] = {}
    for row in rows:
        if row['protocol'] == 'live':
            groups.setdefault((row['sequence'], row['nodes'], row['target']), []).append(row)
    lines = [_cells(row, group) for group in groups.values() if len(group) > 1 for row in group]
    if not lines:
        return []
    return ['\n'.join(table(_HEAD, lines))]


def _cells(row: Row, group: Sequence[Row]) -> list[str]:
    bare = next((other for other in group if other['defences'] == NONE
                 and not other['geometric_check']), group[0])
    alike = next(other for other in group if other['defences'] == row['defences'])
    common = bare['changed'].split(', ')
    name = [row['defences'], *(part for part in row['changed'].split(', ')
                               if part and part not in common)]
    return [row['sequence'], f'`{row["target"]}`', ', '.join(name),
            f'{row["positives"]} / {row["negatives"]}', _with_interval(
                wording.percent(row['balanced_accuracy']), wording.interval(row['ci95'], 100.0)),
            _lost(row, bare) if row is not bare else '',
            wording.percent(row['precision']), wording.percent(row['recall']),
            _kept(row, bare), _kept(row, alike) if alike not in (row, bare) else '']


def _with_interval(value: str, interval: str) -> str:
    return f'{value} ({interval})' if interval else value


def _lost(row: Row, bare: Row) -> str:
    """Return how much less balanced accuracy a row has than another, and the paired interval."""
    if row['balanced_accuracy'] is None or bare['balanced_accuracy'] is None:
        return wording.UNDEFINED
    before, after = _outcomes(bare), _outcomes(row)
    kind = np.select([np.isin(before, ('TP', 'FN', 'WM')), np.isin(before, ('FP', 'TN'))],
                     [POSITIVE, NEGATIVE], 0).astype(np.int8)
    interval = intervals.decline_interval(told_kind(kind, before, after), right(before),
                                          right(after), row['block'], seed=0)
    lost = 100 * (bare['balanced_accuracy'] - row['balanced_accuracy'])
    return _with_interval(wording.points(lost), wording.interval(interval))


def _kept(row: Row, other: Row) -> str:
    found = _outcomes(other) == 'TP'
    kept = int((found & (_outcomes(row) == 'TP')).sum())
    if not found.any():
        return wording.UNDEFINED
    return f'{kept} of {found.sum()} ({wording.percent(kept / found.sum())})'


def _outcomes(row: Row) -> Outcomes:
    return np.array(row['outcomes'].split(','))
