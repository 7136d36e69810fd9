# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Maps in reports: a section of the replay's report, and a page of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import io
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure
import numpy as np

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.maps import plots
from adversarial_lcd_ros.evaluation.maps.cases import WHOLE, YOUNG, title_of
from adversarial_lcd_ros.evaluation.maps.plots import CHECKED_COLOUR, Shown, colour_of
from adversarial_lcd_ros.evaluation.maps.summary import KIND, SCHEMA
from adversarial_lcd_ros.evaluation.maps.tables import (
    all_tables,
    count,
    is_main,
    markdown,
    run_title,
    stage_title,
    with_interval,
)
from adversarial_lcd_ros.evaluation.page import NARROW, STYLE, WIDE, data_uri, load_template, svg
from adversarial_lcd_ros.evaluation.replay.records import CLEAN
from adversarial_lcd_ros.evaluation.results import (
    CONFIGURATION,
    ENVIRONMENT,
    REPORT,
    SUMMARY,
    read_json,
)
from adversarial_lcd_ros.evaluation.store import read_cells
from adversarial_lcd_ros.files.writing import write_bytes, write_text

STILLS, _STILL_DPI = ('.png', '.svg'), 100
_MOST_OTHERS = 2  # detectors beside the one that the worst attack fooled
FOLDER, TABLES = 'map', 'tables.md'  # in a results folder of a replay, and in that


def map_sections(folder: Path) -> list[str]:
    """
    Return the section on maps for the report of a results folder; nothing without maps.

    Raises
    ------
    EvaluationError
        The maps are damaged, or of another release.

    """
    place = folder / FOLDER
    return [render_section(place)] if (place / SUMMARY).is_file() else []


def report_maps(folder: Path) -> Path:
    """
    Write report.html and tables.md of a folder of maps anew; return the path of the report.

    Raises
    ------
    EvaluationError
        As ``map_sections``.

    """
    page = load_template('map.html.j2').render(
        summary=read_json(folder / SUMMARY), section=render_section(folder, alone=True),
        headline=headline(read_json(folder / SUMMARY)),
        configuration=read_json(folder / CONFIGURATION),
        environment=read_json(folder / ENVIRONMENT))
    write_text(folder / REPORT, page)
    write_text(folder / TABLES, markdown(all_tables(read_json(folder / SUMMARY))))
    return folder / REPORT


def render_section(folder: Path, alone: bool = False) -> str:
    """Return the section on the maps in a folder, as HTML; alone on its page, or in a report."""
    summary = _summary(folder)
    try:
        stages = [_stage(folder, summary, stage) for stage in (YOUNG, WHOLE)]
        values = {'summary': summary, 'stages': [stage for stage in stages if stage],
                  'tables': all_tables(summary), 'headline': headline(summary), 'alone': alone,
                  'untold': _untold(summary)}
    except (LookupError, TypeError, ValueError) as error:
        raise EvaluationError(f'{folder} holds no whole maps ({type(error).__name__}: {error}): '
                              'make them again') from error
    section: str = load_template('map_section.html.j2').render(values)
    return section


def _summary(folder: Path) -> dict[str, Any]:
    summary = read_json(folder / SUMMARY)
    if (summary.get('kind'), summary.get('schema')) != (KIND, SCHEMA):
        raise EvaluationError(f'{folder / SUMMARY} is not of the kind {KIND!r}, schema {SCHEMA}: '
                              'make the maps again')
    return summary


def _untold(summary: Mapping[str, Any]) -> list[tuple[str, int]]:
    """Return how many closures of each run could not be told, those with none left out."""
    return [(title_of(run['run'], run['setting']), run['untold'])
            for run in summary['runs'] if run['untold']]


def _stage(folder: Path, summary: Mapping[str, Any], stage: str) -> dict[str, Any] | None:
    shown = shown_maps(folder, summary, stage)
    if not shown:
        return None
    time_s = np.arange(shown[0].case['frames'], dtype=np.float64) * summary['period_s']
    return {'title': stage_title(shown[0].case), 'legend': [(one.title, one.colour)
                                                            for one in shown],
            'paths_wide': _uri(plots.draw_paths(shown)),
            'paths_narrow': _uri(plots.draw_paths(shown, NARROW)),
            'errors_wide': _uri(plots.draw_errors(shown, time_s, WIDE)),
            'errors_narrow': _uri(plots.draw_errors(shown, time_s, NARROW))}


