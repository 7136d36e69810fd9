# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the paper's experiments gave here, in plain sentences computed from the cells."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.methods import is_yardstick
from adversarial_lcd_ros.evaluation.paper.printed import BUDGET_TABLE
from adversarial_lcd_ros.evaluation.paper.ranks import Ranking
from adversarial_lcd_ros.evaluation.paper.summaries import Summary, is_attackable
from adversarial_lcd_ros.evaluation.paper.tables import DeclineTable
from adversarial_lcd_ros.registry import TARGETS

PAPER_SEEDS = 10
_FEW_FRAMES = 30
_MANY_TABLES = 3
_TIE_PP = 0.05  # what is printed as equal is equal


def strongest(methods: Sequence[Summary], target: str | None = None) -> Summary | None:
    """
    Return the black-box attack with the largest mean decline; None without any.

    Of the size of graph and the threshold that most attacks have: others are experiments of their
    own, often on few frames.

    Parameters
    ----------
    methods : sequence of dict
        From ``summarise_methods``. The yardstick does not count, nor does an attack that asked
        another target than it attacks.
    target : str
        Only attacks on this one.

    """
    there = [method for method in methods
             if not is_yardstick(method) and method['asked_target'] == method['target']
             and method['mode'] != 'pass' and target in (None, method['target'])]
    kinds = Counter(map(_kind_of, there)).most_common(1)
    there = [method for method in there if _kind_of(method) == kinds[0][0]]
    return max(there, key=lambda method: method['decline_pp'], default=None)


def _kind_of(method: Summary) -> tuple[Any, ...]:
    """Return what declines hang on most, whatever the attack."""
    return method['nodes'], method['threshold'], method['judged']


def main_target(methods: Sequence[Summary]) -> str | None:
    """Return the first target, in the usual order, that was attacked."""
    there = {method['target'] for method in methods}
    return next((name for name in (*TARGETS, *sorted(there)) if name in there), None)


def headline(methods: Sequence[Summary], ratio: float, cells: Sequence[Summary] = ()) -> str:
    """Return the main finding at a perturbation ratio in one or two sentences."""
    here = [method for method in methods if method['ratio'] == ratio]
    target = main_target(here)
    best = strongest(here, target)
    if best is None:
        return ('No attack was measured on a sequence with both loops and new places.'
                f'{_without_decline([cell for cell in cells if cell["ratio"] == ratio])}')
    count = len(best['sequences'])
    over = 'one sequence' if count == 1 else f'{count} sequences'
    title = f'{wording.attack_title({**best, "name": None})}, {best["nodes"]} features'
    bounds = best['ci95']
    interval = f' (95 % interval over sequences {wording.interval(bounds)})' if bounds else ''
    accuracy = (f'from {wording.percent(best["balanced_clean"])} to '
                f'{wording.percent(best["balanced_attacked"])}')
    share = best['share_of_optimum']
    yardstick = '' if share is None else (f' That is {wording.percent(share, 0)} of what the '
                                          'greedy optimum over all flips takes.')
    if best['decline_pp'] < _TIE_PP:
        return (f'No black-box attack lowered the balanced accuracy of {target} on {over} at '
                f'r = {ratio:g}; the strongest was {title}, {accuracy}.')
    doubt = (' So few sequences leave open whether it holds on others.'
             if bounds and bounds[0] <= 0 else
             ' One sequence says nothing about others.' if bounds is None else '')
    return (f'At r = {ratio:g} the strongest black-box attack on target {target} ({title}) took '
            f'{wording.points(best["decline_pp"])} points of balanced accuracy on average over '
            f'{over}{interval}, {accuracy}.{doubt}{yardstick}')


