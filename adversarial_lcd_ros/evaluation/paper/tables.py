# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Which tables the cells of an evaluation fill: those of the paper, and the attacks side by side.

A table compares what differs in one respect only. All else (target, oracle, mode, size of graph,
allowed flips, queries an edit) is its setting, and each setting has a table of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.methods import is_yardstick, method_facts, surrogate_facts
from adversarial_lcd_ros.evaluation.paper.printed import (
    BUDGET_TABLE,
    PERTURBATION_TABLE,
    SURROGATE_TABLE,
    PrintedTable,
)
from adversarial_lcd_ros.evaluation.paper.ranks import Ranking, rank_methods
from adversarial_lcd_ros.evaluation.paper.summaries import (
    ATTACK,
    USUAL,
    Summary,
    declines_by_sequence,
    is_attackable,
    summarise_methods,
)
from adversarial_lcd_ros.registry import NONE, TARGETS
from adversarial_lcd_ros.shown import Shown

PAPER_RATIO = 3e-4
PAPER_PERTURBATION, PAPER_SURROGATE = 'eigencentrality', 'svm_rbf'
SETTING = ('target', 'oracle', 'mode', 'edits', 'queries_per_edit', 'nodes', 'threshold',
           'judged', 'variant')


@dataclass(frozen=True, eq=False)
class Line:
    """
    A row of a table.

    Attributes
    ----------
    title : str
        Sequence or ratio.
    entries : tuple of (dict or None)
        A summary a column; None where the evaluation has no such cell.

    """

    title: str
    entries: tuple[Summary | None, ...]

    @property
    def before(self) -> float | None:
        """Balanced accuracy without an attack, mean over the entries (equal as a rule)."""
        values = [entry['balanced_clean'] for entry in self.entries
                  if entry and entry['balanced_clean'] is not None]
        return sum(values) / len(values) if values else None

    @property
    def strongest(self) -> Summary | None:
        """The entry with the largest decline, if it is above zero; the yardstick left out."""
        there = [entry for entry in self.entries if entry and not is_yardstick(entry)
                 and (entry['decline_pp'] or 0.0) > 0.0]
        return max(there, key=lambda entry: entry['decline_pp'], default=None)


@dataclass(frozen=True, eq=False)
class DeclineTable:
    """
    One of the paper's tables, filled with our cells.

    Attributes
    ----------
    printed : PrintedTable
        The paper's.
    setting : dict
        ``SETTING`` of all cells in the table.
    values, columns : tuple of str
        Our setting that a column stands for, and its heading.
    lines : tuple of Line
        By sequence (Tables 3 and 5) or by ratio (Table 6, means over the sequences).
    mean : Line or None
        Over the sequences that all columns have, and that allow an edit.
    ranking : Ranking or None
        Of the columns but the yardstick; None below two columns or sequences.

    """

    printed: PrintedTable
    setting: Summary
    values: tuple[str, ...]
    columns: tuple[str, ...]
    lines: tuple[Line, ...]
    mean: Line | None = None
    ranking: Ranking | None = None

    @property
    def title(self) -> str:
        """The setting in words."""
        return setting_title(self.setting)


def setting_title(setting: Summary) -> str:
    """Return what a table holds fixed, in words."""
    parts = [f'target {setting["target"]}', wording.mode_title(setting['mode']),
             f'{setting["oracle"]} answers', f'{setting["nodes"]} features']
    if setting['mode'] == 'query':
        parts.append(f'{setting["queries_per_edit"]} queries an edit')
    if setting['edits'] != 'both':
        parts.append(f'{setting["edits"]} only')
    if setting['threshold'] != USUAL['threshold']:
        parts.append(f'threshold {setting["threshold"]:g}')
    if setting['judged'] != USUAL['judged']:
        parts.append(f'judged by {setting["judged"]}')
    if setting.get('variant'):
        parts.append(setting['variant'])
    return ', '.join(parts)


def main_ratio(cells: Sequence[Summary]) -> float:
    """Return the paper's ratio if there are cells of it, else the largest."""
    ratios = {float(cell['ratio']) for cell in cells}
    return PAPER_RATIO if PAPER_RATIO in ratios or not ratios else max(ratios)


def surrogate_tables(cells: Sequence[Summary]) -> list[DeclineTable]:
    """Return Tables 3 and 4: surrogates with eigencentrality, a sequence a row."""
    ratio = main_ratio(cells)
    chosen = [cell for cell in _native(cells)
              if cell['ratio'] == ratio and cell['perturbation'] == PAPER_PERTURBATION
              and cell['surrogate'] != NONE]
    return _tables(chosen, SURROGATE_TABLE, 'surrogate', surrogate_facts)


