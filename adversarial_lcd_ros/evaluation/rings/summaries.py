# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What attacks come to beside each defence: cells of the matrix, and worst cases."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.evaluation.frames.cells import SEALED
from adversarial_lcd_ros.evaluation.intervals import class_mean_interval
from adversarial_lcd_ros.evaluation.metrics import balanced_accuracy, effect
from adversarial_lcd_ros.evaluation.outcomes import right, told_kind
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.ground_truth.labels import ELSEWHERE, NEGATIVE, POSITIVE
from adversarial_lcd_ros.registry import SEARCHES

FLIPS, NODES = 'flips', 'nodes'
# Worst cases: flips within the usual r, those or as many nodes as usual, and all that is there.
LEVELS = WITHIN_R, WITHIN_NODES, ANY = (
    f'flips, r {AttackConfig.ratio:g}', f'or {AttackConfig.nodes_moved} nodes', 'any attack')
Summary = dict[str, Any]
_GROUP = ('sequence', 'target', 'detector', 'threshold', 'name', 'search', 'aware', 'ratio',
          'variant')
# Of rows written before there was such a thing.
_SINCE = {'sealed': False, 'moved': ''}


def ring_of(row: Mapping[str, Any]) -> str:
    """Return what an attack changes: FLIPS or NODES."""
    search = SEARCHES.look_up(row['search'])
    return NODES if search is not None and search.changes_nodes else FLIPS


def defence_title(row: Mapping[str, Any]) -> str:
    """Return the defences of a row in words."""
    words = [row['detector'].removeprefix('defences ')] if row['detector'] else []
    if row['threshold'] != LcdConfig.threshold:
        words.append(f'threshold {row["threshold"]:g}')
    if row.get('sealed'):
        words.append(SEALED)
    return ', '.join(words) or 'none'


def attack_name(row: Mapping[str, Any]) -> str:
    """Return what a recipe calls an attack, and whether it knows of the defences."""
    name = str(row['name'] or row['search'])
    return name if row['aware'] else f'{name}, unaware'


def summarise(rows: Sequence[Row], seed: int) -> list[Summary]:
    """
    Return one entry for each attack, defence and sequence, seeds together.

    Parameters
    ----------
    rows : sequence of mapping
        Of cells.
    seed : int
        Of the bootstrap, which draws frames.

    """
    groups: dict[tuple[Any, ...], list[Row]] = defaultdict(list)
    for row in rows:
        groups[tuple(row[name] for name in _GROUP)].append(row)
    return [_entry(group, seed) for group in groups.values()]


def _entry(rows: Sequence[Row], seed: int) -> Summary:
    first = rows[0]
    frames = [frame for row in rows for frame in row['frame_results']]
    kind = np.array([frame['kind'] for frame in frames], np.int8)
    before, after = (np.array([frame[when] for frame in frames])
                     for when in ('clean', 'attacked'))
    change = effect(kind, before, after)
    stamps = [frame['stamp'] for frame in frames]
    lost = right(before).astype(np.int64) - right(after)
    return {
        **{name: first[name] for name in _GROUP},
        **{name: first.get(name, usual) for name, usual in _SINCE.items()}, 'ring': ring_of(first),
        'attack': attack_name(first), 'defence': defence_title(first),
        'seeds': len(rows), 'frames': len(frames), 'different_frames': len(set(stamps)),
        'positives': int((kind == POSITIVE).sum()), 'negatives': int((kind == NEGATIVE).sum()),
        'found_clean': int((before == 'TP').sum()), 'silent_clean': int((before == 'TN').sum()),
        'balanced_clean': balanced_accuracy(kind, before),
        'balanced_attacked': balanced_accuracy(kind, after),
        'decline_pp': change.decline_pp,
        'ci95': _times(_interval(stamps, told_kind(kind, before, after), lost, seed),
                       100.0),
        'suppressed': change.suppressed, 'invented': change.invented,
        'invented_elsewhere': sum(
            frame['attacked_is'] == ELSEWHERE and (frame['clean'], frame['attacked']) ==
            ('TN', 'FP') for frame in frames),
        'edits_mean': _mean(frame['edits'] for frame in frames),
        'nodes_moved_mean': _mean(frame['nodes_moved'] for frame in frames),
        'node_budget_mean': _mean(frame['node_budget'] for frame in frames),
        'queries_mean': _mean(frame['queries'] for frame in frames),
        **{f'{name}_mean': _counted(frames, name) for name in ('unexplained_clean',
                                                               'unexplained')},
        'refused': dict(sorted(Counter(
            frame['refused'] for frame in frames if frame.get('refused')).items()))}


