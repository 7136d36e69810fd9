# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the pages of the rings lay out: attacks by defences, the leaderboard, posters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.evaluation.rings.scene import BARE, OTHER, SAME
from adversarial_lcd_ros.evaluation.rings.summaries import LEVELS, NODES, Summary

_CONTROLS = {BARE: 0, SAME: 1, OTHER: 2}


@dataclass(frozen=True)
class Matrix:
    """
    Attacks beside defences, on one sequence and target.

    Attributes
    ----------
    sequence, target : str
    defences : tuple of str
        The columns.
    lines : tuple of (str, tuple of Summary or None)
        An attack, and what it came to beside each defence; None: it was not tried.
    rows : tuple of Summary
        All that is in the lines.

    """

    sequence: str
    target: str
    defences: tuple[str, ...]
    lines: tuple[tuple[str, tuple[Summary | None, ...]], ...]
    rows: tuple[Summary, ...]


@dataclass(frozen=True)
class Standing:
    """
    What is left of a detector with a defence, on one sequence.

    Attributes
    ----------
    sequence, target, defence : str
    clean : float or None
        Balanced accuracy before any attack.
    held : tuple of Summary or None
        Of each of LEVELS; None: no attack of that level was tried.
    more_us : float or None
        Price of a decision.

    """

    sequence: str
    target: str
    defence: str
    clean: float | None
    held: tuple[Summary | None, ...]
    more_us: float | None


@dataclass(frozen=True)
class Rank:
    """
    A defence over all sequences, means of the same number of frames of each kind.

    Attributes
    ----------
    target, defence : str
    clean : float or None
    held : tuple of float or None
        Of each of LEVELS; None: an attack is missing on a sequence.
    unharmed : tuple of float or None
        The same, where a refusal, which raises an alarm, counts as an attack that failed.
    attacks : tuple of int
        How many attacks each level holds, at least.
    more_us : float or None
        Median over sequences.
    each : tuple of Standing
        By sequence.

    """

    target: str
    defence: str
    clean: float | None
    held: tuple[float | None, ...]
    unharmed: tuple[float | None, ...]
    attacks: tuple[int, ...]
    more_us: float | None
    each: tuple[Standing, ...]


def attack_title(row: Summary) -> str:
    """Return what a recipe calls an attack; with its ratio where that is not the usual one."""
    if row['ring'] == NODES or row['ratio'] == AttackConfig.ratio:
        return str(row['attack'])
    return f'{row["attack"]}, r {row["ratio"]:g}'


def matrices(rows: Sequence[Summary]) -> list[Matrix]:
    """Return a matrix for each sequence and target, in the order of the rows."""
    found = []
    for sequence, target in dict.fromkeys((row['sequence'], row['target']) for row in rows):
        here = [row for row in rows if (row['sequence'], row['target']) == (sequence, target)]
        defences = tuple(dict.fromkeys(row['defence'] for row in here))
        cell = {(attack_title(row), row['defence']): row for row in here}
        found.append(Matrix(sequence, target, defences, tuple(
            (attack, tuple(cell.get((attack, defence)) for defence in defences))
            for attack in dict.fromkeys(map(attack_title, here))), tuple(here)))
    return found


def standings(summary: Mapping[str, Any]) -> list[Standing]:
    """Return what is left of every detector with every defence, from summary.json's content."""
    if not summary['rows']:
        return []
    # Of one target, where it is not said.
    target = summary['rows'][0]['target']
    price = {(entry['sequence'], entry.get('target', target), entry['defence']): entry['more_us']
             for entry in summary['prices']}
    clean = {(row['sequence'], row['target'], row['defence']): row['balanced_clean']
             for row in summary['rows']}
    left = {(entry['sequence'], entry['target'], entry['defence'], entry['level']): entry
            for entry in summary['worst']}
    return [Standing(*key, value, tuple(left.get((*key, level)) for level in LEVELS),
                     price.get(key)) for key, value in clean.items()]


def ranking(summary: Mapping[str, Any]) -> list[Rank]:
    """
    Return the defences by what is left over all sequences, the most first, by target.

    A refusal counts as an attack that failed: it misleads nobody. Those that were not attacked at
    a level stand behind those that were.
    """
    groups: dict[tuple[str, str], list[Standing]] = {}
    for entry in standings(summary):
        groups.setdefault((entry.target, entry.defence), []).append(entry)
    targets = list(dict.fromkeys(target for target, _ in groups))
    ranks = [_rank(target, defence, each) for (target, defence), each in groups.items()]
    return sorted(ranks, key=lambda rank: (-targets.index(rank.target), *(
        -1.0 if left is None else left for left in rank.unharmed)), reverse=True)


def _rank(target: str, defence: str, each: Sequence[Standing]) -> Rank:
    levels = list(zip(*(entry.held for entry in each), strict=True))
    prices = [entry.more_us for entry in each if entry.more_us is not None]
    return Rank(
        target, defence, _mean(entry.clean for entry in each),
        tuple(_mean(entry and entry['balanced'] for entry in level) for level in levels),
        tuple(_mean(entry and _unharmed(entry) for entry in level) for level in levels),
        tuple(min((entry['attacks'] for entry in level if entry), default=0) for level in levels),
        float(np.median(prices)) if prices else None, tuple(each))


def _unharmed(entry: Summary) -> float | None:
    found: float | None = entry.get('balanced_or_refused')
    return entry['balanced'] if found is None else found


def _mean(values: Iterable[float | None]) -> float | None:
    known = list(values)
    return None if None in known else float(np.mean(np.array(known, np.float64)))


@dataclass(frozen=True)
class PosterLine:
    """
    What hung in the places of a sequence, and what was declared.

    Attributes
    ----------
    sequence, title : str
    pairs : int
        Of places.
    on_wall : int
        Posters that hung on a wall in true perspective.
    cells : tuple of tuple of Summary
        By target, and by what the detectors had behind them.

    """

    sequence: str
    title: str
    pairs: int
    on_wall: int
    cells: tuple[tuple[Summary, ...], ...]


@dataclass(frozen=True)
class PosterTable:
    """What posters came to: lines by sequence, columns by target, cells by check."""

    targets: tuple[str, ...]
    checks: tuple[str, ...]
    lines: tuple[PosterLine, ...]


def poster_table(rows: Sequence[Summary]) -> PosterTable:
    """Return the posters of summary.json, controls at both ends of a sequence."""
    targets = tuple(dict.fromkeys(row['target'] for row in rows))
    checks = tuple(sorted(dict.fromkeys(row['check'] for row in rows),
                          key=lambda name: name != 'none'))
    cell = {(row['sequence'], poster_title(row), row['target'], row['check']): row for row in rows}
    named = dict.fromkeys((row['sequence'], poster_title(row)) for row in sorted(
        rows, key=lambda row: (row['sequence'], _CONTROLS[row['control']], row['count'],
                               row['kind'], row['share'])))
    lines = []
    for sequence, title in named:
        first = cell[sequence, title, targets[0], checks[0]]
        lines.append(PosterLine(sequence, title, first['pairs'], first['on_wall'], tuple(
            tuple(cell[sequence, title, target, check] for check in checks)
            for target in targets)))
    return PosterTable(targets, checks, tuple(lines))


def poster_title(row: Mapping[str, Any]) -> str:
    """Return what hangs in a scene, in words."""
    if row['control'] == BARE:
        return BARE
    size = f'{100 * row["share"]:g} % of the frame'
    if row['control'] == OTHER:
        return f'{OTHER}, {row["kind"]}, {size}'
    return f'{"two " if row["count"] == 2 else ""}{row["kind"]}, {size}'
