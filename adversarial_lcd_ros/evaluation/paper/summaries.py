# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Cells of the paper's experiments, summarised: repeats averaged, the sequence as the unit.

A cell is one attack on one sequence with one seed. Seeds are repeats of a measurement, not
further evidence: they are averaged within the sequence. The interval of a sequence is the block
bootstrap over its frames (``intervals``): whole frames with all their repeats are drawn, in
blocks of neighbours in time. It covers the choice of frames; what other places would give is
only seen by comparing sequences (``summarise_methods``, ``ranks``).

A sequence whose graphs allow no edit is in no mean, and listed: a decline of 0 there says nothing
of an attack. Over sequences the interval is Student's t: a bootstrap of four values is too narrow.
Rows tell whether the detector was trained on the sequence, by the card beside its file.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Mapping, Sequence
from functools import partial
import math
from typing import Any

import numpy as np

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation import intervals
from adversarial_lcd_ros.evaluation.methods import COLUMNS, is_yardstick, method_of
from adversarial_lcd_ros.evaluation.paper.frame_results import (
    decline_ci95,
    different_frames,
    right_before,
)
from adversarial_lcd_ros.evaluation.store import Row

KIND, SCHEMA = 'frames', 6  # of summary.json

# What tells cells apart, beside the seed; and what tells attacks apart, over sequences.
CELL = ('sequence', 'target', 'asked_target', *COLUMNS, 'oracle', 'mode', 'ratio', 'edits',
        'queries_per_edit', 'nodes', 'threshold', 'judged', 'variant')
ATTACK = CELL[1:]
# What a row need not say.
USUAL: Mapping[str, Hashable] = {'threshold': LcdConfig.threshold, 'judged': 'frames',
                                 'variant': ''}
_MEANS = ('accuracy_clean', 'accuracy_attacked', 'balanced_clean', 'balanced_attacked',
          'decline_pp', 'suppressed', 'invented', 'invented_elsewhere', 'left_out',
          'unattackable', 'frames', 'positives', 'negatives', 'nodes_mean', 'edges_mean',
          'edits_mean', 'queries_mean', 'success_rate')

# Figures of a cell over its seeds, or of a method over sequences.
Summary = dict[str, Any]


def summarise_cells(rows: Iterable[Row]) -> list[Summary]:
    """
    Return one summary for all seeds of an attack on a sequence; the order of rows is no matter.

    Parameters
    ----------
    rows : iterable of mapping
        Cells as the recipe writes them: the names of ``CELL``, ``seed``, the figures of the run
        and ``frame_results`` (stamp, kind, clean, attacked, edits, queries of every frame).

    Returns
    -------
    list of dict
        ``CELL``; means over the seeds of the figures; and

        * ``trained_on``: the detector was trained on frames of the sequence; None if unknown
        * ``told_by``: what told the labels; empty if unknown
        * ``different_positives``, ``different_negatives``: frames of a kind, repeats once
        * ``seeds``, ``decline_sd_pp``: number of repeats, and their standard deviation
        * ``ci95``: of the decline, percentage points; None if a class of frames is empty
        * ``found_clean``, ``silent_clean``: right decisions before, by class (mean over seeds)
        * ``method``: what looks for flips, a perturbation or else a search
        * ``nodes_moved_mean``: nodes that were changed, where the rows have it
        * ``share_of_optimum``: decline over that of the yardstick on the same sequence, target,
          ratio, size of graph and threshold (the largest, if there are several); None without,
          or if the optimum takes nothing
        * ``duration_s``: of all repeats together

    Raises
    ------
    EvaluationError
        A row lacks something, or two rows are of the same cell and seed.

    """
    groups: dict[tuple[Hashable, ...], list[Row]] = defaultdict(list)
    for row in rows:
        groups[_cell_key(row)].append(row)
    cells = [_summarise(groups[key]) for key in sorted(groups, key=partial(_order, CELL))]
    best = _optima(cells)
    for cell in cells:
        optimum = best.get(_yardstick(cell))
        share = (None if cell['decline_pp'] is None or optimum is None or optimum <= 0
                 else cell['decline_pp'] / optimum)
        cell['share_of_optimum'] = share
    return cells


def summarise_methods(cells: Sequence[Summary]) -> list[Summary]:
    """
    Return one summary for each attack over its sequences, each weighing the same.

    Parameters
    ----------
    cells : sequence of dict
        From ``summarise_cells``.

    Returns
    -------
    list of dict
        ``ATTACK``; ``sequences`` (names; those that are ``is_attackable``, if any is),
        ``decline_pp`` (mean), ``ci95`` (Student's t over the sequences, cut at the possible -100
        and 100, None below two: resampling so few gives intervals that are too narrow),
        ``least_pp``, ``most_pp``,
        ``share_of_optimum`` (of the means, over the sequences that have both); means of the
        accuracies, of edits and queries; sums of the counts.

    """
    groups: dict[tuple[Hashable, ...], list[Summary]] = defaultdict(list)
    for cell in cells:
        if cell['decline_pp'] is not None:
            groups[tuple(cell[name] for name in ATTACK)].append(cell)
    best = _optima(cells)
    return [{**dict(zip(ATTACK, key, strict=True)), 'method': groups[key][0]['method'],
             **_over_sequences(list(filter(is_attackable, groups[key])) or groups[key], best)}
            for key in sorted(groups, key=partial(_order, ATTACK))]


def is_attackable(cell: Summary) -> bool:
    """
    Tell whether a cell says anything of an attack.

    It does not where a kind of frame is missing, nor where no frame's graph is large enough for
    one edit.
    """
    return cell['decline_pp'] is not None and cell['unattackable'] < cell['frames']


