# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results of labelling a sequence."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from adversarial_lcd_ros.evaluation.kinds.base import Figure, FigureTable, Results, ResultsKind
from adversarial_lcd_ros.evaluation.labels.page import render_page
from adversarial_lcd_ros.evaluation.labels.run import KIND, SCHEMA
from adversarial_lcd_ros.evaluation.outcomes import FRAME_KINDS

_PAIRS = ('loop_pairs', 'right_pairs', 'scaled_pairs', 'wrong_pairs')


class LabelsResults(ResultsKind):
    """One row: how many frames and pairs of each kind a sequence has."""

    name = KIND
    schema = SCHEMA
    columns = {'sequence': str, 'told_by': str, 'focal_from': str,
               **dict.fromkeys(('frames', *FRAME_KINDS, *_PAIRS), int)}
    main = 'positive'

    def report(self, results: Results) -> Path:
        """Write report.html anew from the row and the pictures in the folder."""
        return render_page(results.folder, results.rows[0])

    def tables(self, results: Results) -> list[FigureTable]:
        """Return the counts of frames, and of pairs."""
        return [FigureTable(title, [{'sequence': row['sequence'], 'told by': row['told_by'], **{
            name.replace('_', ' '): str(row[name]) for name in names}} for row in results.rows])
            for title, names in (('frames', FRAME_KINDS), ('pairs', _PAIRS))]

    def figures(self, results: Results) -> list[Figure]:
        """Return the counts of every row."""
        return [Figure(row['sequence'], name.replace('_', ' '), float(row[name]))
                for row in results.rows for name in (*FRAME_KINDS, *_PAIRS)]

    def conditions(self, results: Results) -> dict[str, Any]:
        """Return the sequences, and the settings of their labels."""
        return {'sequences': sorted(row['sequence'] for row in results.rows),
                'labels': dict(results.section('labels'))}
