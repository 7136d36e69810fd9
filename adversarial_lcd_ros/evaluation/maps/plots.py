# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of maps: paths side by side, and how far each frame is off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import matplotlib
from matplotlib.figure import Figure
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import BACK_ENDS
from adversarial_lcd_ros.evaluation.maps.cases import ODOMETRY
from adversarial_lcd_ros.evaluation.maps.tables import BACK_END_TITLES, metres
from adversarial_lcd_ros.evaluation.page import CLEAN_COLOUR, GRID, INK, STYLE, attack_colour
from adversarial_lcd_ros.evaluation.store import Row

# Red is for false closures alone: all maps have one colour.
TRUTH_COLOUR, ODOMETRY_COLOUR, MAP_COLOUR, FALSE_COLOUR = (
    '#c9cdd4', '#8c6d46', '#1f4e79', '#d62728')
CHECKED_COLOUR = '#2e8064'
_PANEL, _LINE = 1.9, 0.12  # inches: a panel, and a line of text
_TITLE, _LETTERS = 20, 12  # characters of a title on a line, and on an inch of it
_MARGIN = 0.08  # of the extent, on every side
_SIMPLER = 0.5  # of a point: what nobody sees of a path is left out
_FALSE_WIDTH, _TRUTH_WIDTH, _MAP_WIDTH = 0.7, 2.6, 1.2


@dataclass(frozen=True)
class Shown:
    """
    A map to draw.

    Attributes
    ----------
    title : str
        What it is of.
    colour : str
        Of the run, in plots over time.
    case : Row
        From cells.jsonl, with its paths.

    """

    title: str
    colour: str
    case: Row


def colour_of(place: int) -> str:
    """Return the colour of a run by its place among the runs, the clean one first."""
    return attack_colour(place - 1) if place else CLEAN_COLOUR


