# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The main finding of the paper's experiments in plain sentences, computed from the cells."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.methods import is_yardstick, whose
from adversarial_lcd_ros.evaluation.paper.summaries import Summary
from adversarial_lcd_ros.evaluation.paper.tables import PAPER_PERTURBATION, PAPER_SURROGATE
from adversarial_lcd_ros.registry import TARGETS

TIE_PP = 0.05  # what is printed as equal is equal
_OWNERS = {'paper': "the paper's own", 'ours': "this project's own", 'other': "another's",
           'control': 'a control'}
_JUDGED = {'frames': 'against the map', 'pairs': 'by pairs'}


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
    # Of those that took the same the one with the usual settings.
    return max(there, key=lambda method: (method['decline_pp'], method['queries_per_edit']
                                          == AttackConfig.queries_per_edit,
                                          not method['variant']), default=None)


def _kind_of(method: Summary) -> tuple[Any, ...]:
    """Return what declines hang on most, whatever the attack."""
    return method['nodes'], method['threshold'], method['judged']


def main_target(methods: Sequence[Summary]) -> str | None:
    """Return the first target, in the usual order, that was attacked."""
    there = {method['target'] for method in methods}
    return next((name for name in (*TARGETS, *sorted(there)) if name in there), None)


def headline(methods: Sequence[Summary], ratio: float, cells: Sequence[Summary] = ()) -> str:
    """Return the main finding at a perturbation ratio, and what the paper's own attack took."""
    return ''.join(findings(methods, ratio, cells))


def findings(methods: Sequence[Summary], ratio: float,
             cells: Sequence[Summary] = ()) -> tuple[str, str]:
    """Return the main finding of ``headline``, and apart from it what belongs beside it."""
    here = [method for method in methods if method['ratio'] == ratio]
    target = main_target(here)
    best = strongest(here, target)
    if best is None:
        return ('No attack was measured on a sequence with both loops and new places.'
                f'{_without_decline([cell for cell in cells if cell["ratio"] == ratio])}', '')
    count = len(best['sequences'])
    over = 'one sequence' if count == 1 else f'{count} sequences'
    title = f'{_name(best)}, {best["nodes"]} features'
    accuracy = (f'from {wording.percent(best["balanced_clean"])} to '
                f'{wording.percent(best["balanced_attacked"])}')
    share = best['share_of_optimum']
    yardstick = '' if share is None else (f' It took {wording.percent(share, 0)} of what the '
                                          'greedy optimum over all flips takes.')
    papers = _papers_own(here, best)
    if best['decline_pp'] < TIE_PP:
        return (f'No black-box attack lowered the balanced accuracy of {target} on {over} at '
                f'r = {ratio:g} and {_condition(best)}; the strongest was {title}, {accuracy}.',
                papers)
    bounds = best['ci95']
    doubt = (' One sequence says nothing about others.' if bounds is None else
             ' So few sequences leave open whether it holds on others.' if bounds[0] <= 0 else '')
    owner = _OWNERS.get(whose(best))
    return (f'At r = {ratio:g} the strongest black-box attack on target {target} ({title})'
            f'{f", {owner}," if owner else ""} took {wording.points(best["decline_pp"])} points '
            f'of balanced accuracy on average over {over}{_interval(best)}, {accuracy}, at '
            f'{_condition(best)}.{doubt}', f'{yardstick}{papers}')


def papers_own(methods: Sequence[Summary]) -> Summary | None:
    """
    Return the paper's own attack, by eigencentrality, where it took most; None without.

    With its usual settings, if it has such: of many variants the best would be a lucky one.
    """
    own = [method for method in methods if method['perturbation'] == PAPER_PERTURBATION
           and method['mode'] == 'query' and method['asked_target'] == method['target']
           and whose(method) == 'paper']
    usual = [method for method in own if method['surrogate'] == PAPER_SURROGATE
             and method['queries_per_edit'] == AttackConfig.queries_per_edit
             and not method['variant'] and method['edits'] == AttackConfig.edits
             and method['oracle'] == 'soft']
    return max(usual or own, key=lambda method: method['decline_pp'], default=None)


def _papers_own(methods: Sequence[Summary], best: Summary) -> str:
    """Return what the paper's attack took beside the strongest, and from which target most."""
    here = papers_own([method for method in methods if method['target'] == best['target']
                       and _kind_of(method) == _kind_of(best)])
    most = papers_own([method for method in methods
                       if all(method[name] == best[name] for name in ('nodes', 'threshold'))])
    told = ''
    if here is not None and here is not best:
        told = (f" The paper's own ({_name(here)}) took {wording.points(here['decline_pp'])} "
                f'points{_interval(here)}.')
    least = TIE_PP + (0.0 if here is None else max(here['decline_pp'], 0.0))
    if most is None or most is here or most['decline_pp'] < least:
        return told
    told += (f" The paper's own took most from target {most['target']} ({_name(most)}, "
             f'{most["nodes"]} features, {_condition(most)}): '
             f'{wording.points(most["decline_pp"])} points{_interval(most)}, from '
             f'{wording.percent(most["balanced_clean"])} to '
             f'{wording.percent(most["balanced_attacked"])}.')
    ahead = strongest([method for method in methods if _kind_of(method) == _kind_of(most)],
                      most['target'])
    if ahead is None or ahead['decline_pp'] - most['decline_pp'] < TIE_PP:
        return told
    return (f'{told} There {_name(ahead)} took most, {wording.points(ahead["decline_pp"])} '
            'points.')


def _name(method: Summary) -> str:
    """Return what an attack is, with what is not usual about it."""
    count = method['queries_per_edit']
    queries = (f', {count} {"query" if count == 1 else "queries"} an edit'
               if method['mode'] == 'query' and count != AttackConfig.queries_per_edit else '')
    variant = f', {method["variant"]}' if method['variant'] else ''
    return f'{wording.attack_title({**method, "name": None})}{queries}{variant}'


def _condition(method: Summary) -> str:
    judged = _JUDGED.get(method['judged'], f'by {method["judged"]}')
    return f'threshold {method["threshold"]:g}, judged {judged}'


def _interval(method: Summary) -> str:
    return f' (95 % interval {wording.interval(method["ci95"])})' if method['ci95'] else ''


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