def _without_decline(cells: Sequence[Summary]) -> str:
    best = max((cell for cell in cells if cell['decline_pp'] is None and not is_yardstick(cell)),
               key=lambda cell: cell['suppressed'] + cell['invented'], default=None)
    if best is None:
        return ''
    return (f' The strongest, {wording.attack_title({**best, "name": None})} on target '
            f'{best["target"]}, suppressed {wording.mean_count(best["suppressed"])} of '
            f'{wording.mean_count(best["found_clean"])} loops found on {best["sequence"]}, and '
            f'invented {wording.mean_count(best["invented"])} in '
            f'{wording.mean_count(best["silent_clean"])} new places left alone.')


def verdict(table: DeclineTable) -> str:
    """Tell whether the paper's ranking of the columns comes out here, and how surely."""
    printed, mean = table.printed, table.mean
    if printed.number == BUDGET_TABLE.number:
        return _budget_verdict(table)
    heading = dict(zip(table.values, table.columns, strict=True))
    paper = sorted((name for name, value in printed.settings.items() if value in heading),
                   key=printed.mean)
    if mean is None or len(paper) < 2:
        return 'The ranking cannot be set against that of the paper: too few of its methods.'
    declines = {value: entry['decline_pp']
                for value, entry in zip(table.values, mean.entries, strict=True) if entry}
    expected = [printed.settings[name] for name in paper]
    ours = sorted(expected, key=lambda value: (-declines[value], expected.index(value)))
    named = _order([heading[value] for value in ours], [declines[value] for value in ours])
    theirs = ' > '.join(heading[value] for value in expected)
    if abs(declines[ours[0]] - declines[ours[-1]]) < _TIE_PP:
        return (f"The paper's ranking ({theirs}) does not come out: all took the same, "
                f'{wording.points(declines[ours[0]])} points.')
    in_order = all(declines[first] - declines[second] >= _TIE_PP
                   for first, second in pairwise(expected))
    leads = all(declines[expected[0]] - declines[other] >= _TIE_PP for other in expected[1:])
    if in_order:
        start = f"The paper's ranking comes out in the means: {named}"
    elif leads:
        start = (f"The paper's leader leads here too, but its ranking ({theirs}) does not come "
                 f'out: {named}')
    else:
        start = f"The paper's ranking ({theirs}) does not come out: {named}"
    return f'{start}. {_certainty(table.ranking, [heading[value] for value in expected])}'


def _budget_verdict(table: DeclineTable) -> str:
    paper = [value for value in table.printed.settings.values() if value in table.values]
    ahead = list(table.printed.settings.values())[-1]
    if ahead not in paper or len(paper) < 2:
        return 'The budgets cannot be set against the paper: too few of its methods.'
    leads, ratios = 0, 0
    for line in table.lines:
        declines = {value: entry['decline_pp']
                    for value, entry in zip(table.values, line.entries, strict=True)
                    if entry and value in paper}
        if set(declines) == set(paper):
            ratios += 1
            leads += all(declines[ahead] - declines[value] >= _TIE_PP
                         for value in paper if value != ahead)
    title = dict(zip(table.values, table.columns, strict=True))[ahead]
    return (f"Of the paper's perturbations {title} takes most at {leads} of {ratios} ratios here; "
            'in the paper at all three.')


def _order(names: Sequence[str], declines: Sequence[float]) -> str:
    # Names with their declines, the strongest first; equal to the printed digit: "=".
    parts = [f'{names[0]} {wording.points(declines[0])}']
    for (before, decline), name in zip(pairwise(declines), names[1:], strict=True):
        sign = '=' if before - decline < _TIE_PP else '>'
        parts.append(f'{sign} {name} {wording.points(decline)}')
    return ' '.join(parts)


def _certainty(ranking: Ranking | None, names: Sequence[str]) -> str:
    if ranking is None:
        return 'One sequence cannot tell a difference from chance.'
    apart = [f'{first} and {second}' for place, first in enumerate(names)
             for second in names[place + 1:] if ranking.separated(first, second)]
    count = len(ranking.sequences)
    if not apart:
        found = ('the columns differ, but no pair of these by more than the critical difference'
                 if ranking.p_value < ranking.alpha else 'none of this is beyond chance')
        return f'With {count} sequences {found} ({ranking.test} p = {ranking.p_value:.3f}).'
    every = len(names) * (len(names) - 1) // 2
    what = 'all pairs' if len(apart) == every else '; '.join(apart)
    return f'Beyond chance with {count} sequences: {what}.'


