# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figures of the targets as tables in Markdown, for pages and for people."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby

from adversarial_lcd_ros.evaluation.detectors.defended import defended_table, settings_of
from adversarial_lcd_ros.evaluation.markdown import table, table_line
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.registry import NONE, TARGETS

TABLES = 'target.md'
_HEADS = {'pairs': ('pairs', 'balanced accuracy', '95 % interval', 'average precision',
                    'recall at 100 % precision', 'MCC'),
          'live': ('loops / new places', 'balanced accuracy', '95 % interval', 'precision',
                   'recall', 'recall at 100 % precision', 'average precision', 'MCC',
                   'wrong matches', 'certainly elsewhere', 'cannot be told',
                   'first loop found after')}


def target_tables(rows: Iterable[Row]) -> str:
    """Return a table for each protocol, in the order of sequences, sizes and targets."""
    rows = list(rows)
    order = {name: place for place, name in enumerate(TARGETS)}
    own = len(order)
    parts = []
    for protocol, head in _HEADS.items():
        chosen = [row for row in rows if row['protocol'] == protocol]
        if not chosen:
            continue
        names = list(dict.fromkeys(row['sequence'] for row in chosen))
        settings = list(dict.fromkeys(map(settings_of, chosen)))
        chosen.sort(key=lambda row: (names.index(row['sequence']), row['nodes'],
                                     settings.index(settings_of(row)),
                                     order.get(row['target'], own), row['target']))
        lines = table(('sequence', 'n', 'target', *head), ())
        for _, group in groupby(chosen, key=lambda row: (row['sequence'], row['nodes'],
                                                         settings_of(row))):
            lines += _group_lines(list(group))
        parts.append('\n'.join(lines))
    parts += defended_table(rows)
    return '\n\n'.join(parts) + '\n'


def _group_lines(group: Sequence[Row]) -> list[str]:
    lines = []
    for place, row in enumerate(group):
        name = row['sequence']
        if row['scored'] != [0, 1]:
            name += f', scored from {row["scored"][0]:g} to {row["scored"][1]:g}'
        if row['geometric_check']:
            name += ', geometric check'
        if row.get('defences', NONE) != NONE:
            name += f', {row["defences"]}'
        if row.get('changed'):
            name += f', {row["changed"]}'
        if row.get('told_by'):
            own = f' ({row["labels_changed"]})' if row.get('labels_changed') else ''
            name += f'; labels by {row["told_by"]}{own}'
        if row['trained_on']:
            name += ' (seen in training)'
        elif row['references_trained_on']:
            name += ' (references seen in training)'
        first = (name, f'{row["nodes_mean"]:.0f}') if not place else ('', '')
        lines.append(table_line((*first, f'`{row["target"]}`', *_cells(row))))
    return lines


def _cells(row: Row) -> list[str]:
    interval = row['ci95'] and f'{_share(row["ci95"][0])} to {_share(row["ci95"][1])}'
    accuracy = [_share(row['balanced_accuracy']), interval or '-']
    if row['protocol'] == 'pairs':
        return [_pairs(row), *accuracy,
                *(_share(row[name]) for name in
                  ('average_precision', 'recall_at_100_precision', 'mcc'))]
    latency = row['latency_to_first_closure_s']
    return [f'{row["positives"]} / {row["negatives"]}', *accuracy,
            *(_share(row[name]) for name in ('precision', 'recall', 'recall_at_100_precision',
                                             'average_precision', 'mcc')),
            *(str(row[name]) for name in ('wrong_matches', 'declared_elsewhere',
                                          'untold_matches')),
            '-' if latency is None else f'{latency:.1f} s']


def _pairs(row: Row) -> str:
    text = f'{row["n_pairs"]} ({row["positives"] or 0} loops)'
    different = row.get('distinct_pairs', row['n_pairs'])
    return text if different == row['n_pairs'] else f'{text}, {different} different'


def _share(value: float | None) -> str:
    return '-' if value is None else f'{value:.3f}'
