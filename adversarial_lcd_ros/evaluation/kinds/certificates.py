# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results of certificates: what no few flips can turn over."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from adversarial_lcd_ros.config import LabelConfig, LcdConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.certificates.page import write_page
from adversarial_lcd_ros.evaluation.certificates.run import CLASSES, KIND, SCHEMA
from adversarial_lcd_ros.evaluation.certificates.tables import (
    accuracy_lines,
    certified_lines,
    name_of,
    shown_flips,
)
from adversarial_lcd_ros.evaluation.kinds.base import (
    INTERVAL,
    MEASURED,
    Columns,
    Figure,
    FigureTable,
    Results,
    ResultsKind,
    check_columns,
)
from adversarial_lcd_ros.evaluation.results import SUMMARY
from adversarial_lcd_ros.evaluation.store import Row

_CLASS: Columns = {'frames': int, 'right': int, 'certified': list}


class CertificatesResults(ResultsKind):
    """Rows are detectors on a sequence."""

    name = KIND
    schema = SCHEMA
    columns = {**dict.fromkeys(('sequence', 'target', 'defences', 'changed', 'told_by'), str),
               **dict.fromkeys(('nodes', 'certify_ms'), MEASURED), 'budget': int,
               'classes': dict, 'accuracy': list, 'ci95': INTERVAL}
    main = 'certified balanced accuracy'

    def check(self, results: Results) -> None:
        """See to the classes of every row, and that all numbers of flips are there, as well."""
        super().check(results)
        path = results.folder / SUMMARY
        for number, row in enumerate(results.rows, 1):
            lists = [row['accuracy']]
            for name in CLASSES:
                found = row['classes'].get(name)
                check_columns(path, f'{name} of row {number}',
                              found if isinstance(found, dict) else {}, _CLASS)
                lists.append(found['certified'])
            if any(len(values) != row['budget'] + 1 for values in lists):
                raise EvaluationError(f'{path} is damaged: row {number} has not a figure for each '
                                      f'of 0 to {row["budget"]} flips; make it again')

    def report(self, results: Results) -> Path:
        """Write certificates.md and its picture from the summary."""
        return write_page(results.folder, results.rows,
                          results.configuration.get('command_line', []))

    def tables(self, results: Results) -> list[FigureTable]:
        """Return the tables of the page."""
        return [FigureTable('Frames certified', certified_lines(results.rows)),
                FigureTable('Certified balanced accuracy', accuracy_lines(results.rows))]

    def figures(self, results: Results) -> list[Figure]:
        """Return the certified accuracy of every row, at the budget and below, and by class."""
        return [figure for row in results.rows for figure in self._of(row)]

    def _of(self, row: Row) -> list[Figure]:
        title, budget = f'{row["sequence"]}, {name_of(row)}', row['budget']
        return [Figure.share(title, self.main, row['accuracy'][budget], row['ci95']),
                *(Figure.share(title, f'{self.main}, {flips} flips', row['accuracy'][flips])
                  for flips in (0, *shown_flips([row])[:-1])),
                *(Figure.share(title, f'{name}, certified',
                               found['certified'][budget] / found['frames'])
                  for name, found in row['classes'].items() if found['frames'])]

    def conditions(self, results: Results) -> dict[str, Any]:
        """Return sequences, labels with the frames of each class, and the budgets."""
        rows = results.rows
        return {'sequences': sorted({row['sequence'] for row in rows}),
                'labels': {**results.section(LabelConfig.title), **{
                    row['sequence']: [row['told_by'], *(
                        found['frames'] for found in row['classes'].values())] for row in rows}},
                'thresholds': results.section(LcdConfig.title).get('threshold'),
                'budgets': sorted({row['budget'] for row in rows})}
