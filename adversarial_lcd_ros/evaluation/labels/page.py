# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""report.html of labels: what a sequence's labels are, in one file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import io
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import matplotlib
from matplotlib.figure import Figure
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.evaluation.page import STYLE, WIDE, data_uri, load_template, svg
from adversarial_lcd_ros.evaluation.results import REPORT
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.files.writing import write_bytes, write_text
from adversarial_lcd_ros.ground_truth.labels import FrameLabels
from adversarial_lcd_ros.poses.trajectory import nearest_in_time

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from adversarial_lcd_ros.sequences import Trajectory

# Kind, colour, and what it means.
LEGEND = (
    ('positive', '#2e8064', 'a loop is there to be found'),
    ('negative', '#c0392b', 'a new place: shares nothing with any older view'),
    ('scale', '#7a4a9c', 'seen before from nearer or further only: a change of scale, not scored'),
    ('between', '#9c6400', 'cannot be told, or shares too little: not scored'),
    ('no_candidate', '#a9afb8', 'too early: no frame is old enough'),
    ('no_ground_truth', '#000000', 'no ground truth pose'))
# Not by colour alone: green and red are one to many readers.
_MARKERS = {'positive': 'o', 'negative': 'x', 'scale': 's', 'between': 'D', 'no_candidate': '.',
            'no_ground_truth': '+'}
PATH, RULE = 'path.svg', 'labels.png'
_HEIGHT, _GAP, _JPEG_QUALITY = 240, 6, 80


@dataclass(frozen=True, eq=False)
class PicturePair:
    """A frame of some kind beside an older one, uint8 BGR."""

    kind: str
    frame: int
    older: int
    image: NDArray[np.uint8]
    older_image: NDArray[np.uint8]


def write_page(folder: Path, row: Row, labels: FrameLabels, trajectory: Trajectory,
               pairs: Sequence[PicturePair]) -> Path:
    """Write the path and the pairs as files, and report.html of them; return its path."""
    write_bytes(folder / PATH, draw_path(labels, trajectory))
    write_bytes(folder / RULE, draw_rule(labels, trajectory, pairs))
    for pair in pairs:
        write_bytes(folder / f'{pair.kind}_{pair.frame}_{pair.older}.jpg', _side_by_side(pair))
    return render_page(folder, row)


def render_page(folder: Path, row: Row) -> Path:
    """Write report.html anew from a row of summary.json and the pictures beside it."""
    pictures = []
    for kind, _, _ in LEGEND:
        for path in sorted(folder.glob(f'{kind}_*_*.jpg'), key=_frames_of):
            frame, older = _frames_of(path)
            pictures.append((kind, f'frame {frame}, older frame {older}',
                             data_uri(path.read_bytes(), 'jpeg')))
    page = load_template('labels.html.j2').render(
        row=row, legend=LEGEND, check=row.get('check'), pictures=pictures,
        path=data_uri((folder / PATH).read_bytes(), 'svg+xml'))
    write_text(folder / REPORT, page)
    return folder / REPORT


def _frames_of(path: Path) -> tuple[int, int]:
    frame, older = path.stem.split('_')[-2:]
    return int(frame), int(older)


def draw_path(labels: FrameLabels, trajectory: Trajectory) -> bytes:
    """Return the camera's path seen along its flattest axis, each frame in its kind's colour."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 5.0), layout='constrained')
        _plot_path(figure.subplots(), labels, trajectory)
        return svg(figure)


def _plot_path(axes: Axes, labels: FrameLabels, trajectory: Trajectory) -> None:
    place = trajectory.position[nearest_in_time(trajectory.stamp_ns, labels.stamp_ns)]
    across, up = np.sort(np.argsort(np.ptp(place, axis=0))[-2:])
    names = np.array(labels.names)
    axes.plot(place[:, across], place[:, up], color='#dddfe3', linewidth=0.8, zorder=0)
    for kind, colour, _ in reversed(LEGEND):
        chosen = names == kind
        if chosen.any():
            axes.scatter(place[chosen, across], place[chosen, up], s=12, color=colour,
                         marker=_MARKERS[kind], linewidth=1.0,
                         label=f'{kind.replace("_", " ")} ({int(chosen.sum())})')
    axes.set(xlabel=f'{"xyz"[across]}, metres', ylabel=f'{"xyz"[up]}, metres', aspect='equal')
    axes.figure.legend(loc='outside upper left', ncols=3, fontsize=8.0, reverse=True)


def draw_rule(labels: FrameLabels, trajectory: Trajectory,
              pairs: Sequence[PicturePair]) -> bytes:
    """Return the path beside a pair of pictures of each kind, as PNG: labels in one picture."""
    shown = [(kind, colour, text, [pair for pair in pairs if pair.kind == kind])
             for kind, colour, text in LEGEND]
    shown = [entry for entry in shown if entry[3]]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDE, 1.75 * max(len(shown), 2)), layout='constrained', dpi=110)
        left, right = figure.subfigures(1, 2, width_ratios=(1.15, 1.0))
        _plot_path(left.subplots(), labels, trajectory)
        for axes, (kind, colour, text, there) in zip(
                np.atleast_1d(right.subplots(max(len(shown), 1), 1)), shown, strict=False):
            pair = there[len(there) // 2]
            data = np.frombuffer(_side_by_side(pair), np.uint8)
            axes.imshow(cv2.cvtColor(cv2.imdecode(data, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB))
            axes.set_title(f'{kind}: {text.split(":")[0]}\nframe {pair.frame}, and {pair.older} '
                           'before it', fontsize=8, loc='left')
            axes.plot([-8, -8], [0, _HEIGHT], color=colour, linewidth=4, clip_on=False,
                      scalex=False, scaley=False)
            axes.axis('off')
        stream = io.BytesIO()
        figure.savefig(stream, format='png', metadata={'Software': None})
    return stream.getvalue()


def _side_by_side(pair: PicturePair) -> bytes:
    parts = [cv2.resize(image, (round(image.shape[1] * _HEIGHT / image.shape[0]), _HEIGHT))
             for image in (pair.image, pair.older_image)]
    gap = np.full((_HEIGHT, _GAP, 3), 255, np.uint8)
    _, data = cv2.imencode('.jpg', np.hstack([parts[0], gap, parts[1]]),
                           [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return bytes(data)
