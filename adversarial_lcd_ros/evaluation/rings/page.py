# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page of the rings: rings.md with its tables, from what summary.json holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.rings.scene import BARE, OTHER, SAME
from adversarial_lcd_ros.evaluation.rings.summaries import LEVELS, NODES, Summary

_NOTES = """\
Clean and attacked are balanced accuracies, decline is their difference in points, with the 95 %
interval of a bootstrap over frames. A map of clean graphs; every attacker asks the detector with
its defences unless it is called unaware.
Suppressed: loops that had been found and were lost. Invented: loops at new places that had been
left alone; in brackets those that certainly name another place. The optimum is a yardstick that
looks into the detector. Unexplained: edges that a defence cannot explain by the nodes, mean of
clean and of attacked graphs, where the detector counts them."""
_SEALED = """\
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
             *(['', _SEALED] if any(row.get('sealed') for row in rows) else []),
             '\n## Leaderboard of the defences\n', _WORST]
    for target in dict.fromkeys(row['target'] for row in rows):
        parts += [f'\n### Target {target}\n', *_leaderboard(
            *([entry for entry in summary[name] if entry.get('target', target) == target]
              for name in ('worst', 'prices', 'rows')))]
    for target, sequence in dict.fromkeys((row['target'], row['sequence']) for row in rows):
        here = [row for row in rows if (row['target'], row['sequence']) == (target, sequence)]
        parts += [f'\n## {sequence}, {target}: decline in points\n', *_matrix(here),
                  f'\n### {sequence}, {target}: each attack\n', *_details(here)]
    if summary['posters']:
        parts += ['\n## A poster in two places\n', _POSTERS, '', *_posters(summary['posters'])]
    return '\n'.join(parts).lstrip('\n') + '\n'


def table(headings: Sequence[str], lines: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a table in Markdown."""
    return [_line(headings), _line(['---'] * len(headings)), *map(_line, lines)]


def _line(cells: Sequence[str]) -> str:
    return f'| {" | ".join(cells)} |'


def _leaderboard(worst: Sequence[Summary], prices: Sequence[Summary],
                 rows: Sequence[Summary]) -> list[str]:
    price = {(entry['sequence'], entry['defence']): entry['more_us'] for entry in prices}
    clean = {(row['sequence'], row['defence']): row['balanced_clean'] for row in rows}
    left = {(entry['sequence'], entry['defence'], entry['level']): entry for entry in worst}
    lines = []
    for sequence, defence in dict.fromkeys((row['sequence'], row['defence']) for row in rows):
        held = [left.get((sequence, defence, level)) for level in LEVELS]
        more = price.get((sequence, defence))
        lines.append([sequence, defence, wording.percent(clean[sequence, defence]),
                      *(_worst(entry) for entry in held),
                      wording.UNDEFINED if more is None else f'{more:+,.0f}'])
    return table(['sequence', 'defence', 'clean', *LEVELS, 'price, us'], lines)


def _worst(entry: Summary | None) -> str:
    if entry is None:
        return wording.UNDEFINED
    bounds = wording.interval(entry['ci95'], 100.0)
    held = wording.percent(entry['balanced'])
    attacks = f'{entry["attacks"]} attack{"s" if entry["attacks"] > 1 else ""}'
    refused = entry.get('balanced_or_refused')
    or_refused = '' if refused is None else f', or refused {wording.percent(refused)}'
    return f'{held} ({bounds}; {attacks}){or_refused}' if bounds else f'{held}{or_refused}'


def _matrix(rows: Sequence[Summary]) -> list[str]:
    defences = list(dict.fromkeys(row['defence'] for row in rows))
    attacks = list(dict.fromkeys(_title(row) for row in rows))
    cell = {(_title(row), row['defence']): row for row in rows}
    lines = [[attack, *(_decline(cell.get((attack, defence))) for defence in defences)]
             for attack in attacks]
    return table(['attack', *defences], lines)


def _title(row: Summary) -> str:
    """Return what a recipe calls an attack; with its ratio where that is not the usual one."""
    ratio = '' if row['ring'] == NODES or row['ratio'] == 3e-4 else f', r {row["ratio"]:g}'
    return f'{row["attack"]}{ratio}'


def _decline(row: Summary | None) -> str:
    if row is None:
        return ''
    bounds = wording.interval(row['ci95'])
    refused = sum(row.get('refused', {}).values())
    return (wording.points(row['decline_pp']) + (f' ({bounds})' if bounds else '')
            + (f', {refused} refused' if refused else ''))


def _details(rows: Sequence[Summary]) -> list[str]:
    return table(
        ['attack', 'defence', 'clean → attacked', 'suppressed', 'invented', 'edits', 'nodes',
         'queries', 'unexplained', 'refused'],
        [[_title(row), row['defence'],
          f'{wording.percent(row["balanced_clean"])} → '
          f'{wording.percent(row["balanced_attacked"])}',
          f'{row["suppressed"]} of {row["found_clean"]}',
          f'{row["invented"]} of {row["silent_clean"]} ({row["invented_elsewhere"]})',
          wording.mean_count(row['edits_mean']), wording.mean_count(row['nodes_moved_mean']),
          wording.mean_count(row['queries_mean']), _unexplained(row), ', '.join(
              f'{cause} {count}' for cause, count in row.get('refused', {}).items())]
         for row in rows])


def _unexplained(row: Summary) -> str:
    clean, attacked = (row.get(f'{name}_mean') for name in ('unexplained_clean', 'unexplained'))
    if clean is None or attacked is None:
        return ''
    return f'{wording.mean_count(clean)} → {wording.mean_count(attacked)}'


def _posters(rows: Sequence[Summary]) -> list[str]:
    targets = list(dict.fromkeys(row['target'] for row in rows))
    checks = sorted(dict.fromkeys(row['check'] for row in rows), key=lambda name: name != 'none')
    cell = {(row['sequence'], poster_title(row), row['target'], row['check']): row for row in rows}
    lines = []
    order = {BARE: 0, SAME: 1, OTHER: 2}
    named = dict.fromkeys((row['sequence'], poster_title(row)) for row in sorted(
        rows, key=lambda row: (row['sequence'], order[row['control']], row['count'],
                               row['kind'], row['share'])))
    for sequence, title in named:
        first = cell[sequence, title, targets[0], checks[0]]
        lines.append([sequence, title, str(first['pairs']), str(first['on_wall']), *(
            ', '.join(_declared(cell[sequence, title, target, check]) for check in checks)
            for target in targets)])
    behind = ', '.join(checks)
    return [f'Each cell: {behind}.', '',
            *table(['sequence', 'poster', 'pairs', 'on walls', *targets], lines)]


def _declared(row: Summary) -> str:
    others = row['elsewhere'] - row['to_poster']
    return f'{row["to_poster"]}{f" (+{others})" if others > 0 else ""}'


def poster_title(row: Mapping[str, Any]) -> str:
    """Return what hangs in a scene, in words."""
    if row['control'] == BARE:
        return BARE
    size = f'{100 * row["share"]:g} % of the frame'
    if row['control'] == OTHER:
        return f'{OTHER}, {row["kind"]}, {size}'
    return f'{"two " if row["count"] == 2 else ""}{row["kind"]}, {size}'
