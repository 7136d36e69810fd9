# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results of attacks beside defences, and of posters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jinja2 import TemplateError

from adversarial_lcd_ros.config import LabelConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.kinds.base import (
    INTERVAL,
    MEASURED,
    NUMBER,
    Figure,
    FigureTable,
    Results,
    ResultsKind,
)
from adversarial_lcd_ros.evaluation.results import SUMMARY
from adversarial_lcd_ros.evaluation.rings.report import KIND, SCHEMA, write_page
from adversarial_lcd_ros.evaluation.store import Row


class RingsResults(ResultsKind):
    """Rows are attacks beside a defence on a sequence, seeds together."""

    name = KIND
    schema = SCHEMA
    columns = {**dict.fromkeys(('sequence', 'target', 'attack', 'defence', 'ring', 'search',
                                'variant'), str),
               'ratio': MEASURED, 'threshold': MEASURED, 'ci95': INTERVAL,
               **dict.fromkeys(('positives', 'negatives', 'found_clean', 'silent_clean',
                                'suppressed', 'invented', 'invented_elsewhere'), int),
               **dict.fromkeys(('balanced_clean', 'balanced_attacked', 'decline_pp', 'edits_mean',
                                'nodes_moved_mean', 'node_budget_mean', 'queries_mean'), NUMBER)}
    main = 'decline'

    def check(self, results: Results) -> None:
        """See that rows and lists have their form; raises EvaluationError."""
        super().check(results)
        for name in ('worst', 'posters', 'prices'):
            entries = results.summary.get(name)
            if not isinstance(entries, list) or not all(isinstance(each, dict)
                                                        for each in entries):
                raise EvaluationError(f'{results.folder / SUMMARY} is damaged: expected a list '
                                      f'"{name}" of objects')

    def report(self, results: Results) -> Path:
        """Write rings.md, its curves and report.html from the summary."""
        try:
            return write_page(results.folder, results.summary)
        except (LookupError, TypeError, ValueError, TemplateError) as error:
            raise EvaluationError(f'{results.folder / SUMMARY} is damaged: {error!r}; run the '
                                  'evaluation again') from error

    def tables(self, results: Results) -> list[FigureTable]:
        """Return the declines, by sequence and target."""
        return [FigureTable(f'Decline in balanced accuracy on {sequence}, {target}', [{
            'attack': row['attack'], 'defence': row['defence'],
            'balanced accuracy': f'{wording.percent(row["balanced_clean"])} → '
                                 f'{wording.percent(row["balanced_attacked"])}',
            'decline, points': wording.points(row['decline_pp']),
            '95 % interval': wording.interval(row['ci95']) or wording.UNDEFINED}
            for row in results.rows if (row['sequence'], row['target']) == (sequence, target)])
            for sequence, target in dict.fromkeys((row['sequence'], row['target'])
                                                  for row in results.rows)]

    def figures(self, results: Results) -> list[Figure]:
        """Return the figures of every attack beside every defence."""
        figures = []
        for row in results.rows:
            title = _title(row)
            figures += [Figure.points(title, self.main, row['decline_pp'], row['ci95']),
                        Figure.share(title, 'balanced accuracy before', row['balanced_clean']),
                        Figure.share(title, 'balanced accuracy after', row['balanced_attacked']),
                        Figure(title, 'nodes changed, mean', row['nodes_moved_mean'])]
        return figures

    def conditions(self, results: Results) -> dict[str, Any]:
        """Return sequences, labels with the frames of each kind, and thresholds."""
        rows = results.rows
        return {'sequences': sorted({row['sequence'] for row in rows}),
                'labels': {**results.section(LabelConfig.title), **{
                    f'{row["sequence"]}: loops, new places': [row['positives'], row['negatives']]
                    for row in rows}},
                'thresholds': sorted({row['threshold'] for row in rows})}


def _title(row: Row) -> str:
    return (f'{row["sequence"]}, {row["target"]}, {row["defence"]}: {row["attack"]}, '
            f'r {row["ratio"]:g}{", " if row["variant"] else ""}{row["variant"]}')
