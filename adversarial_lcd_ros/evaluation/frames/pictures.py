# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames that the strongest attack of an experiment turned over: attacked again, and drawn."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
import logging
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.frames.attacked import FrameResult, attack_frames
from adversarial_lcd_ros.evaluation.frames.cells import Cell
from adversarial_lcd_ros.evaluation.frames.samples import SAMPLES
from adversarial_lcd_ros.evaluation.methods import is_yardstick
from adversarial_lcd_ros.evaluation.outcomes import EFFECTS
from adversarial_lcd_ros.evaluation.pictures import Picture
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.evaluation.streams import Stream, load_stream_graphs
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.graph_sequences.opening import holds_graphs
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.sequences.part import SequencePart
from adversarial_lcd_ros.vision.panels import draw_attack

PICTURES = 6
_BLANK_GREY = 235
# They take turns.
_TELLING = ('suppressed', 'invented', 'diverted')

_log = logging.getLogger(__name__)
# A row, and one of its frames.
_Chosen = tuple[Row, dict[str, Any]]


def attacked_pictures(streams: Sequence[Stream], cells: Sequence[Cell], rows: Sequence[Row],
                      lcd: LcdConfig, count: int = PICTURES) -> list[Picture]:
    """
    Return query, match and attacked graph of frames that the strongest attack turned over.

    Only attacks that ask the detector they attack; the yardstick is none. Kinds of effect and
    sequences take turns. Attacks are repeatable: each chosen cell is run once more. A frame that
    comes out differently than its row says gets no picture, and a warning.

    Parameters
    ----------
    streams, cells, lcd
        Of the experiment.
    rows : sequence of dict
        Of the experiment.
    count : int
        Most pictures.

    """
    stream_of = {(stream.name, stream.nodes, stream.variant): stream for stream in streams}
    cell_of = {repr(cell.settings): cell for cell in cells}
    attacks: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        attacks[repr({name: row[name] for name in cells[0].settings})].append(row)
    strongest = _strongest(attacks)
    pictures = []
    for row, frame in _choose(attacks.get(strongest, ()), count):
        cell = cell_of[strongest]
        stream = stream_of[row['sequence'], row['nodes'], cell.variant_needed]
        result = _again(stream, cell, row, frame, lcd)
        if result is not None:
            pictures.append(_picture(stream, row, frame, result))
    return pictures


def _strongest(attacks: Mapping[str, Sequence[Row]]) -> str:
    """Return the attack that turned most frames over; '' if none turned any."""
    turned = {name: sum(row['suppressed'] + row['invented'] for row in rows)
              for name, rows in attacks.items()
              if not is_yardstick(rows[0])
              and rows[0]['asked_target'] == rows[0]['target']}
    best = max(turned, key=lambda name: turned[name], default='')
    return best if turned.get(best) else ''


def _choose(rows: Sequence[Row], count: int) -> list[_Chosen]:
    waiting: dict[tuple[str, str], list[_Chosen]] = defaultdict(list)
    for effect in _TELLING:
        for row in rows:
            found = [(row, frame) for frame in row['frame_results']
                     if EFFECTS.get((frame['clean'], frame['attacked'])) == effect]
            waiting[effect, row['sequence']] += found
    return list(_in_turns([group for group in waiting.values() if group], count))


def _in_turns(groups: list[list[_Chosen]], count: int) -> Iterator[_Chosen]:
    taken: set[tuple[str, int]] = set()
    while count and any(groups):
        for group in groups:
            # Seeds may attack a frame again: one picture of it is enough.
            while group and (group[0][0]['sequence'], group[0][1]['stamp']) in taken:
                group.pop(0)
            if group and count:
                row, frame = group.pop(0)
                taken.add((row['sequence'], frame['stamp']))
                count -= 1
                yield row, frame


def _again(stream: Stream, cell: Cell, row: Row, frame: dict[str, Any],
           lcd: LcdConfig) -> FrameResult | None:
    sample = SAMPLES[cell.judged](stream.labels, cell.frames, row['seed'])
    results, = attack_frames(load_stream_graphs(stream.graphs), sample, [cell], lcd, row['seed'])
    found = next(result for result in results if result.result.clean.stamp_ns == frame['stamp'])
    change = found.result.change
    if (change.edits, change.nodes, found.result.queries) != (
            frame['edits'], frame['nodes_moved'], frame['queries']):
        _log.warning('%s: the frame at %d ns took %d queries and now takes %d; no picture of it',
                     row['sequence'], frame['stamp'], frame['queries'], found.result.queries)
        return None
    return found


def _picture(stream: Stream, row: Row, frame: dict[str, Any], found: FrameResult) -> Picture:
    effect = EFFECTS[frame['clean'], frame['attacked']]
    graphs = load_stream_graphs(stream.graphs)
    stamp = (found.clean if effect == 'suppressed' else found.attacked).match_stamp_ns
    match = next(graph for graph in graphs if graph.stamp_ns == stamp)
    clean = found.result.clean
    caption = (f'Probability {found.clean.probability:.2f} clean, '
               f'{found.attacked.probability:.2f} attacked; {_spent(frame)}, '
               f'{frame["queries"]} queries; target '
               f'{row["target"]}.')
    return Picture(
        f'{row["sequence"]}, frame {clean.sequence}: {effect} by {wording.attack_title(row)}',
        caption, draw_attack(frame_image(stream, clean), clean, frame_image(stream, match), match,
                             found.result.perturbed))


def _spent(frame: dict[str, Any]) -> str:
    if frame['node_budget']:
        return f'{frame["nodes_moved"]} nodes changed of {frame["node_budget"]} allowed'
    return f'{frame["edits"]} edges flipped of {frame["edit_budget"]} allowed'


def frame_image(stream: Stream, graph: MultiTierGraph) -> NDArray[np.uint8]:
    """Return the picture that a graph was built from, BGR; grey where there is none."""
    path = SequencePart.parse(stream.graphs.source).path
    if stream.graphs.builder.detector == 'csv' or holds_graphs(path):
        return np.full((graph.height, graph.width, 3), _BLANK_GREY, np.uint8)
    frames = open_sequence(path).frames(graph.sequence, graph.sequence + 1)
    return np.asarray(next(iter(frames)).image(), np.uint8)
