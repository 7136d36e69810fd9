# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a recipe of the rings has run beside its cells: posters, and what defences cost."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
import json
from pathlib import Path

from adversarial_lcd_ros.config import LabelConfig, LcdConfig
from adversarial_lcd_ros.environment import code_digest
from adversarial_lcd_ros.errors import FileError
from adversarial_lcd_ros.evaluation.frames.cells import Cell
from adversarial_lcd_ros.evaluation.rings.posters import (
    Checks,
    PairTask,
    PosterConfig,
    poster_tasks,
    run_pair,
)
from adversarial_lcd_ros.evaluation.rings.prices import decision_us, sealing_us
from adversarial_lcd_ros.evaluation.rings.summaries import defence_title
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.evaluation.streams import Stream, load_stream_graphs
from adversarial_lcd_ros.evaluation.workers import Run
from adversarial_lcd_ros.files.digests import digest_of
from adversarial_lcd_ros.files.reading import read_json
from adversarial_lcd_ros.files.writing import write_json
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.sequences.sequence import Progress

POSTERS = 'posters.json'
_CODE = ('attack', 'lcd', 'vision', 'graph', 'edge_rule', 'evaluation/rings/posters',
         'evaluation/rings/scene', 'evaluation/rings/walls')


def run_posters(folder: Path, streams: Sequence[Stream], config: PosterConfig, checks: Checks,
                lcd: LcdConfig, labels: LabelConfig, run: Run,
                progress: Progress) -> tuple[list[Row], list[PairTask]]:
    """
    Return what was declared on pairs of places, and the pairs; what is there is not run again.

    Parameters
    ----------
    folder : Path
        Keeps what is declared.
    streams : sequence of Stream
    config, checks
        Of the recipe.
    lcd, labels
        Settings.
    run : callable
        From ``local_workers`` or ``dask_workers``.
    progress : callable
        Called with pairs done and to do.

    """
    path = folder / POSTERS
    digests = {stream.name: _digest(stream, config, checks, lcd, labels) for stream in streams}
    rows = [row for row in _finished(path) if row['digest'] == digests.get(row['sequence'])]
    done = {(row['sequence'], row['later']) for row in rows}
    tasks = [task for stream in streams
             for task in poster_tasks(stream, config, lcd, checks, labels)]
    left = [task for task in tasks if (task.sequence, task.later) not in done]
    for count, part in enumerate(run(run_pair, left), 1):
        rows += [{**row, 'digest': digests[row['sequence']]} for row in part]
        write_json(path, {'rows': rows})
        progress(count, len(left))
    return sorted(rows, key=lambda row: (row['sequence'], row['later'])), tasks


def _digest(stream: Stream, *settings: object) -> str:
    """Return a digest of all that the rows of a sequence depend on."""
    return digest_of(json.dumps([*map(repr, settings), stream.digest,
                                 code_digest(*_CODE)]).encode())


def _finished(path: Path) -> list[Row]:
    """Return the rows of an earlier run; none where there are none, or not of this form."""
    try:
        known = read_json(path) if path.is_file() else None
    except FileError:
        known = None
    rows = known.get('rows') if isinstance(known, dict) else None
    return [row for row in rows if isinstance(row, dict) and {'digest', 'sequence', 'later'}
            <= set(row)] if isinstance(rows, list) else []


def measured_prices(streams: Sequence[Stream], cells: Sequence[Cell],
                    lcd: LcdConfig) -> list[Row]:
    """Return what each defence of some cells costs on each sequence, in time of a decision."""
    rows: list[Row] = []
    for stream in streams:
        graphs = load_stream_graphs(stream.graphs)
        here = [cell for cell in cells
                if (cell.nodes, cell.variant_needed) == (stream.nodes, stream.variant)]
        for target in dict.fromkeys(cell.target for cell in here):
            rows += [{'sequence': stream.name, 'target': target, **price} for price in
                     _prices(graphs, [cell for cell in here if cell.target == target],
                             replace(lcd, target=target))]
    return rows


def _prices(graphs: Sequence[MultiTierGraph], cells: Sequence[Cell],
            lcd: LcdConfig) -> Iterator[Row]:
    detectors = list(dict.fromkeys([(), *(cell.detector for cell in cells)]))
    spent = dict(zip(detectors, decision_us(graphs, lcd, detectors), strict=True))
    sealing = sealing_us(graphs) if any(cell.sealed for cell in cells) else 0.0
    for settings, sealed in dict.fromkeys([(settings, False) for settings in detectors] + [
            (cell.detector, True) for cell in cells if cell.sealed]):
        us = spent[settings] + sealing * sealed
        yield {'decision_us': us, 'more_us': us - spent[()], 'defence': defence_title({
            'detector': ', '.join(f'{name} {value}' for name, value in settings),
            'threshold': LcdConfig.threshold, 'sealed': sealed})}
