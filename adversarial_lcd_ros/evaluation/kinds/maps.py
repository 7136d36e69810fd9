# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Maps of a replay: how far they are off, by run, stage and back end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from adversarial_lcd_ros.config import LabelConfig, LcdConfig, MapConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.kinds.base import (
    INTERVAL,
    MEASURED,
    NUMBER,
    Columns,
    Figure,
    FigureTable,
    Results,
    ResultsKind,
    check_columns,
)
from adversarial_lcd_ros.evaluation.maps import tables
from adversarial_lcd_ros.evaluation.maps.report import report_maps
from adversarial_lcd_ros.evaluation.maps.summary import KIND, SCHEMA
from adversarial_lcd_ros.evaluation.results import SUMMARY

_MAPS: Columns = {'sequence': str, 'frames': int, 'runs': list, 'shown': list, 'claims': list,
                  'period_s': MEASURED, 'first_loop': NUMBER}


class MapResults(ResultsKind):
    """Rows are maps of one run, stage, drift and back end, averaged over draws."""

    name = KIND
    schema = SCHEMA
    columns = {
        'run': str, 'setting': str, 'claims': str, 'stage': str, 'frames': int,
        'drift': MEASURED, 'back_end': str, 'draws': int, 'added': NUMBER, 'consistent': bool,
        'checked': bool, 'missing': NUMBER, 'ate_m': MEASURED,
        'ate_ci95': INTERVAL, 'excess_m': NUMBER, 'excess_ci95': INTERVAL,
        **dict.fromkeys(('right', 'false', 'right_kept', 'false_kept', 'duration_s'), MEASURED),
        **dict.fromkeys(('rpe_m', 'rpe_deg'), NUMBER)}
    main = 'absolute error'

    def check(self, results: Results) -> None:
        """See to what is true of all maps as well, and that stages and back ends are known."""
        super().check(results)
        path = results.folder / SUMMARY
        check_columns(path, 'the maps', results.summary, _MAPS)
        for number, row in enumerate(results.rows, 1):
            for name, known in (('stage', tables.STAGE_TITLES), ('claims', tables.CLAIM_TITLES),
                                ('back_end', tables.BACK_END_TITLES)):
                if row[name] not in known:
                    raise EvaluationError(f'{path} is damaged: {name} of row {number} is '
                                          f'{row[name]!r}; make it again')

    def report(self, results: Results) -> Path:
        """Write report.html anew from the summary and the cases beside it."""
        return report_maps(results.folder)

    def tables(self, results: Results) -> list[FigureTable]:
        """Return the tables that "map" prints."""
        return [FigureTable(title, rows) for title, rows in tables.all_tables(results.summary)]

    def figures(self, results: Results) -> list[Figure]:
        """Return the errors of every row, metres."""
        figures = []
        for row in results.rows:
            title = f'{tables.row_title(row)}, {tables.BACK_END_TITLES[row["back_end"]]}'
            bounds = row['ate_ci95']
            figures += [
                Figure(title, self.main, row['ate_m'],
                       None if bounds is None else (bounds[0], bounds[1])),
                Figure(title, 'relative error', row['rpe_m']),
                Figure(title, 'false closures kept', row['false_kept'])]
        return figures

    def conditions(self, results: Results) -> dict[str, Any]:
        """Return sequence, labels, threshold, and how odometry and closures were made."""
        return {'sequences': [results.summary.get('sequence'), results.summary.get('frames')],
                'labels': dict(results.section(LabelConfig.title)),
                'thresholds': results.section(LcdConfig.title).get('threshold'),
                'map': dict(results.section(MapConfig.title))}
