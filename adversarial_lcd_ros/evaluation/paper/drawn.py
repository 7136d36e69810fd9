# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which plots the report on the paper's experiments has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from adversarial_lcd_ros.evaluation.page import NARROW, WIDE, data_uri
from adversarial_lcd_ros.evaluation.paper import curves, plots, tables
from adversarial_lcd_ros.evaluation.paper.effort import efforts, lost_by_one, orders
from adversarial_lcd_ros.evaluation.paper.effort_plot import draw_effort
from adversarial_lcd_ros.evaluation.paper.summaries import Summary
from adversarial_lcd_ros.evaluation.paper.tables import DeclineTable
from adversarial_lcd_ros.evaluation.store import Row

Plot = dict[str, str]


def plot(draw: Callable[[float], bytes], wide: float = WIDE) -> Plot:
    """Return a plot for wide and for narrow pages, each as a link that holds it."""
    return {name: data_uri(draw(width), 'svg+xml')
            for name, width in (('wide', wide), ('narrow', NARROW))}


def first_of_targets(group: Sequence[DeclineTable]) -> list[DeclineTable]:
    """Return the most complete table of each target that has several of the paper's columns."""
    first: dict[str, DeclineTable] = {}
    for table in group:
        papers = sum(value in table.values for value in table.printed.settings.values())
        if papers > 1:
            first.setdefault(table.setting['target'], table)
    return list(first.values()) or list(group[:1])


def report_plots(rows: Sequence[Row], cells: Sequence[Summary],
                 groups: Sequence[list[DeclineTable]], ratio: float) -> dict[str, Any]:
    """
    Return the plots by the names that the page has for them; what cannot be drawn is empty.

    Parameters
    ----------
    rows, cells
        Of the report.
    groups : sequence of list of DeclineTable
        Surrogates, perturbations, budgets.
    ratio : float
        Perturbation ratio of all but the budgets.

    """
    # Of the perturbations' settings, or else of the surrogates'.
    settings = [table.setting for table in
                first_of_targets(groups[1]) or first_of_targets(groups[0])]
    found = efforts(cells, ratio)
    return {
        'budget_plots': [(table.title, plot(partial(plots.budget_curves, table)))
                         for table in first_of_targets(groups[2])],
        'success_plots': _successes(rows, settings, ratio),
        'share_plots': _shares(cells, settings, ratio),
        'maps': [{'setting': _shared_title(targets.setting), 'transfer': targets.transfer,
                  'plot': plot(partial(plots.heat_map, targets.attacks, targets.targets,
                                       targets.declines))}
                 for targets in curves.target_maps(cells, ratio)],
        'efforts': [{'title': f'target {effort.setting["target"]}, '
                              f'{_shared_title(effort.setting)}',
                     'sequences': len(effort.sequences),
                     'plot': plot(partial(draw_effort, effort)), 'orders': orders(effort),
                     'by_one': lost_by_one(rows, effort, ratio)} for effort in found]}


def _successes(rows: Sequence[Row], settings: Sequence[Summary], ratio: float
               ) -> list[tuple[str, Plot]]:
    drawn = []
    for setting in (setting for setting in settings if setting['mode'] == 'query'):
        found = curves.query_curves(rows, setting, ratio)
        if found:
            drawn.append((tables.setting_title(setting), plot(partial(plots.success_curves,
                                                                      found))))
    return drawn


def _shares(cells: Sequence[Summary], settings: Sequence[Summary], ratio: float
            ) -> list[tuple[str, Plot]]:
    drawn = []
    for setting in settings:
        shares, methods = curves.optimum_shares(cells, setting, ratio)
        if shares:
            drawn.append((tables.setting_title(setting), plot(partial(plots.optimum_shares,
                                                                      shares, methods))))
    return drawn


def _shared_title(setting: Summary) -> str:
    judged = {'frames': 'judged against the map', 'pairs': 'judged by pairs'}
    rest = f', {setting["variant"]}' if setting['variant'] else ''
    return (f'{judged.get(setting["judged"], setting["judged"])}, {setting["nodes"]} features, '
            f'{setting["oracle"]} answers, threshold {setting["threshold"]:g}{rest}')
