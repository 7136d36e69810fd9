# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results of whole replays: one sequence, without and with every attack."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from adversarial_lcd_ros.config import LabelConfig, LcdConfig
from adversarial_lcd_ros.evaluation.kinds.base import (
    INTERVAL,
    NUMBER,
    Columns,
    Figure,
    FigureTable,
    Results,
    ResultsKind,
    check_columns,
)
from adversarial_lcd_ros.evaluation.maps.report import map_sections
from adversarial_lcd_ros.evaluation.replay.findings import is_labelled
from adversarial_lcd_ros.evaluation.replay.report import report_folder
from adversarial_lcd_ros.evaluation.replay.summary import KIND, SCHEMA, from_document
from adversarial_lcd_ros.evaluation.replay.tables import decline_rows, figure_rows
from adversarial_lcd_ros.evaluation.results import SUMMARY

_SEQUENCE: Columns = {'sequence': str, 'frames': int, 'positives': NUMBER, 'negatives': NUMBER,
                      'edges_mean': NUMBER, 'not_scored': dict}
# Nobody knows the settings of an attack that was only recorded.
_SETTING = (str, type(None))
_ATTACK: Columns = {
    'perturbation': _SETTING, 'surrogate': _SETTING, 'mode': _SETTING, 'ratio': NUMBER,
    'decline_ci95': INTERVAL,
    **dict.fromkeys(('edits_mean', 'queries_mean', 'decline_pp', 'suppressed', 'invented',
                     'invented_elsewhere', 'left_out',
                     'unattackable'), NUMBER)}
_SHARES = {'recall': 'recall', 'precision': 'precision'}
_EFFORT = {'suppressed': 'suppressed', 'invented': 'invented',
           'invented_elsewhere': 'invented, certainly elsewhere', 'edits_mean': 'edits, mean',
           'queries_mean': 'queries, mean'}


class ReplayResults(ResultsKind):
    """Rows are runs: first the clean one, then every attack."""

    name = KIND
    schema = SCHEMA
    columns = {'name': str, 'balanced_accuracy': NUMBER, 'balanced_accuracy_ci95': INTERVAL,
               **dict.fromkeys((*_SHARES, 'average_precision', 'accuracy', 'mcc', 'tp', 'tn',
                                'wrong_matches', 'declared_elsewhere',
                                'recall_at_100_precision'), NUMBER)}
    main = 'balanced accuracy'

    def check(self, results: Results) -> None:
        """See to what is true of the sequence, and of attacks alone, as well."""
        super().check(results)
        path = results.folder / SUMMARY
        check_columns(path, 'the sequence', results.summary, _SEQUENCE)
        for row in results.rows[1:]:
            check_columns(path, f'attack {row["name"]}', row, _ATTACK)

    def report(self, results: Results) -> Path:
        """Write report.html, with the maps where there are any."""
        return report_folder(results.folder, map_sections(results.folder))

    def tables(self, results: Results) -> list[FigureTable]:
        """Return the tables that "evaluate" prints."""
        summary = from_document(results.summary)
        return [FigureTable(f'The detector on {summary["sequence"]}',
                            figure_rows(summary)),
                FigureTable('Decline in balanced accuracy' if is_labelled(summary)
                            else 'Decisions changed', decline_rows(summary))]

    def figures(self, results: Results) -> list[Figure]:
        """Return the figures of every run."""
        figures = []
        for row in results.rows:
            run = row['name']
            figures += [Figure.share(run, self.main, row['balanced_accuracy'],
                                     row['balanced_accuracy_ci95'])]
            if 'decline_pp' in row:
                figures.append(Figure.points(run, 'decline', row['decline_pp'],
                                             row['decline_ci95']))
            figures += [Figure.share(run, text, row[name]) for name, text in _SHARES.items()]
            figures.append(Figure(run, 'average precision', row['average_precision']))
            figures += [Figure(run, text, row[name]) for name, text in _EFFORT.items()
                        if name in row]
        return figures

    def conditions(self, results: Results) -> dict[str, Any]:
        """Return sequence, labels and threshold."""
        summary = results.summary
        return {'sequences': [summary.get('sequence'), summary.get('frames')],
                'labels': {**results.section(LabelConfig.title),
                           'loops': summary.get('positives'),
                           'new places': summary.get('negatives')},
                'thresholds': results.section(LcdConfig.title).get('threshold')}
