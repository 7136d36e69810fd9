# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plot of loops lost over the queries an edit, as SVG."""

from __future__ import annotations

import matplotlib
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from adversarial_lcd_ros.evaluation.methods import method_facts
from adversarial_lcd_ros.evaluation.page import GRID, INK, NARROW, STYLE, svg
from adversarial_lcd_ros.evaluation.paper.effort import Effort
from adversarial_lcd_ros.evaluation.paper.plots import colour

# By rule for flips asked about before (config.RETRIES).
_DASHES = {'never': (0, (1.2, 1.6)), 'gained': '-', 'set': (0, (5, 2))}
_RULES = {'never': 'never asked again', 'gained': 'asked again if it gained',
          'set': 'never, three chosen at once'}
_LINE = 1.7


def draw_effort(effort: Effort, width: float) -> bytes:
    """
    Draw the share of loops lost: colours tell perturbations, dashes tell rules.

    Parameters
    ----------
    effort : Effort
    width : float
        Inches.

    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width, 3.6 if width > NARROW else 4.6), layout='constrained')
        axes = figure.subplots()
        for line in effort.lines:
            axes.plot(line.queries, [100 * share for share in line.lost],
                      color=colour(line.method), linestyle=_DASHES[line.rule],
                      linewidth=_LINE, markersize=4.5, marker=method_facts(line.method).marker)
        if effort.optimum is not None:
            axes.axhline(100 * effort.optimum, color=INK, linewidth=0.9)
            axes.annotate('optimum', (1.0, 100 * effort.optimum), xytext=(0, 3),
                          xycoords=('axes fraction', 'data'), textcoords='offset points',
                          ha='right', fontsize=8.0)
        ticks = sorted({count for line in effort.lines for count in line.queries})
        axes.set_xscale('log')
        axes.set(xlabel='queries an edit', ylabel='loops lost, %', xticks=ticks, ylim=(0, None))
        axes.set_xticklabels([str(count) for count in ticks])
        axes.minorticks_off()
        axes.grid(axis='y', color=GRID, linewidth=0.6)
        _legend(figure, effort, width)
        return svg(figure)


def _legend(figure: Figure, effort: Effort, width: float) -> None:
    methods = sorted({line.method for line in effort.lines},
                     key=lambda name: -method_facts(name).rank)
    rules = [rule for rule in _DASHES if any(line.rule == rule for line in effort.lines)]
    handles = [Line2D([], [], color=colour(name), marker=method_facts(name).marker,
                      markersize=4.5, linewidth=_LINE,
                      label=method_facts(name).title or name.replace('_', ' '))
               for name in methods]
    handles += [Line2D([], [], color=INK, linestyle=_DASHES[rule], linewidth=_LINE,
                       label=_RULES[rule]) for rule in rules]
    place = ({'loc': 'outside lower center', 'ncols': 2} if width <= NARROW
             else {'loc': 'outside right upper'})
    figure.legend(handles=handles, fontsize=8.0, **place)
