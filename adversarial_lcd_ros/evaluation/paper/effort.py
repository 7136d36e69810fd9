# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Loops lost over the queries an edit: for each perturbation, and each rule for flips asked before.

Few queries reward a good order of proposals, many a wide choice: which perturbation leads may turn
over in between, and hang on whether a flip that gained is asked about again.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
import math

from adversarial_lcd_ros.config import RETRIES, AttackConfig
from adversarial_lcd_ros.evaluation.methods import is_yardstick, method_of
from adversarial_lcd_ros.evaluation.paper.summaries import USUAL, Summary
from adversarial_lcd_ros.evaluation.paper.tables import (
    PAPER_PERTURBATION,
    PAPER_SURROGATE,
    SETTING,
    with_usual_surrogates,
)
from adversarial_lcd_ros.evaluation.store import Row

_RULES = {f'retry {rule}': rule for rule in RETRIES}
_SHARED = tuple(name for name in SETTING if name not in ('queries_per_edit', 'variant'))
RIVAL = 'shortest_path'  # takes over from the paper's perturbation where much is asked


@dataclass(frozen=True)
class Line:
    """
    A perturbation under a rule.

    Attributes
    ----------
    method, rule : str
    queries : tuple of int
        An edit, ascending.
    lost : tuple of float
        Share of the loops found before, mean over the sequences.

    """

    method: str
    rule: str
    queries: tuple[int, ...]
    lost: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Effort:
    """
    The lines of one setting.

    Attributes
    ----------
    setting : dict
        What all have in common: ``SETTING`` with the default of ``queries_per_edit``.
    sequences : tuple of str
        Those that every line has at every point.
    lines : tuple of Line
    optimum : float or None
        Share lost to the greedy optimum on these sequences.

    """

    setting: Summary
    sequences: tuple[str, ...]
    lines: tuple[Line, ...]
    optimum: float | None


def rule_of(variant: str) -> tuple[str, str]:
    """Return the rule in ``variant``, or the default, and what else the variant says."""
    parts = variant.split(', ') if variant else []
    rules = [_RULES[part] for part in parts if part in _RULES]
    rest = ', '.join(part for part in parts if part not in _RULES)
    return (rules[0] if rules else AttackConfig.retry), rest


def efforts(cells: Sequence[Summary], ratio: float) -> list[Effort]:
    """
    Return what is drawn, one for each setting with several numbers of queries an edit.

    Parameters
    ----------
    cells : sequence of dict
        From ``summarise_cells``.
    ratio : float
        Perturbation ratio.

    """
    groups: dict[tuple[Hashable, ...], list[Summary]] = {}
    for cell in with_usual_surrogates(cells):
        if cell['ratio'] == ratio and cell['mode'] == 'query' and cell['perturbation']:
            key = (*(cell[name] for name in _SHARED), rule_of(cell['variant'])[1])
            groups.setdefault(key, []).append(cell)
    found: list[Effort] = []
    for key in sorted(groups, key=str):
        setting = {**dict(zip((*_SHARED, 'variant'), key, strict=True)),
                   'queries_per_edit': AttackConfig.queries_per_edit}
        if len({cell['queries_per_edit'] for cell in groups[key]}) > 1:
            found += _effort(setting, groups[key], _yardsticks(cells, setting, ratio))
    return found


def _effort(setting: Summary, cells: Sequence[Summary],
            optima: Sequence[Summary]) -> Iterator[Effort]:
    points: dict[tuple[str, str], dict[int, dict[str, float]]] = {}
    for cell in cells:
        if cell['found_clean'] > 0:
            at = points.setdefault((cell['method'], rule_of(cell['variant'])[0]), {})
            at.setdefault(cell['queries_per_edit'], {})[cell['sequence']] = _lost(cell)
    everywhere = [set(of) for at in points.values() for of in at.values()]
    common = sorted(set.intersection(*everywhere)) if everywhere else []
    if common:
        lines = tuple(Line(*key, tuple(sorted(at)),
                           tuple(_mean([at[count][name] for name in common])
                                 for count in sorted(at)))
                      for key, at in sorted(points.items()))
        best = {cell['sequence']: _lost(cell) for cell in optima if cell['found_clean'] > 0}
        yield Effort(setting, tuple(common), lines,
                     _mean([best[name] for name in common]) if set(common) <= set(best) else None)


def _yardsticks(cells: Sequence[Summary], setting: Summary, ratio: float) -> list[Summary]:
    return [cell for cell in cells if is_yardstick(cell) and cell['ratio'] == ratio
            and all(cell[name] == setting[name]
                    for name in ('target', 'nodes', 'threshold', 'judged', 'variant'))]


def _lost(cell: Summary) -> float:
    return float(cell['suppressed'] / cell['found_clean'])


def _mean(values: Sequence[float]) -> float:
    return math.fsum(values) / len(values)


def orders(effort: Effort) -> list[str]:
    """Return which perturbation leads, a sentence for each number of queries; the usual rule."""
    rules = {line.rule for line in effort.lines}
    rule = AttackConfig.retry if AttackConfig.retry in rules else min(rules)
    lost: dict[int, list[tuple[float, str]]] = {}
    for line in (line for line in effort.lines if line.rule == rule):
        for count, share in zip(line.queries, line.lost, strict=True):
            lost.setdefault(count, []).append((share, line.method.replace('_', ' ')))
    return [f'{count} {"query" if count == 1 else "queries"} an edit (retry {rule}): '
            + ', '.join(f'{name} {100 * share:.1f} %' for share, name in
                        sorted(found, key=lambda entry: (-entry[0], entry[1])))
            for count, found in sorted(lost.items())]


def lost_by_one(rows: Sequence[Row], effort: Effort, ratio: float) -> list[dict[str, str]]:
    """
    Return loops that one of two attacks lost and the other did not: heading to cell.

    The paper's perturbation beside ``RIVAL``, on the same frames with the same seeds; a row for
    each rule and number of queries an edit that both have.

    """
    lost: dict[tuple[str, int, str], dict[tuple[Hashable, ...], bool]] = {}
    for row in rows:
        rule, rest = rule_of(row.get('variant', ''))
        given = {**USUAL, **row, 'variant': rest}
        if (row['ratio'] != ratio or method_of(row) not in (PAPER_PERTURBATION, RIVAL)
                or row['surrogate'] != PAPER_SURROGATE
                or (row.get('asked_target') or row['target']) != row['target']
                or any(given[name] != effort.setting[name] for name in (*_SHARED, 'variant'))):
            continue
        at = lost.setdefault((rule, row['queries_per_edit'], method_of(row)), {})
        at.update({(row['sequence'], row['seed'], frame['stamp']): frame['attacked'] != 'TP'
                   for frame in row['frame_results'] if frame['clean'] == 'TP'})
    lines = []
    for rule, queries in sorted({key[:2] for key in lost},
                                key=lambda key: (RETRIES.index(key[0]), key[1])):
        ours, theirs = (lost.get((rule, queries, name), {})
                        for name in (PAPER_PERTURBATION, RIVAL))
        both = sorted(set(ours) & set(theirs), key=str)
        if both:
            lines.append({
                'rule, queries an edit': f'{rule}, {queries}', 'loops found': str(len(both)),
                'lost by both': str(sum(ours[key] and theirs[key] for key in both)),
                'by eigencentrality only': str(sum(ours[key] and not theirs[key]
                                                   for key in both)),
                'by shortest path only': str(sum(theirs[key] and not ours[key] for key in both))})
    return lines
