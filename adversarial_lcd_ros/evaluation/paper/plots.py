# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plots of the report on the paper's experiments, as SVG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any, NamedTuple

import matplotlib
from matplotlib.figure import Figure
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.evaluation.methods import method_facts, surrogate_facts
from adversarial_lcd_ros.evaluation.page import GRID, INK, NARROW, STYLE, svg
from adversarial_lcd_ros.evaluation.paper.ranks import RankedMethod, Ranking
from adversarial_lcd_ros.evaluation.paper.tables import DeclineTable

_SPARE = ('#8c564b', '#5f6b73', '#b5739d', '#3a9ea5', '#9a8c2c')
_LINE, _SOFT = 1.6, '#9aa0a8'


class Curve(NamedTuple):
    """Share of right decisions turned over (0 to 1) within so many queries (ascending)."""

    title: str
    method: str
    surrogate: str
    queries: NDArray[np.float64]
    share: NDArray[np.float64]


def colour(method: str) -> str:
    """Return the colour of a perturbation or a search, the same in every plot."""
    spare = _SPARE[sum(method.encode()) % len(_SPARE)]  # as given by the name: no memory
    return method_facts(method).colour or spare


def budget_curves(table: DeclineTable, width: float) -> bytes:
    """
    Draw the mean decline over the ratio r, with the range over the sequences.

    Parameters
    ----------
    table : DeclineTable
        From ``budget_tables``.
    width : float
        Inches.

    """
    with matplotlib.rc_context(STYLE):
        figure, axes = _panel(width, 3.4)
        ratios = np.array([float(line.title) for line in table.lines])
        step = float(np.diff(ratios).min())
        for column, (value, title) in enumerate(zip(table.values, table.columns, strict=True)):
            entries = [(ratio, line.entries[column])
                       for ratio, line in zip(ratios, table.lines, strict=True)]
            there = [(ratio, entry) for ratio, entry in entries if entry is not None]
            # Side by side, so that the ranges can be told apart.
            at = np.array([ratio for ratio, _ in there]) + step * 0.02 * (
                column - (len(table.values) - 1) / 2)
            mean, low, high = (np.array([entry[name] for _, entry in there])
                               for name in ('decline_pp', 'least_pp', 'most_pp'))
            axes.vlines(at, low, high, color=colour(value), linewidth=3.0, alpha=0.3)
            axes.plot(at, mean, color=colour(value), linewidth=_LINE, label=title,
                      marker=method_facts(value).marker, markersize=5,
                      linestyle=method_facts(value).dash)
        axes.axhline(0.0, color=_SOFT, linewidth=0.8)
        axes.set(xlabel='perturbation ratio r', ylabel='mean decline, points',
                 xticks=ratios, xticklabels=[line.title for line in table.lines])
        axes.grid(axis='y', color=GRID, linewidth=0.6)
        _legend(axes, width)
        return svg(figure)


def success_curves(curves: Sequence[Curve], width: float) -> bytes:
    """
    Draw the share of right decisions turned over after so many queries.

    Parameters
    ----------
    curves : sequence of Curve
        Colours tell perturbations and searches, dashes tell surrogates.
    width : float
        Inches.

    """
    with matplotlib.rc_context(STYLE):
        figure, axes = _panel(width, 3.4)
        for curve in curves:
            axes.step(curve.queries, 100.0 * curve.share, where='post', linewidth=_LINE,
                      color=colour(curve.method), label=curve.title,
                      linestyle=surrogate_facts(curve.surrogate).dash)
        axes.set(xscale='log', xlabel='queries spent on a frame', ylim=(0, None),
                 ylabel='right decisions\nturned over, %' if width == NARROW
                 else 'right decisions turned over, %')
        axes.xaxis.set_major_formatter('{x:,.0f}')
        axes.xaxis.set_minor_formatter('')
        axes.grid(color=GRID, linewidth=0.6)
        _legend(axes, width)
        return svg(figure)


def critical_difference(ranking: Ranking, width: float) -> bytes:
    """
    Draw the critical-difference diagram of Demsar (2006): mean ranks, the best to the left.

    Bars join methods that are not told apart.

    Parameters
    ----------
    ranking : Ranking
    width : float
        Inches.

    """
    count, bars = len(ranking.methods), len(ranking.groups)
    half = (count + 1) // 2
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width, 1.0 + 0.2 * bars + 0.27 * half), layout='constrained')
        axes = figure.subplots()
        # Names to either side need room; more of it where the plot is narrow.
        room = (count - 1) * (0.62 if width <= NARROW else 0.3)
        axes.set(xlim=(1 - room, count + room), ylim=(-(0.45 * bars + 0.62 * half + 0.3), 1.5))
        axes.axis('off')
        axes.hlines(0, 1, count, color=INK, linewidth=1.0)
        for rank in range(1, count + 1):
            axes.vlines(rank, 0, 0.14, color=INK, linewidth=1.0)
            axes.text(rank, 0.22, str(rank), ha='center', va='bottom', fontsize=8.5)
        if ranking.critical_difference is not None:
            _scale(axes, ranking.critical_difference)
        for place, group in enumerate(ranking.groups):
            ranks = [method.mean_rank for method in ranking.methods if method.name in group]
            axes.hlines(-0.3 - 0.4 * place, min(ranks) - 0.03, max(ranks) + 0.03,
                        color='#b03326', linewidth=3.5)
        for place, method in enumerate(ranking.methods):
            left = place < half
            level = place if left else count - 1 - place
            _name(axes, method, count, left, -(0.45 * bars + 0.35 + 0.62 * level))
        return svg(figure)


