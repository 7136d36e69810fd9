# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The map as it is made anew after every few frames: a GIF or an MP4 of it bending."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import matplotlib
from matplotlib.animation import PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
import numpy as np

from adversarial_lcd_ros.config import BACK_ENDS, MapConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.evaluation.maps.cases import ODOMETRY, WHOLE, Case, run_case
from adversarial_lcd_ros.evaluation.maps.inputs import LEAST_FRAMES, read_inputs
from adversarial_lcd_ros.evaluation.maps.plots import (
    FALSE_COLOUR,
    MAP_COLOUR,
    Shown,
    draw_map,
    flat_axes,
    panel_size,
)
from adversarial_lcd_ros.evaluation.maps.run import make_tasks
from adversarial_lcd_ros.evaluation.maps.tables import BACK_END_TITLES
from adversarial_lcd_ros.evaluation.page import INK, STYLE
from adversarial_lcd_ros.evaluation.results import SUMMARY, read_json
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.evaluation.workers import Run
from adversarial_lcd_ros.sequences.sequence import Progress
from adversarial_lcd_ros.slam.library import gtsam

FORMATS = ('.gif', '.mp4')
_DPI, _PER_S = 80, 8.0
_LAST_SHOWN_S = 2.0


def animate(folder: Path, output: Path, config: MapConfig, workers: Run, *, run: str | None = None,
            steps: int = 60, seconds: float = 0.0, source: str | None = None,
            progress: Callable[[str], Progress] = lambda what: lambda done, total: None) -> str:
    """
    Write an animation of the maps of a run, by odometry and every back end; return the run.

    Parameters
    ----------
    folder : Path
        Results of the kind "replay".
    output : Path
        .gif or .mp4.
    config : MapConfig
        The first draw of its odometry is shown.
    workers : callable
        From ``local_workers``.
    run : str, optional
        The one with the most false closures, if none is named.
    steps : int
        Pictures; the map grows evenly from one to the next.
    seconds : float
        Of the sequence that are shown; 0: all.
    source, progress
        As for ``make_maps``.

    Raises
    ------
    ConfigError
        The run is not known, or gtsam is missing.

    """
    gtsam()
    inputs = read_inputs(folder, str(read_json(folder / SUMMARY)['sequence']), source)
    run = run or max(inputs.runs, key=lambda name: int(inputs.runs[name].pairs.is_false.sum()))
    if run not in inputs.runs:
        raise ConfigError(f'there is no run {run!r} in {folder}: expected one of '
                          f'{", ".join(inputs.runs)}')
    whole = len(inputs.frame)
    last = min(whole, round(seconds / inputs.period_s)) if seconds else whole
    lengths = np.unique(np.linspace(LEAST_FRAMES, max(last, LEAST_FRAMES), steps).astype(int))
    cases = [Case(run, WHOLE, frames, 1.0, 0) for frames in lengths.tolist()]
    tell, rows = progress('maps'), []
    for _, row in workers(run_case, make_tasks(inputs, cases, config, folder, progress)):
        rows.append(row)
        tell(len(rows), len(cases))
    rows.sort(key=lambda row: int(row['frames']))
    _write(output, rows, run, inputs.period_s)
    return run


def _write(output: Path, rows: Sequence[Row], run: str, period_s: float) -> None:
    truth = np.array(rows[-1]['truth'])
    axes = flat_axes(truth)
    columns = (ODOMETRY, *BACK_ENDS)
    width, height = panel_size(truth[:, axes])
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width * len(columns), height + 0.45), layout='constrained')
        FigureCanvasAgg(figure)
        panels = figure.subplots(1, len(columns))
        with _film(output, figure) as grab:
            for row in rows:
                # The whole path is shown from the start: the map grows into it.
                shown = Shown(run, MAP_COLOUR, {**row, 'truth': rows[-1]['truth']})
                for panel, back_end in zip(panels, columns, strict=True):
                    panel.clear()
                    draw_map(panel, shown, back_end, axes)
                    panel.set_title(BACK_END_TITLES[back_end], fontsize=9.0)
                figure.suptitle(
                    f'{run}: {row["frames"] * period_s:.0f} s, {row["right"]} right closures, '
                    f'{row["false"]} false', fontsize=9.0,
                    color=FALSE_COLOUR if row['false'] else INK)
                grab()
            for _ in range(round(_LAST_SHOWN_S * _PER_S)):
                grab()


@contextmanager
def _film(output: Path, figure: Figure) -> Iterator[Callable[[], Any]]:
    """Yield what takes a picture of the figure; the film appears whole or not at all."""
    draft = output.with_name(f'.{output.stem}.partial{output.suffix}')
    output.parent.mkdir(parents=True, exist_ok=True)
    try:
        with (_gif if output.suffix == '.gif' else _mp4)(draft, figure) as grab:
            yield grab
        draft.replace(output)
    finally:
        draft.unlink(missing_ok=True)


@contextmanager
def _gif(path: Path, figure: Figure) -> Iterator[Callable[[], Any]]:
    writer = PillowWriter(fps=int(_PER_S))
    with writer.saving(figure, str(path), _DPI):
        yield writer.grab_frame


@contextmanager
def _mp4(path: Path, figure: Figure) -> Iterator[Callable[[], Any]]:
    figure.set_dpi(_DPI)
    # The codec takes even sizes.
    size = tuple(int(side) // 2 * 2 for side in figure.canvas.get_width_height())
    film = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*'mp4v'), _PER_S, size)
    if not film.isOpened():
        raise ConfigError(f'{path}: this OpenCV writes no MP4; name a .gif instead')

    def grab() -> None:
        figure.canvas.draw()
        picture = np.asarray(figure.canvas.buffer_rgba())[:size[1], :size[0]]
        film.write(cv2.cvtColor(picture, cv2.COLOR_RGBA2BGR))

    try:
        yield grab
    finally:
        film.release()
