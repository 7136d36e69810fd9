# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Curves of the rings: over the budget of flips, over nodes moved, over the size of a poster."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np
from scipy.stats import binomtest

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.evaluation.page import ATTACK_COLOURS, GRID, STYLE, attack_colour, svg
from adversarial_lcd_ros.evaluation.rings.scene import SAME
from adversarial_lcd_ros.evaluation.rings.summaries import FLIPS, Summary

_APART = 0.025  # of a place on the axis, from line to line: intervals stand side by side


class Point(NamedTuple):
    """A figure and the bounds of its 95 % interval."""

    value: float
    low: float
    high: float


Line = dict[float, Point]
# By sequence, and by what else tells a line from others.
Lines = dict[tuple[str, str], Line]


def ring_curves(summary: Mapping[str, Any]) -> bytes:
    """
    Draw three columns from the content of summary.json, a row for each sequence; an SVG.

    Bars are 95 % intervals: of a bootstrap over frames, for posters Wilson's.
    """
    columns = [
        ('perturbation ratio r', 'decline, points', _over(summary['rows'], 'ratio', FLIPS)),
        ('nodes moved at most', 'decline, points', _over(summary['rows'], 'nodes', 'move_nodes')),
        ('poster, share of the frame', 'share of pairs fooled', _posters(summary['posters']))]
    sequences = list(dict.fromkeys(sequence for *_, lines in columns for sequence, _ in lines))
    rows = max(len(sequences), 1)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(12.0, 2.3 * rows + 1.9), layout='constrained')
        grid = figure.subplots(rows + 1, 3, squeeze=False, height_ratios=[2.3] * rows + [1.6])
        for (what, value, lines), panels in zip(columns, grid.T, strict=True):
            titles = list(dict.fromkeys(title for _, title in lines))
            for sequence, axes in zip(sequences, panels, strict=False):
                for number, title in enumerate(titles):
                    _draw(axes, lines.get((sequence, title), {}), title, number, len(titles))
                axes.set(xlabel=what, ylabel=value)
                _mark_places(axes, {place for line in lines.values() for place in line})
                axes.set_title(sequence, loc='left', fontsize=9.0)
                axes.grid(axis='y', color=GRID, linewidth=0.6)
            panels[-1].axis('off')
            if titles:
                panels[-1].legend(*panels[0].get_legend_handles_labels(), fontsize=7.5,
                                  loc='upper left')
        return svg(figure)


def _draw(axes: Axes, line: Line, title: str, number: int, lines: int) -> None:
    """Draw a line and its intervals, the number-th of some."""
    at = np.array(sorted(line)) * (1 + _APART * (number - (lines - 1) / 2))
    points = np.array([line[place] for place in sorted(line)]).reshape(-1, 3)
    colour = attack_colour(number)
    # Ever thinner: where lines are one, those beneath are seen beside it.
    axes.plot(at, points[:, 0], marker='o', markersize=4, color=colour, label=title,
              linewidth=max(1.0, 3.6 - 0.4 * number),
              linestyle='-' if number < len(ATTACK_COLOURS) else '--')
    axes.vlines(at, points[:, 1], points[:, 2], color=colour, linewidth=1.4, alpha=0.4)


def _mark_places(axes: Axes, places: set[float]) -> None:
    """Put every place on the axis; they about double from one to the next."""
    shown: list[float] = []
    for place in sorted(places):
        # The size of a whole graph is not the same on every sequence.
        if not shown or place > 1.2 * shown[-1]:
            shown.append(place)
    if shown:
        axes.set_xscale('log')
        axes.set_xticks(shown, [f'{place:.3g}' for place in shown])
        axes.minorticks_off()


def _over(rows: Sequence[Summary], what: str, kind: str) -> Lines:
    lines: Lines = defaultdict(dict)
    for row in rows:
        is_there = row['ring'] == FLIPS if kind == FLIPS else row['search'] == kind
        if is_there and row['decline_pp'] is not None and not row.get('sealed'):
            place = row['ratio'] if what == 'ratio' else row['node_budget_mean']
            name = row['attack'] if what == 'ratio' else row.get('moved') or row['search']
            of = '' if row['target'] == LcdConfig.target else f'{row["target"]}, '
            low, high = row['ci95'] or (row['decline_pp'],) * 2
            lines[row['sequence'], f'{of}{name}: {row["defence"]}'][place] = Point(
                row['decline_pp'], low, high)
    return {title: line for title, line in lines.items() if len(line) > 1}


def _posters(rows: Sequence[Summary]) -> Lines:
    lines: Lines = defaultdict(dict)
    for row in rows:
        if row['control'] == SAME and row['count'] == 1 and row['kind'] == 'cells' and (
                row['target'] == 'wl'):
            found = binomtest(row['to_poster'], row['pairs']).proportion_ci(method='wilson')
            lines[row['sequence'], f'{row["target"]}: {row["check"]}'][row['share']] = Point(
                row['to_poster'] / row['pairs'], found.low, found.high)
    return {title: line for title, line in lines.items() if len(line) > 1}