def _name(axes: Any, method: RankedMethod, count: int, left: bool, y: float) -> None:
    end = 1 - 0.04 * (count - 1) if left else count + 0.04 * (count - 1)
    axes.plot([method.mean_rank, method.mean_rank, end], [0, y, y], color=_SOFT, linewidth=0.9,
              zorder=0)
    parts = [method.name, f'{method.mean_rank:.2f}']
    axes.text(end, y, f' {"  ".join(parts if left else parts[::-1])} ',
              ha='right' if left else 'left', va='center', fontsize=8.5)


def _scale(axes: Any, difference: float) -> None:
    axes.plot([1, 1 + difference], [1.0, 1.0], color=INK, linewidth=1.4, marker='|',
              markersize=7)
    axes.text(1 + difference / 2, 1.1, f'critical difference {difference:.2f}', ha='center',
              va='bottom', fontsize=8.5)


def heat_map(rows: Sequence[str], columns: Sequence[str], values: NDArray[np.float64],
             width: float) -> bytes:
    """
    Draw the mean decline of attacks (rows) on targets (columns).

    Parameters
    ----------
    rows, columns : sequence of str
        Their titles.
    values : float64, (rows, columns)
        Percentage points; NaN where nothing was measured.
    width : float
        Inches.

    """
    labels = _wrapped(rows, width)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width, _height(labels) + 0.7), layout='constrained')
        axes = figure.subplots()
        known = values[np.isfinite(values)]
        top = max(float(known.max(initial=0.0)), 1.0)
        palette = matplotlib.colormaps['Reds'].with_extremes(bad='#f1f2f4')
        axes.imshow(np.ma.masked_invalid(values), cmap=palette, vmin=0, vmax=1.25 * top,
                    aspect='auto')
        for (row, column), value in np.ndenumerate(values):
            text = f'{value + 0.0:.1f}' if np.isfinite(value) else '–'
            axes.text(column, row, text, ha='center', va='center', fontsize=8.5,
                      color='white' if value > 0.8 * top else INK)
        axes.set(xticks=range(len(columns)), xticklabels=columns, yticks=range(len(rows)),
                 yticklabels=labels)
        axes.tick_params(length=0, top=True, labeltop=True, bottom=False, labelbottom=False)
        axes.spines[:].set_visible(False)
        return svg(figure)


def optimum_shares(shares: Mapping[str, Mapping[str, float]], methods: Mapping[str, str],
                   width: float) -> bytes:
    """
    Draw for each attack the share of the optimum's decline: a dot a sequence, a bar the mean.

    Parameters
    ----------
    shares : mapping of str to mapping of str to float
        Attack to sequence to share, in the order of the rows; ``''`` holds the share of the
        mean declines.
    methods : mapping of str to str
        Attack to its perturbation or search, for the colour.
    width : float
        Inches.

    """
    with matplotlib.rc_context(STYLE):
        labels = _wrapped(list(shares), width)
        figure, axes = _panel(width, _height(labels) + 0.8)
        for row, (title, of) in enumerate(shares.items()):
            paint = colour(methods[title])
            axes.barh(row, 100.0 * of[''], height=0.5, color=paint, alpha=0.45)
            dots = [100.0 * share for sequence, share in of.items() if sequence]
            axes.plot(dots, [row] * len(dots), 'o', color=paint, markersize=4.5,
                      markeredgecolor='white', markeredgewidth=0.6)
        axes.axvline(0.0, color=_SOFT, linewidth=0.8)
        axes.axvline(100.0, color=_SOFT, linewidth=0.8, linestyle=(0, (4, 3)))
        axes.set(yticks=range(len(shares)), yticklabels=labels,
                 xlabel="share of the optimum's decline, %")
        axes.invert_yaxis()
        axes.tick_params(axis='y', length=0)
        axes.grid(axis='x', color=GRID, linewidth=0.6)
        axes.set_axisbelow(True)
        return svg(figure)


def _panel(width: float, height: float) -> tuple[Any, Any]:
    figure = Figure(figsize=(width, height), layout='constrained')
    return figure, figure.subplots()


def _wrapped(titles: Sequence[str], width: float) -> list[str]:
    return [fill(title, 20) if width <= NARROW else title for title in titles]


def _height(labels: Sequence[str]) -> float:
    # Inches of as many rows, each with room for the lines of the longest label.
    lines = max((label.count('\n') + 1 for label in labels), default=1)
    return max(0.34, 0.17 * lines + 0.04) * len(labels)


def _legend(axes: Any, width: float) -> None:
    # Below on a phone, where nothing is left beside the curves.
    place = ({'loc': 'upper center', 'bbox_to_anchor': (0.45, -0.2), 'ncols': 2}
             if width <= NARROW else {'loc': 'upper left', 'bbox_to_anchor': (1.0, 1.0)})
    axes.legend(fontsize=8.0, **place)