def _uri(figure: Figure) -> str:
    with matplotlib.rc_context(STYLE):  # names of its parts are made when it is written
        return data_uri(svg(figure), 'svg+xml')


def shown_maps(folder: Path, summary: Mapping[str, Any], stage: str) -> list[Shown]:
    """
    Return the maps of a stage that are drawn.

    The clean run, the worst one as it was and checked, and that attack on other detectors.
    """
    kept = {case['key']: case for case in read_cells(folder)}
    cases = {_run_of(entry): {**kept[entry['key']], **entry}
             for entry in summary['shown'] if entry['stage'] == stage}
    worst = worst_run(summary)
    others = [run['setting'] for run in summary['runs']
              if run['run'] == worst['run'] and run['setting'] != worst['setting']]
    drawn = [(CLEAN, worst['setting'], False), _run_of(worst), (*_run_of(worst)[:2], True),
             *((worst['run'], setting, False) for setting in others[:_MOST_OTHERS])]
    names = list(dict.fromkeys(run['run'] for run in summary['runs']))
    return [Shown(run_title({'run': run, 'setting': setting, 'checked': checked}),
                  _colour(names.index(run), checked, others.index(setting) + 1
                          if setting in others else 0), cases[run, setting, checked])
            for run, setting, checked in dict.fromkeys(drawn)
            if (run, setting, checked) in cases]


def _colour(place: int, checked: bool, other: int) -> str:
    return CHECKED_COLOUR if checked else colour_of(place + other)


def _run_of(entry: Mapping[str, Any]) -> tuple[str, str, bool]:
    return entry['run'], entry['setting'], entry.get('checked', False)


def draw_still(folder: Path, output: Path) -> None:
    """
    Write the maps of a folder side by side, young ones where there are any.

    Parameters
    ----------
    folder : Path
        Of maps that were made.
    output : Path
        .png or .svg.

    Raises
    ------
    EvaluationError
        There are no maps.

    """
    if not (folder / SUMMARY).is_file():
        raise EvaluationError(f'{folder} has no maps: make them with "adversarial-lcd map '
                              f'{folder.parent}"')
    summary = _summary(folder)
    shown = (shown_maps(folder, summary, YOUNG) or shown_maps(folder, summary, WHOLE))
    stream = io.BytesIO()
    with matplotlib.rc_context(STYLE):
        plots.draw_paths(shown).savefig(stream, format=output.suffix[1:], dpi=_STILL_DPI)
    output.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(output, stream.getvalue())


def worst_run(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return the attack with the most false closures; the clean run without attacks."""
    runs: list[dict[str, Any]] = summary['runs']
    attacks = [run for run in runs if run['run'] != CLEAN]
    return max(attacks or runs, key=lambda run: int(run['false']))


def headline(summary: Mapping[str, Any]) -> str:
    """Return in a sentence what the attack with the most false closures did to the young map."""
    worst = worst_run(summary)
    if worst['run'] == CLEAN:
        return ''
    main = [row for row in summary['rows'] if is_main(row) and not row['checked']
            and row['setting'] == worst['setting']]
    error = {(row['run'], row['back_end']): with_interval(row['ate_m'], row['ate_ci95'])
             for row in main if row['stage'] == main[0]['stage']}
    least, gnc = ((error[CLEAN, name], error[worst['run'], name])
                  for name in ('least_squares', 'gnc'))
    stage, frames = stage_title(main[0]).split(', ')
    return (f'Under {title_of(worst["run"], worst["setting"])}, with {count(_false(main, worst))} '
            f'false closures, the {stage} ({frames}) is off by {least[1]} m with least squares '
            f'(clean {least[0]} m), by {gnc[1]} m with GNC (clean {gnc[0]} m), and by '
            f'{error[CLEAN, "odometry"]} m with odometry alone.')


def _false(rows: Sequence[Mapping[str, Any]], worst: Mapping[str, Any]) -> float:
    """Return how many false closures the first map of a run got."""
    return float(next(row['false'] for row in rows if row['run'] == worst['run']))
