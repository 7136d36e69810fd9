# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What became of the paper's claims, and what to know first, in sentences made of the cells."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.paper.headline import TIE_PP
from adversarial_lcd_ros.evaluation.paper.printed import BUDGET_TABLE
from adversarial_lcd_ros.evaluation.paper.ranks import Ranking
from adversarial_lcd_ros.evaluation.paper.summaries import Summary, is_attackable
from adversarial_lcd_ros.evaluation.paper.tables import DeclineTable

PAPER_SEEDS = 10
_FEW_FRAMES = 30
_MANY_TABLES = 3


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
    if abs(declines[ours[0]] - declines[ours[-1]]) < TIE_PP:
        return (f"The paper's ranking ({theirs}) does not come out: all took the same, "
                f'{wording.points(declines[ours[0]])} points.')
    in_order = all(declines[first] - declines[second] >= TIE_PP
                   for first, second in pairwise(expected))
    leads = all(declines[expected[0]] - declines[other] >= TIE_PP for other in expected[1:])
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
            leads += all(declines[ahead] - declines[value] >= TIE_PP
                         for value in paper if value != ahead)
    title = dict(zip(table.values, table.columns, strict=True))[ahead]
    return (f"Of the paper's perturbations {title} takes most at {leads} of {ratios} ratios here; "
            'in the paper at all three.')


def _order(names: Sequence[str], declines: Sequence[float]) -> str:
    # Names with their declines, the strongest first; equal to the printed digit: "=".
    parts = [f'{names[0]} {wording.points(declines[0])}']
    for (before, decline), name in zip(pairwise(declines), names[1:], strict=True):
        sign = '=' if before - decline < TIE_PP else '>'
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