def _counted(frames: Sequence[Mapping[str, Any]], name: str) -> float | None:
    """Return a mean over the frames on which it was counted; None if it was on none."""
    found = [frame[name] for frame in frames if frame.get(name) is not None]
    return _mean(found) if found else None


def worst_cases(rows: Sequence[Row], seed: int) -> list[Summary]:
    """
    Return for each defence and sequence what is left against the strongest attack on each frame.

    As RobustBench counts: a frame is held if every attack of the level fails on it. One entry for
    each of LEVELS that has an attack of its own; a level holds those before it. Where graphs were
    refused, ``balanced_or_refused`` takes a refusal, which raises an alarm, for an attack that
    failed; None elsewhere.
    """
    groups: dict[tuple[str, str, str], list[Row]] = defaultdict(list)
    for row in rows:
        groups[row['sequence'], row['target'], defence_title(row)].append(row)
    found = []
    for key, group in groups.items():
        for number, level in enumerate(LEVELS):
            if any(_level_of(row) == level for row in group):
                found.append(_worst(key, [row for row in group if _level_of(row)
                                          in LEVELS[:number + 1]], level, seed))
    return found


def _level_of(row: Row) -> str:
    if ring_of(row) == FLIPS:
        return WITHIN_R if row['ratio'] <= AttackConfig.ratio else ANY
    most = max((frame['node_budget'] for frame in row['frame_results']), default=0)
    few = row['search'] == 'move_nodes' and most <= AttackConfig.nodes_moved
    return WITHIN_NODES if few else ANY


def _worst(key: tuple[str, str, str], rows: Sequence[Row], level: str, seed: int) -> Summary:
    held: dict[tuple[int, int], list[tuple[bool, bool]]] = defaultdict(list)
    kinds: dict[tuple[int, int], int] = {}
    attacks = set()
    for row in rows:
        attacks.add((attack_name(row), row['ratio'], row['variant']))
        for frame in row['frame_results']:
            if 'UM' not in (frame['clean'], frame['attacked']):
                at = row['seed'], frame['stamp']
                kinds[at] = frame['kind']
                was, now = (frame[when] in ('TP', 'TN') for when in ('clean', 'attacked'))
                held[at].append((was and now, was and (now or bool(frame.get('refused')))))
    kind = np.array([kinds[at] for at in held], np.int8)
    right, unharmed = (np.array([all(each[way] for each in attacks) for attacks in held.values()],
                                np.int64) for way in (0, 1))
    refused = any(frame.get('refused') for row in rows for frame in row['frame_results'])
    return {'sequence': key[0], 'target': key[1], 'defence': key[2], 'level': level,
            'attacks': len(attacks), 'frames': len(held), 'balanced': _balanced(kind, right),
            'balanced_or_refused': _balanced(kind, unharmed) if refused else None,
            'ci95': _interval([stamp for _, stamp in held], kind, right, seed)}


def _balanced(kind: NDArray[np.int8], right: NDArray[np.int64]) -> float | None:
    rates = [right[kind == value] for value in (POSITIVE, NEGATIVE)]
    return float(np.mean([rate.mean() for rate in rates])) if all(map(len, rates)) else None


def _interval(stamps: Sequence[int], kind: NDArray[np.int8], value: NDArray[np.int64],
              seed: int) -> list[float] | None:
    """Return the 95 % interval of a balanced mean; a frame drawn by several seeds is one."""
    known, place = np.unique(np.array(stamps, np.int64), return_inverse=True)
    size, total = np.zeros((2, len(known)), np.int64), np.zeros((2, len(known)), np.int64)
    for row, wanted in enumerate((POSITIVE, NEGATIVE)):
        np.add.at(size[row], place[kind == wanted], 1)
        np.add.at(total[row], place[kind == wanted], value[kind == wanted])
    found = class_mean_interval(size, total, 1, seed) if len(known) else None
    return None if found is None else list(found)


def _times(interval: list[float] | None, factor: float) -> list[float] | None:
    return None if interval is None else [factor * bound for bound in interval]


def _mean(values: Iterable[float]) -> float:
    found = list(values)
    return float(np.mean(found)) if found else 0.0
