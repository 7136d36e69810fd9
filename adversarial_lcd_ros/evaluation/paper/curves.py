# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the plots on the paper's experiments show, taken from rows and summaries."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.methods import is_yardstick, method_of
from adversarial_lcd_ros.evaluation.paper.frame_results import frame_right, frame_untold
from adversarial_lcd_ros.evaluation.paper.plots import Curve
from adversarial_lcd_ros.evaluation.paper.summaries import USUAL, Summary, summarise_methods
from adversarial_lcd_ros.evaluation.paper.tables import SETTING
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.registry import TARGETS

_POINTS = 120
_SHARED = tuple(name for name in SETTING if name not in ('target', 'mode'))


@dataclass(frozen=True, eq=False)
class TargetMap:
    """
    Attacks by target.

    Attributes
    ----------
    attacks, targets : tuple of str
        Titles of the rows and columns.
    declines : float64, (attacks, targets)
        Mean over the sequences, percentage points; NaN: not measured.
    setting : dict
        What all have in common.
    transfer : bool
        Some attack asked another target than it attacks.

    """

    attacks: tuple[str, ...]
    targets: tuple[str, ...]
    declines: NDArray[np.float64]
    setting: Summary
    transfer: bool


def query_curves(rows: Iterable[Row], setting: Mapping[str, object], ratio: float) -> list[Curve]:
    """
    Return for each query-guided attack the share of right decisions turned over by a query.

    Repeats are pooled within a sequence, sequences weigh the same. The yardstick has no query
    budget and no curve.

    Parameters
    ----------
    rows : iterable of mapping
        Cells with their frames.
    setting : mapping
        ``SETTING`` of the curves.
    ratio : float
        Perturbation ratio.

    """
    spent: dict[tuple[str, str, str], dict[str, list[NDArray[np.float64]]]] = defaultdict(
        lambda: defaultdict(list))
    for row in rows:
        if (row['ratio'] == ratio and row['mode'] == 'query' and not is_yardstick(row)
                and (row.get('asked_target') or row['target']) == row['target']
                and all(row.get(name, USUAL.get(name)) == value
                        for name, value in setting.items())):
            method = (wording.method_title(row), method_of(row), row['surrogate'])
            spent[method][row['sequence']].append(_queries_to_turn(row))
    largest = max((float(part[np.isfinite(part)].max(initial=0.0))
                   for of in spent.values() for parts in of.values() for part in parts),
                  default=0.0)
    if largest < 1.0:
        return []
    at = np.unique(np.round(np.geomspace(1.0, largest, _POINTS)))
    return [Curve(*method, at, np.mean([_share_within(np.concatenate(parts), at)
                                        for _, parts in sorted(of.items())], axis=0))
            for method, of in sorted(spent.items())]


def _queries_to_turn(row: Row) -> NDArray[np.float64]:
    # Of the decisions that were right before: infinite where the attack did not turn them.
    before = frame_right(row, 'clean') & ~frame_untold(row)
    after = frame_right(row, 'attacked')
    queries = np.array([frame['queries'] for frame in row['frame_results']], np.float64)
    return np.where(after, np.inf, queries)[before]


def _share_within(queries: NDArray[np.float64],
                  at: NDArray[np.float64]) -> NDArray[np.float64]:
    reached = np.searchsorted(np.sort(queries), at, side='right')
    return np.asarray(reached / max(len(queries), 1), np.float64)


def target_maps(cells: Sequence[Summary], ratio: float) -> list[TargetMap]:
    """
    Return the mean declines of attacks by target, with those that asked another target.

    One map for each way to judge. Only cells of the commonest setting, of sequences on which all
    targets were attacked, and attacks that have more than one.

    """
    chosen = [cell for cell in cells if cell['ratio'] == ratio and cell['mode'] != 'pass']
    maps = [_target_map(_comparable([cell for cell in chosen if cell['judged'] == judged]))
            for judged in sorted({cell['judged'] for cell in chosen})]
    return [found for found in maps if found is not None]


def _target_map(chosen: Sequence[Summary]) -> TargetMap | None:
    methods = summarise_methods(chosen)
    there = {method['target'] for method in methods}
    targets = tuple(name for name in (*TARGETS, *sorted(there - set(TARGETS))) if name in there)
    if len(targets) < 2:
        return None
    native = {(_attack(method), method['target']): method['decline_pp'] for method in methods
              if method['asked_target'] == method['target']}
    values: dict[str, dict[str, float]] = defaultdict(dict)
    for (title, target), decline in native.items():
        values[title][target] = decline
    moved = [method for method in methods if method['asked_target'] != method['target']]
    for method in moved:
        asked = method['asked_target']
        row = values[f'{_attack(method)}, asked {asked}']
        row[method['target']] = method['decline_pp']
        if (_attack(method), asked) in native:
            row[asked] = native[_attack(method), asked]
    # What was measured on one target only is in the tables.
    attacks = tuple(sorted(title for title, row in values.items() if len(row) > 1))
    if not attacks:
        return None
    declines = np.array([[values[title].get(target, np.nan) for target in targets]
                         for title in attacks])
    return TargetMap(attacks, targets, declines, {name: chosen[0][name] for name in _SHARED},
                     bool(moved))


def _comparable(cells: Sequence[Summary]) -> list[Summary]:
    # Of the commonest setting, on the sequences that all targets have.
    counts = Counter(tuple(cell[name] for name in _SHARED) for cell in cells)
    shared = max(counts, key=lambda key: (counts[key], str(key)), default=None)
    chosen = [cell for cell in cells if tuple(cell[name] for name in _SHARED) == shared]
    by_target: dict[str, set[str]] = defaultdict(set)
    for cell in chosen:
        by_target[cell['target']].add(cell['sequence'])
    return [cell for cell in chosen
            if all(cell['sequence'] in sequences for sequences in by_target.values())]


def _attack(method: Summary) -> str:
    if is_yardstick(method):
        return 'optimum (yardstick)'
    return wording.attack_title({**method, 'name': None})


def optimum_shares(cells: Sequence[Summary], setting: Summary,
                   ratio: float) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
    """
    Return attack to sequence to share of the optimum's decline, and attack to its method.

    On the target of a setting, with its size of graph and answers; key '' is the share of the
    mean declines. The largest share comes first, the optimum itself is left out.

    """
    chosen = [cell for cell in cells if cell['ratio'] == ratio
              and cell['asked_target'] == cell['target'] and cell['mode'] != 'pass'
              and all(cell[name] == setting[name] for name in
                      (('target', 'nodes', 'threshold', 'judged') if is_yardstick(cell)
                       else ('target', *_SHARED)))]
    methods_of: dict[str, str] = {}
    shares: dict[str, dict[str, float]] = {}
    for method in summarise_methods(chosen):
        if method['share_of_optimum'] is not None and not is_yardstick(method):
            title = _attack(method)
            methods_of[title] = method['method']
            shares[title] = {'': method['share_of_optimum']}
    for cell in chosen:
        if _attack(cell) in shares and cell['share_of_optimum'] is not None:
            shares[_attack(cell)][cell['sequence']] = cell['share_of_optimum']
    order = sorted(shares, key=lambda title: (-shares[title][''], title))
    return {title: shares[title] for title in order}, methods_of
