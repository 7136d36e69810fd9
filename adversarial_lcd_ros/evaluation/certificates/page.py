# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page of certificates, certificates.md, and its picture, from what summary.json holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
import shlex
from typing import Any

import matplotlib
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter
import numpy as np

from adversarial_lcd_ros.evaluation.certificates.run import CLASSES
from adversarial_lcd_ros.evaluation.certificates.tables import (
    Row,
    accuracy_lines,
    certified_lines,
    markdown,
    name_of,
)
from adversarial_lcd_ros.evaluation.page import GRID, STYLE, WIDE, attack_colour, svg
from adversarial_lcd_ros.files.writing import write_bytes, write_text

PAGE, PICTURE = 'certificates.md', 'certificates.svg'
_HEIGHT = 2.5  # inches, of a sequence
_DASHES = ('-', '--', ':', '-.')
_BALANCED = 'balanced'
_OF_THE_MACHINE = ('--output', '--jobs', '--cache')  # each with a value
_NOTES = """\
Certified against b flips: right, and proven to stay so whichever at most b edges are added to
the graph or deleted from it, by somebody who looks into the detector. Keyframes are clean, nodes
as they are. `edges` is bounded exactly, `wl` and `symbio` are not: what is not certified need not
fall. Frames of each class are spread over the sequence, each judged against the keyframes before
it; a loop is right where one is declared. What is proven, and how:
[defences.md](../defences.md#certificates)."""
_ACCURACY = """\
Mean over the classes of the share of frames that are certified; at no flip it is the balanced
accuracy, but for decisions within 1e-4 of the line. Intervals: bootstrap over blocks of 2 s of
frames. Time: processor time of a certificate, on the machine of the run."""


def write_page(folder: Path, rows: Sequence[Row], command_line: Sequence[str]) -> Path:
    """Write certificates.md and its picture from the rows of a summary; return the page's path."""
    write_bytes(folder / PICTURE, draw_certificates(rows))
    path = folder / PAGE
    write_text(path, certificates_page(rows, command_line))
    return path


def certificates_page(rows: Sequence[Row], command_line: Sequence[str]) -> str:
    """Return the page in Markdown; what is of the machine is left out of its command."""
    words = [word for before, word in pairwise(command_line)
             if not {before, word} & set(_OF_THE_MACHINE)]
    command = shlex.join(['adversarial-lcd', *(Path(word).name if '/' in word else word
                                               for word in words)])
    return '\n'.join((
        f'Made by `{command}`.\n', '# Certificates\n', _NOTES, '\n## Frames certified\n',
        markdown(certified_lines(rows)), '## Certified accuracy\n', _ACCURACY, '',
        markdown(accuracy_lines(rows)), f'![certified by the number of flips]({PICTURE})', ''))


def draw_certificates(rows: Sequence[Row]) -> bytes:
    """Draw the certified share by the number of flips, a line for each detector; SVG."""
    sequences = list(dict.fromkeys(row['sequence'] for row in rows))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDE, _HEIGHT * len(sequences) + 0.5), layout='constrained')
        panels = figure.subplots(len(sequences), len(CLASSES) + 1, squeeze=False, sharey=True,
                                 sharex=True)
        looks = _looks(rows)
        for panel_row, sequence in zip(panels, sequences, strict=True):
            here = [row for row in rows if row['sequence'] == sequence]
            for axes, kind in zip(panel_row, (*CLASSES, _BALANCED), strict=True):
                for row in here:
                    axes.plot(_curve(row, kind), label=name_of(row), drawstyle='steps-post',
                              linewidth=1.6, **looks[name_of(row)])
                axes.set(title=_title(sequence, kind, here), ylim=(-0.02, 1.03),
                         xlabel='flips' if sequence == sequences[-1] else '',
                         ylabel='certified' if axes is panel_row[0] else '')
                axes.yaxis.set_major_formatter(PercentFormatter(1))
                axes.grid(color=GRID, linewidth=0.6)
        handles = {label: handle for axes in panels[:, 0]
                   for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
        figure.legend(list(handles.values()), list(handles), loc='outside lower center', ncols=3)
        return svg(figure)


def _looks(rows: Sequence[Row]) -> dict[str, dict[str, Any]]:
    """Return the line of each detector: a colour for its target, dashes for what is around it."""
    targets = list(dict.fromkeys(row['target'] for row in rows))
    around = list(dict.fromkeys((row['defences'], row['changed']) for row in rows))
    return {name_of(row): {
        'color': attack_colour(targets.index(row['target'])),
        'linestyle': _DASHES[around.index((row['defences'], row['changed'])) % len(_DASHES)]}
        for row in rows}


def _curve(row: Row, kind: str) -> Any:
    if kind == _BALANCED:
        return np.array(row['accuracy'], float)
    found: Mapping[str, Any] = row['classes'][kind]
    return np.array(found['certified']) / (found['frames'] or np.nan)


def _title(sequence: str, kind: str, rows: Sequence[Row]) -> str:
    if kind == _BALANCED:
        return f'{sequence}: balanced'
    return f'{sequence}: {rows[0]["classes"][kind]["frames"]} {kind}'
