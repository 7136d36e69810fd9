# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Maps in reports: a section of the replay's report, and a page of their own."""

from __future__ import annotations

from collections.abc import Mapping
import io
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure
import numpy as np

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.maps import plots
from adversarial_lcd_ros.evaluation.maps.cases import WHOLE, YOUNG
from adversarial_lcd_ros.evaluation.maps.plots import CHECKED_COLOUR, Shown, colour_of
from adversarial_lcd_ros.evaluation.maps.summary import KIND, SCHEMA
from adversarial_lcd_ros.evaluation.maps.tables import (
    all_tables,
    is_main,
    markdown,
    metres,
    run_title,
    stage_title,
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
from adversarial_lcd_ros.evaluation.store import Row, read_cells
from adversarial_lcd_ros.files.writing import write_bytes, write_text

STILLS, _STILL_DPI = ('.png', '.svg'), 100
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
        summary=read_json(folder / SUMMARY), section=render_section(folder),
        configuration=read_json(folder / CONFIGURATION),
        environment=read_json(folder / ENVIRONMENT))
    write_text(folder / REPORT, page)
    write_text(folder / TABLES, markdown(all_tables(read_json(folder / SUMMARY))))
    return folder / REPORT


def render_section(folder: Path) -> str:
    """Return the section on the maps in a folder, as HTML."""
    summary = read_json(folder / SUMMARY)
    if (summary.get('kind'), summary.get('schema')) != (KIND, SCHEMA):
        raise EvaluationError(f'{folder / SUMMARY} is not of the kind {KIND!r}, schema {SCHEMA}: '
                              'make the maps again')
    try:
        stages = [_stage(folder, summary, stage) for stage in (YOUNG, WHOLE)]
        values = {'summary': summary, 'stages': [stage for stage in stages if stage],
                  'tables': all_tables(summary), 'headline': headline(summary)}
    except (LookupError, TypeError, ValueError) as error:
        raise EvaluationError(f'{folder} holds no whole maps ({type(error).__name__}: {error}): '
                              'make them again') from error
    section: str = load_template('map_section.html.j2').render(values)
    return section


def _stage(folder: Path, summary: Mapping[str, Any], stage: str) -> dict[str, Any] | None:
    shown = shown_maps(folder, summary, stage)
    if not shown:
        return None
    time_s = np.arange(shown[0].case['frames'], dtype=np.float64) * summary['period_s']
    return {'title': stage_title(shown[0].case), 'legend': [(one.title, one.colour)
                                                            for one in shown],
            'paths': _uri(plots.draw_paths(shown)),
            'errors_wide': _uri(plots.draw_errors(shown, time_s, WIDE)),
            'errors_narrow': _uri(plots.draw_errors(shown, time_s, NARROW))}


def _uri(figure: Figure) -> str:
    with matplotlib.rc_context(STYLE):  # names of its parts are made when it is written
        return data_uri(svg(figure), 'svg+xml')


def shown_maps(folder: Path, summary: Mapping[str, Any], stage: str) -> list[Shown]:
    """Return the clean run and the worst one, as it was and checked, of a stage."""
    cases = {(case['run'], case['checked']): case for case in read_cells(folder)
             if case['stage'] == stage and 'truth' in case and _is_of(case, summary)}
    names = [run['name'] for run in summary['runs']]
    worst = worst_run(summary)
    drawn = dict.fromkeys([(CLEAN, False), (worst, False), (worst, True)])
    return [Shown(run_title(cases[key]), CHECKED_COLOUR if key[1] else
                  colour_of(names.index(key[0])), cases[key]) for key in drawn if key in cases]


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
    summary = read_json(folder / SUMMARY)
    shown = (shown_maps(folder, summary, YOUNG) or shown_maps(folder, summary, WHOLE))
    stream = io.BytesIO()
    with matplotlib.rc_context(STYLE):
        plots.draw_paths(shown).savefig(stream, format=output.suffix[1:], dpi=_STILL_DPI)
    output.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(output, stream.getvalue())


def worst_run(summary: Mapping[str, Any]) -> str:
    """Return the attack with the most false closures; the clean run without attacks."""
    attacks = summary['runs'][1:] or summary['runs']
    return str(max(attacks, key=lambda run: int(run['false']))['name'])


def _is_of(case: Row, summary: Mapping[str, Any]) -> bool:
    # Cases of other settings may be there, too.
    return case['key'] in summary['shown']


def headline(summary: Mapping[str, Any]) -> str:
    """Return in a sentence what the attack with the most false closures did to the young map."""
    main = [row for row in summary['rows'] if is_main(row) and not row['checked']]
    if len(summary['runs']) < 2:
        return ''
    stage = main[0]['stage']
    worst = worst_run(summary)
    error = {(row['run'], row['back_end']): row['ate_m'] for row in main
             if row['stage'] == stage}
    least, gnc = ((error[CLEAN, name], error[worst, name]) for name in ('least_squares', 'gnc'))
    return (f'Under {worst}, the {stage_title(main[0]).split(",")[0]} is off by '
            f'{metres(least[1])} m with least squares ({metres(least[0])} m clean), by '
            f'{metres(gnc[1])} m with GNC ({metres(gnc[0])} m clean), and by '
            f'{metres(error[CLEAN, "odometry"])} m with odometry alone.')
