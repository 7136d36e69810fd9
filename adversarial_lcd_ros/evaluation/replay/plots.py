"""Plots of the report, as SVG."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
from matplotlib.figure import Figure
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.evaluation.page import CLEAN_COLOUR, GRID, STYLE, attack_colour, svg
from adversarial_lcd_ros.evaluation.replay.records import QueryRecord, column
from adversarial_lcd_ros.evaluation.replay.summary import run_metrics
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE

_LOOP_SHADE, _NEW_SHADE = '#dcebd9', '#e9e9ee'
_ROW_HEIGHT = 1.7
_Y_LIMITS = (-0.03, 1.15)  # above 1 is room for the marks

_DOWN, _UP = ('suppressed', 'diverted', 'silenced', 'redirected'), ('invented', 'raised')

Run = tuple[str, Sequence[QueryRecord]]


def precision_recall(clean: Sequence[QueryRecord], attacks: Sequence[Run]) -> bytes | None:
    """
    Draw precision over recall before and after each attack; None without positives.

    A dot marks what the detector's own threshold gives.

    Parameters
    ----------
    clean : sequence of QueryRecord
        Records of the clean run.
    attacks : sequence of (title, records)
        Attacked runs in the order of the tables.

    """
    runs = [('before', CLEAN_COLOUR, clean)]
    runs += [(title, attack_colour(index), run) for index, (title, run) in enumerate(attacks)]
    measured = [(title, colour, run_metrics(run)) for title, colour, run in runs]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(4.9, 3.7), layout='constrained')
        axes = figure.subplots()
        for title, colour, metrics in measured:
            curve = metrics.curve
            if curve is None:
                return None
            # The step to the left of each threshold keeps its precision.
            axes.step(np.r_[curve.recall, 0.0], np.r_[curve.precision, curve.precision[-1:]],
                      where='pre', color=colour, linewidth=1.6,
                      label=f'{title} (AP {metrics.average_precision:.3f})')
            if metrics.precision is not None and metrics.recall is not None:
                axes.plot(metrics.recall, metrics.precision, 'o', color=colour, markersize=5,
                          markeredgecolor='white', clip_on=False, zorder=3)
        axes.set(xlabel='recall', ylabel='precision', xlim=(0, 1), ylim=(0, 1.03))
        axes.grid(color=GRID, linewidth=0.6)
        axes.legend(loc='lower left', fontsize=8.0)
        return svg(figure)


def timeline(clean: Sequence[QueryRecord], attacks: Sequence[Run], threshold: float,
             width: float) -> bytes:
    """
    Draw the loop probability over the sequence, clean and attacked, one row an attack.

    Frames with a loop are shaded green, frames at a new place grey; what is not scored is
    white. Triangles mark suppressed (down) and invented (up) loops; without ground truth those
    silenced or redirected, and raised.

    Parameters
    ----------
    clean, attacks
        As for ``precision_recall``.
    threshold : float
        The detector's.
    width : float
        Inches.

    """
    time_s = (column(clean, 'stamp_ns') - clean[0].stamp_ns) * 1e-9
    with matplotlib.rc_context(STYLE):
        rows = max(len(attacks), 1)
        figure = Figure(figsize=(width, _ROW_HEIGHT * rows + 0.5), layout='constrained')
        panels = figure.subplots(rows, sharex=True, squeeze=False)[:, 0]
        for panel in panels:
            _shade(panel, time_s, column(clean, 'label'))
            panel.axhline(threshold, color='#9aa0a8', linewidth=0.8, linestyle=(0, (4, 3)))
            panel.plot(time_s, column(clean, 'probability'), color=CLEAN_COLOUR, linewidth=1.2)
            panel.set(ylim=_Y_LIMITS, yticks=(0, 0.5, 1), ylabel='probability')
        for index, (panel, (title, run)) in enumerate(zip(panels, attacks, strict=False)):
            panel.plot(time_s, column(run, 'probability'), color=attack_colour(index),
                       linewidth=1.0)
            _mark(panel, time_s, column(run, 'effect'), attack_colour(index))
            panel.set_title(title, loc='left', fontsize=9.0, color=attack_colour(index))
        panels[-1].set(xlabel='time in the sequence, seconds',
                       xlim=(time_s[0], max(time_s[-1], time_s[0] + 1e-3)))
        return svg(figure)


def _shade(panel: Any, time_s: NDArray[np.float64], kind: NDArray[np.int8]) -> None:
    for value, colour in ((POSITIVE, _LOOP_SHADE), (NEGATIVE, _NEW_SHADE)):
        panel.fill_between(time_s, *_Y_LIMITS, where=kind == value, step='mid', color=colour,
                           linewidth=0)


def _mark(panel: Any, time_s: NDArray[np.float64], effects: NDArray[np.str_],
          colour: str) -> None:
    for names, marker in ((_DOWN, 'v'), (_UP, '^')):
        chosen = np.isin(effects, names)
        panel.plot(time_s[chosen], np.full(int(chosen.sum()), 1.08), marker, color=colour,
                   markersize=4.0, markeredgewidth=0)
