# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Certificates as a table and as a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
from matplotlib.figure import Figure
import numpy as np

from adversarial_lcd_ros.evaluation.certificates.run import CLASSES
from adversarial_lcd_ros.evaluation.page import GRID, STYLE, WIDE, attack_colour, svg
from adversarial_lcd_ros.registry import NONE

_HEIGHT = 2.6  # inches, of a sequence
_DASHES = ('-', '--', ':', '-.')
Row = Mapping[str, Any]


def name_of(row: Row) -> str:
    """Return the detector of a row in a few words."""
    parts = [row['target']]
    if row['defences'] != NONE:
        parts.append(row['defences'])
    if row['geometric_check']:
        parts.append('geometric_check')
    return ', '.join(parts)


def certificate_table(rows: Sequence[Row]) -> str:
    """Return how many frames are certified, by flips, as a Markdown table."""
    budget = max(row['budget'] for row in rows)
    shown = sorted({0, 1, *(flips for flips in (3, 9) if flips < budget), budget})
    head = ['sequence', 'detector', 'class', 'frames',
            *(f'{flips} flips' if flips else 'right' for flips in shown)]
    lines = [head, ['---'] * len(head)]
    for row in rows:
        for name in CLASSES:
            found = row['classes'][name]
            lines.append([row['sequence'], f'`{name_of(row)}`', name, str(found['frames']),
                          *(_cell(found, flips) for flips in shown)])
    return ''.join(f'| {" | ".join(line)} |\n' for line in lines)


def _cell(found: Mapping[str, Any], flips: int) -> str:
    if not found['frames'] or flips >= len(found['certified']):
        return '-'
    count = found['certified'][flips]
    return f'{count} ({count / found["frames"]:.0%})'


def draw_certificates(rows: Sequence[Row]) -> bytes:
    """Draw the certified share by the number of flips, a line for each detector; SVG."""
    sequences = list(dict.fromkeys(row['sequence'] for row in rows))
    names = list(dict.fromkeys(name_of(row) for row in rows))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDE, _HEIGHT * len(sequences) + 0.4), layout='constrained')
        panels = figure.subplots(len(sequences), len(CLASSES), squeeze=False, sharey=True)
        for panel_row, sequence in zip(panels, sequences, strict=True):
            for axes, kind in zip(panel_row, CLASSES, strict=True):
                for row in (row for row in rows if row['sequence'] == sequence):
                    found, place = row['classes'][kind], names.index(name_of(row))
                    share = np.array(found['certified']) / max(found['frames'], 1)
                    axes.plot(share, label=name_of(row), drawstyle='steps-post',
                              color=attack_colour(place), linestyle=_DASHES[place % 4])
                axes.set(title=f'{sequence}: {kind}', ylim=(-0.02, 1.02), xlabel='flips',
                         ylabel='certified' if axes is panel_row[0] else '')
                axes.grid(color=GRID, linewidth=0.6)
        handles, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc='outside lower center', ncols=3)
        return svg(figure)
