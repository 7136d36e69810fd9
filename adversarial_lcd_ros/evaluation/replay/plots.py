# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plots of the report, as SVG."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.evaluation.page import (
    CLEAN_COLOUR,
    GRID,
    NARROW,
    STYLE,
    attack_colour,
    svg,
)
from adversarial_lcd_ros.evaluation.replay.records import QueryRecord, column
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE, UNTOLD

# In equal steps of log odds.
THRESHOLDS = 1 / (1 + np.exp(-np.linspace(-7, 7, 281)))
_LOOP_SHADE, _NEW_SHADE = '#dcebd9', '#e9e9ee'
_ROW_HEIGHT = 1.7
_Y_LIMITS = (-0.03, 1.15)  # above 1 is room for the marks

_DOWN, _UP = ('suppressed', 'diverted', 'silenced', 'redirected'), ('invented', 'raised')

Run = tuple[str, Sequence[QueryRecord]]


def decline_over_threshold(clean: Sequence[QueryRecord], attacks: Sequence[Run],
                           threshold: float) -> bytes | None:
    """
    Draw what each attack takes from balanced accuracy by threshold; None if a class is empty.

    The same probabilities, held against other thresholds than the detector's; the attacks did
    their best against that one. Probabilities lie so near to 0 and 1 that the axis is in log odds.

    Parameters
    ----------
    clean : sequence of QueryRecord
        Records of the clean run.
    attacks : sequence of (title, records)
        Attacked runs in the order of the tables.
    threshold : float
        The detector's.

    """
    before = _balanced_accuracies(clean)
    if not attacks or np.isnan(before).all():
        return None
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(NARROW, 3.3), layout='constrained')
        axes = figure.subplots()
        axes.axhline(0, color=GRID, linewidth=1.0)
        axes.axvline(threshold, color='#9aa0a8', linewidth=0.8, linestyle=(0, (4, 3)))
        for index, (title, run) in enumerate(attacks):
            axes.plot(THRESHOLDS, 100 * (before - _balanced_accuracies(run)), linewidth=1.6,
                      color=attack_colour(index), label=title)
        axes.set(xlabel="threshold (dashed: the detector's)", ylabel='decline, points',
                 xscale='logit', xlim=(THRESHOLDS[0], THRESHOLDS[-1]))
        axes.xaxis.set_major_locator(FixedLocator([0.001, 0.01, 0.1, 0.5, 0.9, 0.99, 0.999]))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.grid(color=GRID, linewidth=0.6)
        figure.legend(loc='outside upper left', fontsize=8.0)
        return svg(figure)


def _balanced_accuracies(run: Sequence[QueryRecord]) -> NDArray[np.float64]:
    """Return balanced accuracy at each of THRESHOLDS; nan if a class is empty."""
    kind, probability = column(run, 'label'), column(run, 'probability').astype(np.float64)
    correct, untold = column(run, 'match_correct').astype(bool), column(run, 'match_is') == UNTOLD
    declared = probability >= THRESHOLDS[:, None]
    scored = ~(declared & untold)
    with np.errstate(invalid='ignore'):
        found, silent = ((right & scored)[:, kind == value].sum(1)
                         / scored[:, kind == value].sum(1)
                         for right, value in ((declared & correct, POSITIVE),
                                              (~declared, NEGATIVE)))
    balanced: NDArray[np.float64] = (found + silent) / 2
    return balanced


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
        As for ``decline_over_threshold``.
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
