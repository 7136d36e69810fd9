# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Curves of the rings: over the budget of flips, over nodes moved, over the size of a poster."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from adversarial_lcd_ros.evaluation.page import GRID, STYLE, attack_colour, svg
from adversarial_lcd_ros.evaluation.rings.scene import SAME
from adversarial_lcd_ros.evaluation.rings.summaries import FLIPS, Summary

Line = dict[float, float]


def ring_curves(summary: Mapping[str, Any]) -> bytes:
    """Draw three panels from the content of summary.json; an SVG."""
    panels = [
        ('perturbation ratio r', 'decline, points', _over(summary['rows'], 'ratio', FLIPS)),
        ('nodes moved at most', 'decline, points', _over(summary['rows'], 'nodes', 'move_nodes')),
        ('poster, share of the frame', 'pairs with a false loop', _posters(summary['posters']))]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(12.0, 4.2), layout='constrained')
        for axes, (what, value, lines) in zip(figure.subplots(1, 3), panels, strict=True):
            for number, (title, line) in enumerate(lines.items()):
                at = sorted(line)
                axes.plot(at, [line[place] for place in at], marker='o', markersize=4,
                          color=attack_colour(number), label=title)
            axes.set(xlabel=what, ylabel=value)
            axes.grid(axis='y', color=GRID, linewidth=0.6)
            if lines:
                axes.legend(fontsize=6.5, loc='upper center', bbox_to_anchor=(0.5, -0.2))
        return svg(figure)


def _over(rows: Sequence[Summary], what: str, kind: str) -> dict[str, Line]:
    lines: dict[str, Line] = defaultdict(dict)
    for row in rows:
        is_there = row['ring'] == FLIPS if kind == FLIPS else row['search'] == kind
        if is_there and row['decline_pp'] is not None:
            place = row['ratio'] if what == 'ratio' else row['node_budget_mean']
            name = row['attack'] if what == 'ratio' else row['search']
            lines[f'{row["sequence"]}: {name}, {row["defence"]}'][place] = row['decline_pp']
    return {title: line for title, line in lines.items() if len(line) > 1}


def _posters(rows: Sequence[Summary]) -> dict[str, Line]:
    lines: dict[str, Line] = defaultdict(dict)
    for row in rows:
        if row['control'] == SAME and row['count'] == 1 and row['kind'] == 'cells' and (
                row['target'] == 'wl'):
            lines[f'{row["sequence"]}: {row["target"]}, {row["check"]}'][row['share']] = (
                row['to_poster'] / row['pairs'])
    return {title: line for title, line in lines.items() if len(line) > 1}
