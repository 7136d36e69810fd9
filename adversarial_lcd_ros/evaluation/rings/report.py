# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results of the rings: summary.json, report.html, rings.md and its curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from adversarial_lcd_ros.evaluation.pictures import read_pictures
from adversarial_lcd_ros.evaluation.results import (
    CONFIGURATION,
    ENVIRONMENT,
    PICTURES,
    REPORT,
    SUMMARY,
    summary_document,
)
from adversarial_lcd_ros.evaluation.rings.html import rings_html
from adversarial_lcd_ros.evaluation.rings.page import rings_page
from adversarial_lcd_ros.evaluation.rings.plots import ring_curves
from adversarial_lcd_ros.evaluation.rings.posters import counts
from adversarial_lcd_ros.evaluation.rings.summaries import summarise, worst_cases
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.files import reading
from adversarial_lcd_ros.files.writing import write_bytes, write_json, write_text

KIND, SCHEMA = 'rings', 1
PAGE, CURVES = 'rings.md', 'rings.svg'
SEED = 42


def write_rings(folder: Path, rows: Sequence[Row], posters: Sequence[Row],
                prices: Sequence[Row]) -> Path:
    """Write summary.json and the page of finished cells and posters; return the page's path."""
    write_json(folder / SUMMARY, summary_document(KIND, SCHEMA, summarise(rows, SEED), {
        'worst': worst_cases(rows, SEED), 'posters': counts(posters), 'prices': list(prices)}))
    return write_page(folder, reading.read_json(folder / SUMMARY))


def write_page(folder: Path, summary: Mapping[str, Any], command: str = '') -> Path:
    """
    Write rings.md, its curves and report.html from the content of summary.json.

    Parameters
    ----------
    folder : Path
        Where settings and environment are not told, there is no report.html.
    summary : mapping
    command : str
        That made it, where the page is to say so.

    Returns
    -------
    Path
        Of rings.md.

    """
    curves = ring_curves(summary)
    write_bytes(folder / CURVES, curves)
    path = folder / PAGE
    shown = ''.join(f'\n![{title}]({PICTURES}/{number:02d}.jpg)\n\n*{title}. {caption}*\n'
                    for number, (title, caption, _) in enumerate(read_pictures(folder), 1))
    write_text(path, f'{rings_page(summary, command)}\n![curves]({CURVES})\n{shown}')
    if (folder / CONFIGURATION).is_file() and (folder / ENVIRONMENT).is_file():
        write_text(folder / REPORT, rings_html(folder, summary, curves))
    return path
