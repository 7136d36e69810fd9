# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables for the terminal; printing is the command line's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.table import Table

from adversarial_lcd_ros.evaluation import wording


def sweep_table(summary: Mapping[str, Any]) -> Table:
    """Return what each run would be worth by other labels."""
    rows = [{'labels': row['labels'], 'run': row['run'],
             'loops / new places': f'{row["positives"]} / {row["negatives"]}',
             'balanced': wording.percent(row['balanced_accuracy']),
             'decline, points': wording.number(row['decline_pp']),
             'suppressed': str(row['suppressed']), 'invented': str(row['invented'])}
            for row in summary['label_sweep']]
    return _table('The same decisions by other labels', rows)


def _table(title: str, rows: Sequence[Mapping[str, str]]) -> Table:
    table = Table(title=title, title_justify='left')
    for index, heading in enumerate(rows[0] if rows else ()):
        table.add_column(heading, justify='left' if index == 0 else 'right')
    for row in rows:
        table.add_row(*row.values())
    return table
