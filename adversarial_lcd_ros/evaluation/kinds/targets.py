# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results of detectors before any attack."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.detectors.run import KIND, SCHEMA
from adversarial_lcd_ros.evaluation.detectors.tables import TABLES, target_tables
from adversarial_lcd_ros.evaluation.kinds.base import (
    INTERVAL,
    MEASURED,
    NUMBER,
    Figure,
    FigureTable,
    Results,
    ResultsKind,
)
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.files.writing import write_text

_FIGURES = {'average_precision': 'average precision', 'mcc': 'MCC',
            'recall_at_100_precision': 'recall at 100 % precision'}


class TargetsResults(ResultsKind):
    """Rows are targets on a sequence, by one protocol."""

    name = KIND
    schema = SCHEMA
    columns = {'sequence': str, 'target': str, 'protocol': str, 'nodes': int,
               'nodes_mean': MEASURED, 'scored': list, 'ci95': INTERVAL, 'labels': dict,
               **dict.fromkeys(('balanced_accuracy', 'positives', 'negatives', *_FIGURES),
                               NUMBER)}
    main = 'balanced accuracy'

    def report(self, results: Results) -> Path:
        """Write target.md."""
        path = results.folder / TABLES
        write_text(path, target_tables(results.rows))
        return path

    def tables(self, results: Results) -> list[FigureTable]:
        """Return the figures, by protocol."""
        return [FigureTable(protocol, [{
            'sequence': row['sequence'], 'n': f'{row["nodes_mean"]:.0f}', 'target': row['target'],
            self.main: wording.percent(row['balanced_accuracy']),
            '95 % interval': wording.interval(row['ci95'], 100.0) or wording.UNDEFINED,
            **{text: wording.number(row[name], 3) for name, text in _FIGURES.items()}}
            for row in results.rows if row['protocol'] == protocol])
            for protocol in dict.fromkeys(row['protocol'] for row in results.rows)]

    def figures(self, results: Results) -> list[Figure]:
        """Return the figures of every target."""
        figures = []
        for row in results.rows:
            title = _title(row)
            figures.append(Figure.share(title, self.main, row['balanced_accuracy'], row['ci95']))
            figures += [Figure(title, text, row[name]) for name, text in _FIGURES.items()]
        return figures

    def conditions(self, results: Results) -> dict[str, Any]:
        """Return sequences, labels with the frames or pairs of each kind, and thresholds."""
        rows = results.rows
        settings = results.configuration.get('sequences', [])
        return {'sequences': sorted({f'{row["sequence"]} {row["scored"]}' for row in rows}),
                'labels': {f'{row["sequence"]}, {row["protocol"]}': [
                    row['labels'], row['positives'], row['negatives']] for row in rows},
                'thresholds': sorted({entry['lcd']['threshold'] for entry in settings
                                      if isinstance(entry, dict)
                                      and isinstance(entry.get('lcd'), dict)
                                      and isinstance(entry['lcd'].get('threshold'), float)})}


def _title(row: Row) -> str:
    part = '' if row['scored'] == [0, 1] else f' scored {row["scored"]}'
    check = ', geometric check' if row.get('geometric_check') else ''
    return (f'{row["sequence"]}{part}, {row["nodes"]} features, {row["protocol"]}: '
            f'{row["target"]}{check}')