def declines_by_sequence(cells: Iterable[Summary],
                         name: Mapping[tuple[Hashable, ...], str]) -> dict[str, dict[str, float]]:
    """
    Return method to sequence to decline of the attacks that have a name, for ``rank_methods``.

    Sequences that not every method has are left out: ranks need complete rows.

    """
    table: dict[str, dict[str, float]] = {title: {} for title in name.values()}
    for cell in cells:
        title = name.get(tuple(cell[factor] for factor in ATTACK))
        if title is not None and is_attackable(cell):
            table[title][cell['sequence']] = cell['decline_pp']
    common = set.intersection(*map(set, table.values())) if table else set()
    return {title: {sequence: declines[sequence] for sequence in sorted(common)}
            for title, declines in table.items()}


def _cell_key(row: Row) -> tuple[Hashable, ...]:
    missing = [name for name in (*CELL, *_MEANS, 'seed', 'frame_results', 'duration_s')
               if name not in row and name not in ('asked_target', *USUAL)]
    if missing:
        raise EvaluationError(f'a row of {row.get("sequence", "an unnamed sequence")} lacks '
                              f'{", ".join(missing)}: it was not written by this release')
    # Without another target the attack asked the one that it attacks.
    given = {**USUAL, **row, 'asked_target': row.get('asked_target') or row['target']}
    return tuple(given[name] for name in CELL)


def _order(names: Sequence[str], key: tuple[Hashable, ...]) -> tuple[tuple[bool, Any], ...]:
    # Numbers as numbers, names as names; searches among perturbations.
    row = dict(zip(names, key, strict=True))
    parts = [method_of(row) if name == 'perturbation' else row[name] for name in names
             if name != 'search']
    return tuple((isinstance(part, str), part) for part in parts)


def _summarise(rows: Sequence[Row]) -> Summary:
    rows = sorted(rows, key=lambda row: row['seed'])
    seeds = [row['seed'] for row in rows]
    cell = dict(zip(CELL, _cell_key(rows[0]), strict=True))
    cell['method'] = method_of(cell)
    moved = [row['nodes_moved_mean'] for row in rows if 'nodes_moved_mean' in row]
    if moved:
        cell['nodes_moved_mean'] = _mean(moved)
    if len(set(seeds)) < len(seeds):
        raise EvaluationError(f'two rows of {cell} with one seed among {seeds}: keep one of '
                              'each, or the repeats would be counted twice')
    declines = [row['decline_pp'] for row in rows if row['decline_pp'] is not None]
    positive, negative = right_before(rows)
    cell.update({name: _mean(row[name] for row in rows) for name in _MEANS})
    cell.update(name=rows[0].get('name') or '', seeds=len(seeds),
                trained_on=rows[0].get('trained_on'), told_by=rows[0].get('told_by') or '',
                **different_frames(rows),
                decline_sd_pp=float(np.std(declines, ddof=1)) if len(declines) > 1 else None,
                ci95=decline_ci95(rows), found_clean=positive, silent_clean=negative,
                duration_s=math.fsum(row['duration_s'] for row in rows))
    return cell


def _mean(values: Iterable[float | None]) -> float | None:
    there = [value for value in values if value is not None]
    return math.fsum(there) / len(there) if there else None  # fsum: any order, same sum


def _yardstick(cell: Summary) -> tuple[Hashable, ...]:
    return tuple(cell[name] for name in ('sequence', 'target', 'ratio', 'nodes', 'threshold',
                                         'judged'))


def _optima(cells: Iterable[Summary]) -> dict[tuple[Hashable, ...], float]:
    best: dict[tuple[Hashable, ...], float] = {}
    for cell in cells:
        if is_yardstick(cell) and cell['decline_pp'] is not None:
            key = _yardstick(cell)
            best[key] = max(best.get(key, -math.inf), cell['decline_pp'])
    return best


def _over_sequences(cells: Sequence[Summary], best: Mapping[tuple[Hashable, ...], float]
                    ) -> Summary:
    declines = np.array([cell['decline_pp'] for cell in cells])
    ci95 = intervals.mean_interval(declines)
    both = [(cell['decline_pp'], best[_yardstick(cell)]) for cell in cells
            if _yardstick(cell) in best]
    moved = [cell['nodes_moved_mean'] for cell in cells if 'nodes_moved_mean' in cell]
    taken, possible = (math.fsum(column) for column in zip(*both, strict=True)) if both else (0, 0)
    return {
        'sequences': [cell['sequence'] for cell in cells], 'decline_pp': float(declines.mean()),
        'ci95': None if ci95 is None else (max(ci95[0], -100.0), min(ci95[1], 100.0)),
        'least_pp': float(declines.min()), 'most_pp': float(declines.max()),
        'seeds': min(cell['seeds'] for cell in cells),
        'share_of_optimum': taken / possible if possible > 0 else None,
        **({'nodes_moved_mean': _mean(moved)} if moved else {}),
        **{name: _mean(cell[name] for cell in cells)
           for name in ('accuracy_clean', 'accuracy_attacked', 'balanced_clean',
                        'balanced_attacked', 'edits_mean', 'queries_mean', 'nodes_mean',
                        'success_rate')},
        **{name: math.fsum(cell[name] for cell in cells)
           for name in ('suppressed', 'invented', 'invented_elsewhere', 'left_out',
                        'unattackable', 'frames', 'found_clean', 'silent_clean')}}
