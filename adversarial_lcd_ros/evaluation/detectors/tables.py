# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figures of the targets: tables in Markdown for pages, lines for a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby

from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.detectors.defended import defended_table, settings_of
from adversarial_lcd_ros.evaluation.markdown import table, table_line
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.registry import NONE, TARGETS

TABLES = 'target.md'
_TITLES = {'pairs': 'Balanced accuracy on pairs', 'live': 'Balanced accuracy live'}
_SHOWN = {'pairs': ('average_precision', 'mcc'), 'live': ('precision', 'recall')}
_HEADS = {'pairs': ('pairs', 'balanced accuracy', '95 % interval', 'average precision',
                    'recall at 100 % precision', 'MCC'),
          'live': ('loops / new places', 'balanced accuracy', '95 % interval', 'precision',
                   'recall', 'recall at 100 % precision', 'average precision', 'MCC',
                   'wrong matches', 'certainly elsewhere', 'cannot be told',
                   'first loop found after')}


def target_tables(rows: Iterable[Row]) -> str:
    """Return a table for each protocol, in the order of sequences, sizes and targets."""
    rows = list(rows)
    parts = []
    for protocol, head in _HEADS.items():
        chosen = _ordered(rows, protocol)
        if not chosen:
            continue
        lines = table(('sequence', 'n', 'target', *head), ())
        for _, group in groupby(chosen, key=lambda row: (row['sequence'], row['nodes'],
                                                         settings_of(row))):
            lines += _group_lines(list(group))
        parts.append('\n'.join(lines))
    parts += defended_table(rows)
    return '\n\n'.join(parts) + '\n'


def target_lines(rows: Iterable[Row]) -> list[tuple[str, list[dict[str, str]]]]:
    """
    Return a title and a row a detector for each protocol, for a terminal of 80 columns.

    Settings that all detectors share, and the size of graphs that all share, are left out.
    """
    rows = list(rows)
    changed = [settings_of(row)[2] for row in rows]
    own = dict(zip(changed, wording.own_settings(changed), strict=True))
    sizes = len({row['nodes'] for row in rows})
    tables = [(title, [_line(row, own[settings_of(row)[2]], sizes > 1)
                       for row in _ordered(rows, protocol)])
              for protocol, title in _TITLES.items()]
    return [(title, lines) for title, lines in tables if lines]


def _line(row: Row, own: str, sized: bool) -> dict[str, str]:
    defences, check, _ = settings_of(row)
    detector = [row['target'], *([defences] if defences != NONE else []),
                *(['geometric check'] if check else []),
                *([own] if own else [])]
    size = f', n {row["nodes_mean"]:.0f}' if sized else ''
    bounds = f' ({wording.interval(row["ci95"], 100.0)})' if row['ci95'] else ''
    return {'detector': ', '.join(detector), 'sequence': row['sequence'] + size,
            'accuracy, % (95 %)': wording.points(_percent(row['balanced_accuracy'])) + bounds,
            **{name.replace('_', ' '): _share(row[name]) for name in _SHOWN[row['protocol']]}}


def _percent(value: float | None) -> float | None:
    return None if value is None else 100 * value


def _ordered(rows: Iterable[Row], protocol: str) -> list[Row]:
    """Return the rows of a protocol in the order of sequences, sizes, settings and targets."""
    chosen = [row for row in rows if row['protocol'] == protocol]
    order = {name: place for place, name in enumerate(TARGETS)}
    names = list(dict.fromkeys(row['sequence'] for row in chosen))
    settings = list(dict.fromkeys(map(settings_of, chosen)))
    return sorted(chosen, key=lambda row: (
        names.index(row['sequence']), row['nodes'], settings.index(settings_of(row)),
        order.get(row['target'], len(order)), row['target']))


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
