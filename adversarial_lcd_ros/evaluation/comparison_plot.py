# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The picture of a comparison: the main figure of every row, one mark a run."""

from __future__ import annotations

import matplotlib
from matplotlib.figure import Figure
import numpy as np

from adversarial_lcd_ros.evaluation.comparison import Comparison
from adversarial_lcd_ros.evaluation.page import CLEAN_COLOUR, GRID, STYLE, attack_colour, svg

MOST_ROWS = 40
_WIDTH, _ROW_HEIGHT, _HEAD = 9.4, 0.32, 1.1  # inches
_SPREAD = 0.6  # of a row, between the first run and the last


def draw_comparison(comparison: Comparison) -> bytes | None:
    """
    Draw the main figure of every row with its intervals; None if no run defines it.

    Rows that changed most come first; at most ``MOST_ROWS`` are drawn.

    """
    lines = [line for line in comparison.figures if line.name == comparison.main
             and any(figure is not None and figure.value is not None for figure in line.figures)]
    if not lines:
        return None
    runs = range(len(comparison.runs))
    lines.sort(key=lambda line: -max(abs(line.difference(run) or 0.0) for run in runs))
    lines = lines[:MOST_ROWS]
    offset = np.linspace(-_SPREAD / 2, _SPREAD / 2, len(comparison.runs))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(_WIDTH, _ROW_HEIGHT * len(comparison.runs) * len(lines) + _HEAD),
                        layout='constrained')
        axes = figure.subplots()
        for run, title in enumerate(comparison.runs):
            colour = attack_colour(run - 1) if run else CLEAN_COLOUR
            axes.plot([], [], 'o', color=colour, label=title)
            for place, line in enumerate(lines):
                found = line.figures[run]
                if found is None or found.value is None:
                    continue
                height = place + offset[run]
                if found.interval is not None:
                    axes.plot(found.interval, (height, height), color=colour, linewidth=1.6)
                axes.plot(found.value, height, 'o', color=colour, markersize=5)
        axes.set_yticks(range(len(lines)), [line.row for line in lines])
        axes.set(xlabel=f'{comparison.main}, {lines[0].unit or "a number"} (95 % interval)',
                 ylim=(len(lines) - 0.5, -0.5))
        axes.grid(axis='x', color=GRID, linewidth=0.6)
        axes.legend(loc='lower center', bbox_to_anchor=(0.5, 1.0), fontsize=8.0)
        return svg(figure)
