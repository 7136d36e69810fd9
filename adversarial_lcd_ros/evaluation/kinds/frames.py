# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results of many attacks on a sample of frames of several sequences."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from adversarial_lcd_ros.config import AttackConfig, BuilderConfig, LabelConfig
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
from adversarial_lcd_ros.evaluation.paper.report import write_paper_report
from adversarial_lcd_ros.evaluation.paper.summaries import CELL, KIND, SCHEMA, USUAL
from adversarial_lcd_ros.evaluation.results import SUMMARY
from adversarial_lcd_ros.evaluation.store import Row, read_cells

# Told by words of their own, or only where they are not this.
_IN_WORDS = ('sequence', 'target', 'perturbation', 'surrogate', 'mode')
_USUAL = {**USUAL, 'oracle': 'soft', 'edits': AttackConfig.edits, 'nodes': BuilderConfig.features,
          'queries_per_edit': AttackConfig.queries_per_edit}


class FramesResults(ResultsKind):
    """Rows are attacks on a sequence, seeds averaged; ``cells`` are the keys of those of each."""

    name = KIND
    schema = SCHEMA
    columns = {'sequence': str, 'target': str, 'perturbation': str, 'surrogate': str, 'mode': str,
               'ratio': MEASURED, 'threshold': MEASURED, 'seeds': int, 'ci95': INTERVAL,
               **dict.fromkeys(('balanced_clean', 'balanced_attacked', 'decline_pp', 'edits_mean',
                                'queries_mean', 'suppressed', 'invented'), NUMBER)}
    main = 'decline'

    def report(self, results: Results) -> Path:
        """Write report.html and the tables from the cells that the summary is of."""
        wanted = results.summary.get('cells')
        there = {row['key']: row for row in read_cells(results.folder)}
        missing = [key for key in wanted if key not in there] if isinstance(wanted, list) else []
        if not isinstance(wanted, list) or not wanted or missing:
            raise EvaluationError(f'{results.folder / SUMMARY} is of {len(missing)} cells that '
                                  'are not in cells.jsonl: run the evaluation again')
        return write_paper_report(results.folder, [there[key] for key in wanted])

    def tables(self, results: Results) -> list[FigureTable]:
        """Return the declines, by sequence."""
        tables = []
        for sequence in dict.fromkeys(row['sequence'] for row in results.rows):
            tables.append(FigureTable(f'Decline in balanced accuracy on {sequence}', [{
                'attack': f'{row["target"]}: {_title(row)}', 'seeds': str(row['seeds']),
                'balanced accuracy': f'{wording.percent(row["balanced_clean"])} → '
                                     f'{wording.percent(row["balanced_attacked"])}',
                'decline, points': wording.points(row['decline_pp']),
                '95 % interval': wording.interval(row['ci95']) or wording.UNDEFINED,
                'suppressed': wording.mean_count(row.get('suppressed')),
                'invented': wording.mean_count(row.get('invented'))}
                for row in results.rows if row['sequence'] == sequence]))
        return tables

    def figures(self, results: Results) -> list[Figure]:
        """Return the figures of every attack."""
        figures = []
        for row in results.rows:
            title = f'{row["sequence"]}, {row["target"]}: {_title(row)}'
            figures += [
                Figure.points(title, self.main, row['decline_pp'], row['ci95']),
                Figure.share(title, 'balanced accuracy before', row['balanced_clean']),
                Figure.share(title, 'balanced accuracy after', row['balanced_attacked']),
                Figure(title, 'edits, mean', row['edits_mean']),
                Figure(title, 'queries, mean', row['queries_mean'])]
        return figures

    def conditions(self, results: Results) -> dict[str, Any]:
        """Return sequences, labels with the frames of each kind, and thresholds."""
        return {'sequences': sorted({row['sequence'] for row in results.rows}),
                'labels': {**results.section(LabelConfig.title), **{
                    f'{row["sequence"]}: different loops, new places':
                        [row.get('different_positives'), row.get('different_negatives')]
                    for row in results.rows}},
                'thresholds': sorted({row['threshold'] for row in results.rows}, key=str)}


def _title(row: Row) -> str:
    """Return what the attack is, in words that do not depend on what else was run."""
    extra = [f'{name.replace("_", " ")} {row[name]:g}' if isinstance(row[name], float)
             else f'{name.replace("_", " ")} {row[name]}'
             for name in CELL if name in row and name not in _IN_WORDS
             and row[name] != _USUAL.get(name)
             and not (name == 'asked_target' and row[name] == row['target'])]
    return ', '.join([wording.attack_title({**row, 'name': ''}), *extra])