def perturbation_tables(cells: Sequence[Summary]) -> list[DeclineTable]:
    """Return Table 5: perturbations, with SVM-RBF where they use a surrogate."""
    ratio = main_ratio(cells)
    chosen = [cell for cell in with_usual_surrogates(cells) if cell['ratio'] == ratio]
    return _tables(chosen, PERTURBATION_TABLE, 'method', method_facts)


def budget_tables(cells: Sequence[Summary]) -> list[DeclineTable]:
    """Return Table 6: perturbations by ratio, means over the sequences."""
    tables = []
    for setting, group in _by_setting(with_usual_surrogates(cells)):
        ratios = sorted({cell['ratio'] for cell in group})
        if len(ratios) < 2:
            continue
        means = {(method['ratio'], method['method']): method
                 for method in summarise_methods(group)}
        values = _ordered({method for _, method in means}, method_facts)
        lines = tuple(Line(f'{ratio:g}', tuple(means.get((ratio, value)) for value in values))
                      for ratio in ratios)
        tables.append(DeclineTable(BUDGET_TABLE, setting, values,
                                   tuple(map(_heading, values)), lines))
    return tables


def _native(cells: Sequence[Summary]) -> list[Summary]:
    # Attacks that asked the very detector they attack.
    return [cell for cell in cells
            if cell['asked_target'] == cell['target'] and cell['mode'] != 'pass']


def with_usual_surrogates(cells: Sequence[Summary]) -> list[Summary]:
    """
    Return the cells of each method with the paper's surrogate.

    The paper's perturbations come with SVM-RBF; one that has no such cell comes as it is, if there
    is only one way.
    """
    native = _native(cells)
    ways: dict[tuple[Hashable, ...], set[str]] = {}
    for cell in native:
        ways.setdefault(_way(cell), set()).add(cell['surrogate'])
    preferred = {way: PAPER_SURROGATE if PAPER_SURROGATE in there else
                 NONE if NONE in there else min(there) for way, there in ways.items()}
    return [cell for cell in native if cell['surrogate'] == preferred[_way(cell)]]


def _way(cell: Summary) -> tuple[Hashable, ...]:
    return (cell['method'], *(cell[name] for name in SETTING))


def _by_setting(cells: Sequence[Summary]) -> list[tuple[Summary, list[Summary]]]:
    # The most complete setting first, then the detectors in their usual order.
    groups: dict[tuple[Hashable, ...], list[Summary]] = {}
    for cell in cells:
        groups.setdefault(tuple(cell[name] for name in SETTING), []).append(cell)
    known = {name: place for place, name in enumerate(TARGETS)}
    order = sorted(groups, key=lambda key: (-len(groups[key]), _unusual(key),
                                            known.get(str(key[0]), len(known)), key))
    return [(dict(zip(SETTING, key, strict=True)), groups[key]) for key in order]


def _unusual(key: Sequence[Hashable]) -> int:
    """Return how many settings of an attack are not its defaults."""
    setting = dict(zip(SETTING, key, strict=True))
    return sum((setting['queries_per_edit'] != AttackConfig.queries_per_edit,
                setting['edits'] != AttackConfig.edits, bool(setting['variant'])))


def _tables(cells: Sequence[Summary], printed: PrintedTable, column: str,
            facts: Callable[[str], type[Shown]]) -> list[DeclineTable]:
    tables = []
    for setting, group in _by_setting(cells):
        values = _ordered({cell[column] for cell in group}, facts)
        if len({cell[column] for cell in group if not is_yardstick(cell)}) < 2:
            continue  # one column compares nothing
        at = {(cell['sequence'], cell[column]): cell for cell in group}
        sequences = sorted({cell['sequence'] for cell in group})
        lines = tuple(Line(sequence, tuple(at.get((sequence, value)) for value in values))
                      for sequence in sequences)
        whole = [line.title for line in lines
                 if all(entry and is_attackable(entry) for entry in line.entries)]
        means = {method[column]: method for method in summarise_methods(
            [cell for cell in group if cell['sequence'] in whole])}
        mean = (Line('mean', tuple(means[value] for value in values)) if whole else None)
        tables.append(DeclineTable(printed, setting, values, tuple(map(_heading, values)), lines,
                                   mean, _ranking(group, column)))
    return tables


def _ranking(cells: Sequence[Summary], column: str) -> Ranking | None:
    names = {tuple(cell[factor] for factor in ATTACK): _heading(cell[column]) for cell in cells
             if not is_yardstick(cell)}
    declines = declines_by_sequence(cells, names)
    if len(declines) < 2 or min(map(len, declines.values())) < 2:
        return None
    return rank_methods(declines)


def _ordered(values: set[str], facts: Callable[[str], type[Shown]]) -> tuple[str, ...]:
    return tuple(sorted(values, key=lambda value: (facts(value).rank, value)))


def _heading(value: str) -> str:
    for facts in (method_facts(value), surrogate_facts(value)):
        if facts.title:
            return facts.title
    return value.replace('_', ' ')
