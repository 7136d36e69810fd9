# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Attacks by sequence as Markdown tables, one for each target: for a README."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.markdown import table, table_line, table_of
from adversarial_lcd_ros.evaluation.methods import is_yardstick
from adversarial_lcd_ros.evaluation.paper.summaries import (
    ATTACK,
    Summary,
    is_attackable,
)
from adversarial_lcd_ros.evaluation.paper.titles import full_title, usual_by_target, usual_title
from adversarial_lcd_ros.registry import TARGETS

_NONE = '-'


def markdown_tables(cells: Sequence[Summary], methods: Sequence[Summary], ratio: float) -> str:
    """
    Return the declines at a perturbation ratio.

    Parameters
    ----------
    cells, methods : sequence of dict
        From ``summarise_cells`` and ``summarise_methods``.
    ratio : float
        r.

    """
    cells = [cell for cell in cells if cell['ratio'] == ratio]
    usual = usual_by_target(cells)
    there = {cell['target'] for cell in cells}
    targets = [name for name in TARGETS if name in there]
    return '\n'.join([
        f'Decline in balanced accuracy, points, with 95 % intervals over blocks of time; r = '
        f'{ratio:g}.\n',
        *(_target(target, [cell for cell in cells if cell['target'] == target],
                  [method for method in methods
                   if method['target'] == target and method['ratio'] == ratio], usual[target])
          for target in targets),
        *_one_sided(one_sided_rows(cells, usual))])


def one_sided_rows(cells: Sequence[Summary], usual: Mapping[str, Summary]
                   ) -> list[dict[str, str]]:
    """Return what attacks did where loops, or new places, are missing: heading to cell."""
    return [{'sequence': cell['sequence'],
             'target and attack': f'{cell["target"]}: {full_title(cell, usual[cell["target"]])}',
             'suppressed': _of(cell['suppressed'], cell['found_clean']),
             'invented': _of(cell['invented'], cell['silent_clean']),
             'certainly elsewhere': wording.mean_count(cell['invented_elsewhere'])}
            for cell in cells if cell['decline_pp'] is None]


def _of(part: float, whole: float) -> str:
    return f'{wording.mean_count(part)} of {wording.mean_count(whole)}' if whole else _NONE


def _one_sided(rows: Sequence[dict[str, str]]) -> list[str]:
    if not rows:
        return []
    return ['Sequences without loops or without new places have no decline; what attacks did '
            'there (means over the seeds):\n', *table_of(rows), '']


def _target(target: str, cells: Sequence[Summary], methods: Sequence[Summary], usual: Summary
            ) -> str:
    every = sorted({cell['sequence'] for cell in cells})
    sequences = sorted({cell['sequence'] for cell in cells if is_attackable(cell)}) or every
    before = {cell['sequence']: cell['balanced_clean'] for cell in cells
              if all(cell[name] == usual[name] for name in ('nodes', 'threshold', 'judged'))}
    at = {(*(cell[name] for name in ATTACK), cell['sequence']): cell for cell in cells}
    head = [f'`{target}`', 'frames', 'edits', 'queries', *sequences, 'mean', 'of the optimum']
    lines = [f'Unless said otherwise: {usual_title(usual)}.\n',
             *table(head, [['before', '', '', '', *(wording.percent(before.get(name))
                                                    for name in sequences), '', '']])]
    for method in sorted(methods, key=lambda method: (
            is_yardstick(method), -method['decline_pp'])):
        key = tuple(method[name] for name in ATTACK)
        entries = [at.get((*key, name)) for name in sequences]
        share = method['share_of_optimum']
        lines.append(table_line([
            full_title(method, usual), _sample(entries), _count(method['edits_mean']),
            _count(method['queries_mean']), *map(_decline, entries),
            f'**{wording.points(method["decline_pp"])}**',
            _NONE if share is None else wording.percent(share, 0)]))
    left_out = ', '.join(name for name in every if name not in sequences)
    if left_out:
        lines += ['', f'Without a figure, or without a graph that allows an edit: {left_out}.']
    return '\n'.join(lines) + '\n'


def _sample(entries: Sequence[Summary | None]) -> str:
    """Return how many frames of a sequence have been attacked: repeats included, and once each."""
    there = [cell for cell in entries if cell]
    every = [round(cell['frames'] * cell['seeds']) for cell in there]
    different = [cell['different_positives'] + cell['different_negatives'] for cell in there]
    return (_range(every) if every == different
            else f'{_range(every)} ({_range(different)} different)')


def _range(counts: Sequence[int]) -> str:
    return ' to '.join(f'{count}' for count in dict.fromkeys([min(counts), max(counts)]))


def _count(value: float | None) -> str:
    return _NONE if value is None else f'{value:,.0f}'


def _decline(cell: Summary | None) -> str:
    if cell is None or not is_attackable(cell):
        return _NONE
    bounds = cell['ci95']
    interval = f' ({wording.interval(bounds)})' if bounds else ''
    return f'{wording.points(cell["decline_pp"])}{interval}'