def warnings(cells: Sequence[Summary], tables: Sequence[DeclineTable]) -> list[str]:
    """Return what a reader has to know before the figures, each a sentence or two."""
    texts = []
    seeds = [cell['seeds'] for cell in cells]
    if seeds and min(seeds) < PAPER_SEEDS:
        spread = f'{min(seeds)}' if min(seeds) == max(seeds) else f'{min(seeds)} to {max(seeds)}'
        texts.append(f'Seeds: {spread} for each attack and sequence; the paper says that it '
                     f'repeated ten times (with one random state, 42).')
    texts += _separation(tables)
    texts += _incomplete(tables)
    texts += _frames(cells)
    texts += _trained(cells)
    cut = [cell for cell in cells if cell['unattackable']]
    if cut:
        share = sum(cell['unattackable'] for cell in cut) / sum(cell['frames'] for cell in cut)
        texts.append(f'Frames that allow no edit or could not be attacked are in {len(cut)} of '
                     f'{len(cells)} cells, {wording.percent(share)} of their frames. They are in '
                     'every figure of their sequence, as frames that no attack changed; a '
                     'sequence of nothing else is in no mean over sequences.')
    return texts


def _separation(tables: Sequence[DeclineTable]) -> list[str]:
    where: dict[str, list[str]] = {}
    for table in tables:
        if table.ranking:
            for text in table.ranking.warnings:
                where.setdefault(text, []).append(
                    f'table {table.printed.number} ({table.setting["target"]}, '
                    f'{wording.mode_title(table.setting["mode"])})')
    return [f'{", ".join(sorted(set(places))).capitalize()}: {text}'
            for text, places in where.items()]


def _incomplete(tables: Sequence[DeclineTable]) -> list[str]:
    where: dict[str, list[str]] = {}
    for table in tables:
        for line in table.lines:
            if table.mean is not None and any(
                    entry is None or not is_attackable(entry) for entry in line.entries):
                where.setdefault(line.title, []).append(
                    f'table {table.printed.number} ({table.title})')
    return [f'{sequence} is not in the mean and the ranks of {_listed(tables)}: for want of a '
            'figure, or of a frame that allows an edit, in some column.'
            for sequence, tables in where.items()]


def _listed(tables: Sequence[str]) -> str:
    return ', '.join(tables) if len(tables) < _MANY_TABLES else f'{len(tables)} tables'


def _trained(cells: Sequence[Summary]) -> list[str]:
    seen = {cell['sequence']: sorted({other['target'] for other in cells if other['trained_on']
                                      and other['sequence'] == cell['sequence']})
            for cell in cells}
    return [f'{sequence} was seen in training by {", ".join(targets)}: it is no test of what they '
            'are worth.' for sequence, targets in sorted(seen.items()) if targets]


def _frames(cells: Sequence[Summary]) -> list[str]:
    texts = []
    for sequence in sorted({cell['sequence'] for cell in cells}):
        of_sequence = [cell for cell in cells if cell['sequence'] == sequence]
        positives, negatives = (max(cell[f'different_{kind}'] for cell in of_sequence)
                                for kind in ('positives', 'negatives'))
        if not positives or not negatives:
            kind = 'loops' if not positives else 'new places'
            texts.append(f'{sequence} has no {kind}: no balanced accuracy, no decline.')
        elif min(positives, negatives) < _FEW_FRAMES:
            texts.append(f'{sequence}: {positives} different frames with a loop and {negatives} '
                         f'at a new place were attacked at most; with fewer than {_FEW_FRAMES} of '
                         'one kind its interval is wide, or too narrow if they lie in a few '
                         'blocks of time.')
    return texts
