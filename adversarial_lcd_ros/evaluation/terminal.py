# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results on a terminal of 80 columns: a line an attack; the report has the rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.methods import whose
from adversarial_lcd_ros.evaluation.paper.headline import headline
from adversarial_lcd_ros.evaluation.paper.summaries import ATTACK, Summary, summarise_methods
from adversarial_lcd_ros.evaluation.paper.tables import main_ratio
from adversarial_lcd_ros.evaluation.paper.titles import full_title, usual_settings, usual_title
from adversarial_lcd_ros.evaluation.replay.findings import is_labelled

Rows = list[dict[str, str]]
ARROW = '→'


def replay_lines(summary: Mapping[str, Any]) -> tuple[str, Rows]:
    """
    Return title and rows of an evaluation of a replayed bag, in the order of the recipe.

    Parameters
    ----------
    summary : mapping
        From ``evaluation.replay.summary.summarise``.

    """
    name, attacks = summary['sequence'], summary['attacks']
    if not is_labelled(summary):
        return (f'Decisions changed on {name}, which has no ground truth: {summary["frames"]} '
                'frames', [{**_effort(attack, wording.attack_title(attack)),
                            'changed': str(attack['changed']),
                            'silenced': str(attack['silenced']), 'raised': str(attack['raised']),
                            'other match': str(attack['redirected'])} for attack in attacks])
    clean = summary['clean']['balanced_accuracy']
    return (f'Balanced accuracy on {name}, %: {summary["positives"]} frames with a loop, '
            f'{summary["negatives"]} at a new place',
            [{**_effort(attack, wording.attack_title(attack)),
              **_decline(clean, attack['balanced_accuracy'], attack['decline_pp'],
                         attack['decline_ci95'])} for attack in attacks])


def experiment_lines(cells: Sequence[Summary]) -> tuple[list[tuple[str, Rows]], str]:
    """
    Return a title and rows for each target, strongest attack first, and the main finding.

    Means over the sequences, with intervals over these; of one sequence that over its blocks.

    Parameters
    ----------
    cells : sequence of dict
        From ``summarise_cells``.

    """
    ratio = main_ratio(cells)
    every = summarise_methods(cells)
    methods = [method for method in every if method['ratio'] == ratio]
    usual = usual_settings(cells)
    tables = []
    for target in dict.fromkeys(method['target'] for method in methods):
        mine = sorted((method for method in methods if method['target'] == target),
                      key=lambda method: -float(method['decline_pp']))
        names = sorted({name for method in mine for name in method['sequences']})
        tables.append((
            f'Balanced accuracy of {target}, %; r = {ratio:g}, {usual_title(usual)}, mean of '
            f'{len(names)} sequence{"s" * (len(names) > 1)}',
            [{**_effort(method, full_title(method, usual)),
              **_decline(method['balanced_clean'], method['balanced_attacked'],
                         method['decline_pp'], _interval(method, cells))} for method in mine]))
    return tables, headline(every, ratio)


def _interval(method: Summary, cells: Sequence[Summary]) -> Sequence[float] | None:
    found: Sequence[float] | None = method['ci95']
    if len(method['sequences']) > 1:
        return found
    return next((cell['ci95'] for cell in cells if cell['sequence'] in method['sequences']
                 and all(cell[name] == method[name] for name in ATTACK)), found)


def _effort(attack: Mapping[str, Any], title: str) -> dict[str, str]:
    moved = attack.get('nodes_moved_mean')
    edits = f'{wording.mean_count(moved)} nodes' if moved else wording.mean_count(
        attack['edits_mean'])
    return {'attack': title, 'whose': whose(attack), 'edits': edits,
            'queries': wording.mean_count(attack['queries_mean'])}


def _decline(before: float | None, after: float | None, decline: float | None,
             bounds: Sequence[float] | None) -> dict[str, str]:
    share = [wording.UNDEFINED if value is None else f'{100 * value:.1f}'
             for value in (before, after)]
    interval = f' ({wording.interval(bounds)})' if bounds else ''
    return {f'before {ARROW} after': f' {ARROW} '.join(share),
            'decline (95 %)': f'{wording.points(decline)}{interval}'}
