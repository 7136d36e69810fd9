# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page of the rings: rings.md with its tables, from what summary.json holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.markdown import table
from adversarial_lcd_ros.evaluation.rings.summaries import LEVELS, Summary
from adversarial_lcd_ros.evaluation.rings.tables import (
    Matrix,
    Standing,
    attack_title,
    matrices,
    poster_table,
    standings,
)

_NOTES = """\
Clean and attacked are balanced accuracies, decline is their difference in points, with the 95 %
interval of a bootstrap over frames. A map of clean graphs; every attacker asks the detector with
its defences unless it is called unaware.
Suppressed: loops that had been found and were lost. Invented: loops at new places that had been
left alone; in brackets those that certainly name another place. The optimum is a yardstick that
looks into the detector. Unexplained: edges that a defence cannot explain by the nodes, mean of
clean and of attacked graphs, where the detector counts them."""
SEALED = """\
Sealed graphs: builder and detector share a key. Who knows of it sends graphs as they are: nothing
is lost. What others send is refused, counted by cause, and decides nothing: new places are left
alone, **and loops are lost**, with an alarm for each. Cutting the wire, or holding graphs back,
loses them as well and is measured nowhere on this page, since nothing stops it; graphs that were
held back are counted as missing."""
_WORST = """\
Worst case as RobustBench counts it: a frame is held only if every attack of the column, and of
those left of it, fails on it, so each figure is below that of any single attack. A graph that is
refused decides nothing, so its loop counts as lost; the second figure takes a refusal for an
attack that failed. Price: median processor time that a decision on a clean graph takes more than
without the defence, for sealed graphs that of sealing and opening one, on the machine of the run,
whatever else it did."""
_POSTERS = """\
Of so many pairs of places that certainly differ, in how many a loop with the poster's frames was
declared. Controls: no poster, and another poster of the kind in the later place; of these, all
loops with the same frames. In brackets: loops with any other frame that certainly shows another
place, which no poster is needed for."""


def rings_page(summary: Mapping[str, Any], command: str = '') -> str:
    """Return the page of a results folder in Markdown."""
    rows: list[Summary] = summary['rows']
    parts = [f'Made by `{command}`.\n' if command else '',
             '# The rings: attacks beside defences\n', _NOTES,
             *(['', SEALED] if any(row.get('sealed') for row in rows) else []),
             '\n## Leaderboard of the defences\n', _WORST]
    board = standings(summary)
    for target in dict.fromkeys(entry.target for entry in board):
        parts += [f'\n### Target {target}\n',
                  *_leaderboard([entry for entry in board if entry.target == target])]
    for matrix in matrices(rows):
        title = f'{matrix.sequence}, {matrix.target}'
        parts += [f'\n## {title}: decline in points\n', *_matrix(matrix),
                  f'\n### {title}: each attack\n', *_details(matrix.rows)]
    if summary['posters']:
        parts += ['\n## A poster in two places\n', _POSTERS, '', *_posters(summary['posters'])]
    return '\n'.join(parts).lstrip('\n') + '\n'


def _leaderboard(board: Sequence[Standing]) -> list[str]:
    return table(['sequence', 'defence', 'clean', *LEVELS, 'price, us'], [
        [entry.sequence, entry.defence, wording.percent(entry.clean), *map(_worst, entry.held),
         wording.UNDEFINED if entry.more_us is None else f'{entry.more_us:+,.0f}']
        for entry in board])


def _worst(entry: Summary | None) -> str:
    if entry is None:
        return wording.UNDEFINED
    bounds = wording.interval(entry['ci95'], 100.0)
    held = wording.percent(entry['balanced'])
    attacks = f'{entry["attacks"]} attack{"s" if entry["attacks"] > 1 else ""}'
    unharmed = entry.get('balanced_or_refused')
    or_refused = '' if unharmed is None else f', or refused {wording.percent(unharmed)}'
    return f'{held} ({bounds}; {attacks}){or_refused}' if bounds else f'{held}{or_refused}'


def _matrix(matrix: Matrix) -> list[str]:
    return table(['attack', *matrix.defences],
                 [[attack, *map(_decline, cells)] for attack, cells in matrix.lines])


def _decline(row: Summary | None) -> str:
    if row is None:
        return ''
    bounds = wording.interval(row['ci95'])
    count = sum(row.get('refused', {}).values())
    return (wording.points(row['decline_pp']) + (f' ({bounds})' if bounds else '')
            + (f', {count} refused' if count else ''))


def _details(rows: Sequence[Summary]) -> list[str]:
    return table(
        ['attack', 'defence', 'clean → attacked', 'suppressed', 'invented', 'edits', 'nodes',
         'queries', 'unexplained', 'refused'],
        [[attack_title(row), row['defence'],
          f'{wording.percent(row["balanced_clean"])} → '
          f'{wording.percent(row["balanced_attacked"])}',
          f'{row["suppressed"]} of {row["found_clean"]}',
          f'{row["invented"]} of {row["silent_clean"]} ({row["invented_elsewhere"]})',
          wording.mean_count(row['edits_mean']), wording.mean_count(row['nodes_moved_mean']),
          wording.mean_count(row['queries_mean']), unexplained(row), refused(row)]
         for row in rows])


def unexplained(row: Summary) -> str:
    """Return the edges that nodes do not explain, clean and attacked; '' if nobody counted."""
    clean, attacked = (row.get(f'{name}_mean') for name in ('unexplained_clean', 'unexplained'))
    if clean is None or attacked is None:
        return ''
    return f'{wording.mean_count(clean)} → {wording.mean_count(attacked)}'


def refused(row: Summary) -> str:
    """Return how many graphs were refused, by cause; '' if none was."""
    return ', '.join(f'{cause} {count}' for cause, count in row.get('refused', {}).items())


def _posters(rows: Sequence[Summary]) -> list[str]:
    found = poster_table(rows)
    return [f'Each cell: {", ".join(found.checks)}.', '', *table(
        ['sequence', 'poster', 'pairs', 'on walls', *found.targets],
        [[line.sequence, line.title, str(line.pairs), str(line.on_wall),
          *(', '.join(map(_declared, group)) for group in line.cells)]
         for line in found.lines])]


def _declared(row: Summary) -> str:
    others = row['elsewhere'] - row['to_poster']
    return f'{row["to_poster"]}{f" (+{others})" if others > 0 else ""}'