def flat_axes(path: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the two axes along which a path is longest, in their order."""
    axes: NDArray[np.int64] = np.sort(np.argsort(np.ptp(path, axis=0))[-2:])
    return axes


def draw_paths(shown: Sequence[Shown], width: float | None = None) -> Figure:
    """
    Draw odometry and maps over the truth, a row for each run, a column for each back end.

    Declared closures that certainly name another place are red lines between the poses that they
    pull together, thin where the back end rejected them.

    Parameters
    ----------
    shown : sequence of Shown
    width : float, optional
        Inches; then runs are the columns, which fits a narrow page.

    """
    columns = (ODOMETRY, *BACK_ENDS)
    truth = np.array(shown[0].case['truth'])
    axes = flat_axes(truth)
    upright = width is not None
    wide, high = panel_size(truth[:, axes], width and (width - 0.3) / len(shown))
    # A title is as long as the side of its panel.
    letters = int(_LETTERS * wide) if upright else _TITLE
    run_titles = [f'{fill(one.title, letters)}\n'
                  + _closures(one.case, ',\n' if upright else ', ') for one in shown]
    back_ends = [fill(BACK_END_TITLES[back_end], letters) for back_end in columns]
    counts = (len(columns), len(shown)) if upright else (len(shown), len(columns))
    lines = max(title.count('\n') for title in run_titles) if upright else 0
    with matplotlib.rc_context({**STYLE, 'path.simplify_threshold': _SIMPLER}):
        figure = Figure(figsize=(wide * counts[1] + 0.3,
                                 high * counts[0] + 0.35 + _LINE * lines), layout='constrained')
        panels = figure.subplots(*counts, squeeze=False)
        for row, one in zip(panels.T if upright else panels, shown, strict=True):
            for panel, back_end in zip(row, columns, strict=True):
                draw_map(panel, one, back_end, axes)
        tops, sides = (run_titles, back_ends) if upright else (back_ends, run_titles)
        for panel, text in zip(panels[0], tops, strict=True):
            panel.set_title(text, fontsize=7.5 if upright else 9.0)
        for panel, text in zip(panels[:, 0], sides, strict=True):
            panel.set_ylabel(text, fontsize=8.0)
    return figure


def panel_size(flat: NDArray[np.float64], wide: float | None = None) -> tuple[float, float]:
    """Return width and height of a panel for a path (n, 2), inches."""
    wide = wide or _PANEL
    across, up = np.ptp(flat, axis=0) + 1e-9
    return wide, float(np.clip(wide * up / across, 0.4 * wide, 1.4 * wide)) + 0.25


def _closures(case: Row, between: str) -> str:
    return f'{case["right"]} right{between}{case["false"]} false'


def draw_map(panel: Any, one: Shown, back_end: str, axes: NDArray[np.int64]) -> None:
    """Draw the map of a back end over the truth into a panel."""
    truth = np.array(one.case['truth'])[:, axes]
    found = one.case['back_ends'][back_end]
    path = np.array(found['path'])[:, axes]
    is_odometry = back_end == ODOMETRY
    panel.plot(*truth.T, color=TRUTH_COLOUR, linewidth=_TRUTH_WIDTH, solid_capstyle='round')
    if not is_odometry:
        draw_false(panel, one.case['closures'], found['kept'], path)
    panel.plot(*path.T, color=ODOMETRY_COLOUR if is_odometry else MAP_COLOUR,
               linewidth=_MAP_WIDTH)
    # Red where the robot would have been better off without any closure.
    is_worse = found['ate_m'] > one.case['back_ends'][ODOMETRY]['ate_m']
    panel.set_xlabel(f'{metres(found["ate_m"])} m', fontsize=8.5,
                     color=FALSE_COLOUR if is_worse else INK)
    fix_panel(panel, truth)


def draw_false(panel: Any, closures: Sequence[Sequence[Any]], kept: Sequence[int],
               path: NDArray[np.float64]) -> None:
    """Draw false closures between the poses that they join."""
    for value, alpha in ((0, 0.28), (1, 0.9)):
        lines = [np.vstack([path[[query, match]], [[np.nan, np.nan]]])
                 for (query, match, is_false), was_kept in zip(closures, kept, strict=True)
                 if is_false and was_kept == value]
        if lines:  # in one piece: of hundreds of lines each would weigh more than its numbers
            panel.plot(*np.concatenate(lines).T, color=FALSE_COLOUR, linewidth=_FALSE_WIDTH,
                       alpha=alpha)


def fix_panel(panel: Any, truth: NDArray[np.float64]) -> None:
    """Give a panel the extent of the truth, and no ticks."""
    low, high = truth.min(axis=0), truth.max(axis=0)
    # A path may leave the picture; its panel stays comparable with the others.
    margin = max(_MARGIN * float((high - low).max()), 1e-3)
    panel.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin),
              xticks=(), yticks=(), aspect='equal')
    for spine in panel.spines.values():
        spine.set(visible=True, color=GRID)


def draw_errors(shown: Sequence[Shown], time_s: NDArray[np.float64], width: float) -> Figure:
    """
    Draw how far every frame is off after alignment, metres, a panel for each back end.

    Parameters
    ----------
    shown : sequence of Shown
        Maps of one stage.
    time_s : float64, (n,)
        Of the frames, from the first one.
    width : float
        Inches.

    """
    rows = (len(BACK_ENDS) + 1) // 2
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width, 1.75 * rows + 0.3), layout='constrained')
        panels = figure.subplots(rows, 2, sharex=True, sharey=True, squeeze=False).ravel()
        for panel, back_end in zip(panels, BACK_ENDS, strict=True):
            odometry = _off(shown[0].case, ODOMETRY)
            panel.plot(time_s[:len(odometry)], odometry, color=ODOMETRY_COLOUR, linewidth=1.0,
                       linestyle=(0, (4, 2)))
            for number, one in enumerate(shown):
                off = _off(one.case, back_end)
                # Where two maps are the same, the one below is seen on both sides of the other.
                below = 1 - number / max(len(shown) - 1, 1)
                panel.plot(time_s[:len(off)], off, color=one.colour, linewidth=1.1 + 2.0 * below)
            panel.set_title(BACK_END_TITLES[back_end], loc='left', fontsize=9.0)
            panel.set_yscale('log')
            panel.grid(color=GRID, linewidth=0.6)
        for panel in panels[::2]:
            panel.set_ylabel('error, metres')
        figure.supxlabel('time in the sequence, seconds', fontsize=9.0)
    return figure


def _off(case: Row, back_end: str) -> NDArray[np.float64]:
    off = np.linalg.norm(np.array(case['back_ends'][back_end]['path']) - np.array(case['truth']),
                         axis=1)
    # The logarithm of nothing: what is below a millimetre was rounded away.
    shown: NDArray[np.float64] = np.maximum(off, 1e-3)
    return shown
