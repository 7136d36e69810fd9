# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables in Markdown: what the pages of all evaluations share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence


def table(headings: Sequence[str], lines: Iterable[Iterable[str]]) -> list[str]:
    """Return the lines of a table."""
    return [table_line(headings), table_line(['---'] * len(headings)), *map(table_line, lines)]


def table_of(rows: Sequence[Mapping[str, str]]) -> list[str]:
    """Return the lines of a table of at least one row, each of heading to cell."""
    return table(list(rows[0]), (row.values() for row in rows))


def table_line(cells: Iterable[str]) -> str:
    """Return a line of a table."""
    return f'| {" | ".join(cells)} |'
