# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A picture of each ring: what was changed, and what the detector took it for."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.evaluation.frames.cells import Cell
from adversarial_lcd_ros.evaluation.frames.pictures import attacked_pictures
from adversarial_lcd_ros.evaluation.pictures import Picture
from adversarial_lcd_ros.evaluation.rings.posters import PairTask, condition_of, scene_of
from adversarial_lcd_ros.evaluation.rings.scene import SAME
from adversarial_lcd_ros.evaluation.rings.summaries import FLIPS, NODES, ring_of
from adversarial_lcd_ros.evaluation.rings.tables import poster_title
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.evaluation.streams import Stream, load_stream_graphs

EACH = 2
_WIDTH = 640


def ring_pictures(streams: Sequence[Stream], cells: Sequence[Cell], rows: Sequence[Row],
                  lcd: LcdConfig, posters: Sequence[Row], tasks: Sequence[PairTask]
                  ) -> list[Picture]:
    """
    Return two pictures of the strongest attack on edges, two of that on nodes, two of posters.

    Parameters
    ----------
    streams, cells, rows, lcd
        Of the experiment.
    posters : sequence of dict
        What was declared on pairs of places.
    tasks : sequence of PairTask
        The pairs, to hang the posters again.

    """
    pictures = []
    for ring in (FLIPS, NODES):
        # Where graphs were refused the detector saw none.
        here = [cell for cell in cells
                if ring_of({'search': cell.search}) == ring and not cell.sealed]
        pictures += attacked_pictures(streams, here, [
            row for row in rows if ring_of(row) == ring and not row['sealed']
        ], lcd, EACH) if here else []
    return pictures + _posters(posters, tasks)


def _posters(rows: Sequence[Row], tasks: Sequence[PairTask]) -> list[Picture]:
    """Return scenes in which a loop past the most checks was declared, of different sequences."""
    task_of = {(task.sequence, task.later): task for task in tasks}
    fooled: dict[str, Row] = {}
    for row in rows:
        if row['control'] == SAME and row['to_poster'] and row['count'] == 1:
            best = fooled.setdefault(row['sequence'], row)
            if row['on_wall'] > best['on_wall']:
                fooled[row['sequence']] = row
    return [_scene(row, task_of[row['sequence'], row['later']])
            for row in list(fooled.values())[:EACH]
            if (row['sequence'], row['later']) in task_of]


def _scene(row: Row, task: PairTask) -> Picture:
    graphs = load_stream_graphs(task.graphs)
    posted, _ = scene_of(task, graphs).posted(condition_of(row))
    panels = [cv2.resize(posted[index], (_WIDTH, round(
        _WIDTH * posted[index].shape[0] / posted[index].shape[1])), interpolation=cv2.INTER_AREA)
        for index in (task.earlier, task.later)]
    check = '' if row['check'] == 'none' else f', past the {row["check"]}'
    return Picture(
        f'{row["sequence"]}, frames {task.earlier} and {task.later}: a poster in two places',
        f'{poster_title(row)}; {row["target"]} declares a loop between them{check}. Both places '
        'certainly differ.', np.hstack([np.asarray(panel, np.uint8) for panel in panels]))
