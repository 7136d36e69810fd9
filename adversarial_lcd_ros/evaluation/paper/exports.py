# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The paper's experiments as CSV, JSON and LaTeX tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.paper.summaries import KIND, SCHEMA, Summary
from adversarial_lcd_ros.evaluation.paper.tables import DeclineTable, Line
from adversarial_lcd_ros.evaluation.results import SUMMARY, summary_document
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.files.writing import write_csv, write_json, write_text

CELLS_CSV, SUMMARY_CSV, TABLES_TEX = 'cells.csv', 'summary.csv', 'tables.tex'
_LATEX = {'\\': r'\textbackslash{}', '&': r'\&', '%': r'\%', '$': r'\$', '#': r'\#', '_': r'\_',
          '{': r'\{', '}': r'\}', '~': r'\textasciitilde{}', '^': r'\textasciicircum{}',
          '<': '$<$', '>': '$>$', '|': '$|$', '"': "''",
          '→': r'$\rightarrow$', '–': '--', '\u202f': r'\,'}
_TEX_HEAD = """\
% Declines in balanced accuracy, percentage points; positive: lost. Needs \\usepackage{booktabs}.
% \\input this file, or copy a table from it.
"""


def write_exports(folder: Path, rows: Sequence[Row], cells: Sequence[Summary],
                  tables: Sequence[DeclineTable]) -> list[Path]:
    """
    Write summary.json, summary.csv, cells.csv and tables.tex; return their paths.

    Parameters
    ----------
    folder : Path
        Results folder.
    rows : sequence of mapping
        One a cell and seed: cells.csv, without the frames.
    cells : sequence of dict
        From ``summarise_cells``: summary.json and summary.csv.
    tables : sequence of DeclineTable
        tables.tex.

    """
    plain = [{name: value for name, value in row.items() if name != 'frame_results'}
             for row in rows]
    # The keys tell which of the cells in the folder the summary is of.
    keys = [row['key'] for row in rows if 'key' in row]
    write_json(folder / SUMMARY, summary_document(KIND, SCHEMA, cells, {'cells': keys}))
    write_text(folder / TABLES_TEX, _TEX_HEAD + '\n'.join(latex_table(table) for table in tables))
    flat = [{**cell, 'ci95': None, **_bounds(cell)} for cell in cells]
    for line in flat:
        del line['ci95']
    _write_csv(folder / SUMMARY_CSV, flat)
    _write_csv(folder / CELLS_CSV, plain)
    return [folder / name for name in (SUMMARY, SUMMARY_CSV, CELLS_CSV, TABLES_TEX)]


def latex_escape(text: str) -> str:
    """Return a text in which nothing is special to LaTeX."""
    return ''.join(_LATEX.get(character, character) for character in text)


def latex_table(table: DeclineTable) -> str:
    """Return a table in the shape of the paper's, with booktabs rules; the best is bold."""
    columns = ['before', *table.columns]
    head = ' & '.join(latex_escape(name) for name in ('', *columns))
    lines = [_latex_line(line, line.strongest) for line in table.lines]
    if table.mean is not None:
        lines += [r'\midrule', _latex_line(table.mean, table.mean.strongest)]
    caption = (f'In the shape of Table {table.printed.number} of the paper: decline in balanced '
               f'accuracy, percentage points; {table.title}.')
    body = '\n'.join(lines)
    return (f'\\begin{{table}}[ht]\n\\centering\n\\caption{{{latex_escape(caption)}}}\n'
            f'\\begin{{tabular}}{{l{"r" * len(columns)}}}\n\\toprule\n{head} \\\\\n\\midrule\n'
            f'{body}\n\\bottomrule\n\\end{{tabular}}\n\\end{{table}}\n')


def _latex_line(line: Line, strongest: Summary | None) -> str:
    cells = [latex_escape(line.title), latex_escape(wording.percent(line.before))]
    for entry in line.entries:
        value = None if entry is None else entry['decline_pp']
        text = '--' if value is None else wording.points(value).replace('-', '$-$')
        cells.append(f'\\textbf{{{text}}}' if entry is not None and entry is strongest else text)
    return ' & '.join(cells) + r' \\'


def _bounds(cell: Mapping[str, Any]) -> dict[str, float | None]:
    low, high = cell['ci95'] or (None, None)
    return {'ci95_low': low, 'ci95_high': high}


def _write_csv(path: Path, lines: Sequence[Mapping[str, Any]]) -> None:
    names = list(dict.fromkeys(name for line in lines for name in line))
    write_csv(path, names, lines)
