# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What another rule of labels moves: frames by kind, and a detector's matches by verdict.

    python benchmarks/label_moves.py SEQUENCE [SEQUENCE ...] [--pictures FOLDER]
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from adversarial_lcd_ros.config import BuilderConfig, LabelConfig, LcdConfig
from adversarial_lcd_ros.evaluation.replay.offline import run_offline
from adversarial_lcd_ros.graph_sequences.opening import GraphSequence, open_graphs
from adversarial_lcd_ros.ground_truth.labelling import label_graphs
from adversarial_lcd_ros.ground_truth.labels import NO_MATCH, FrameLabels
from adversarial_lcd_ros.sequences import open_sequence

LOOKED_AT = 10  # pairs of a sheet, spread over time
_WIDTH, _HEIGHT, _TEXT = 320, 240, 16
Pair = tuple[int, int]


def main() -> None:
    """Print both tables of every sequence, and draw what moved."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('sources', nargs='+', metavar='SEQUENCE')
    parser.add_argument('--before', default='overlap', metavar='RULE')
    parser.add_argument('--after', default='auto', metavar='RULE')
    parser.add_argument('--pictures', type=Path, metavar='FOLDER',
                        help='draw ten pairs of each kind of move, as PNG')
    options = parser.parse_args()
    rules = options.before, options.after
    print('| sequence | labels by | what | ' + ' -> '.join(rules) + ' |\n|---|---|---|---|')
    for source in options.sources:
        sequence = open_graphs(source, BuilderConfig())
        before, after = (label_graphs(sequence.graphs, sequence.trajectory, sequence.source,
                                      replace(LabelConfig(), rule=rule)) for rule in rules)
        frames = moved_frames(sequence, before, after)
        matches = moved_matches(sequence, before, after)
        for what, moves in (('frames', frames), ('declared matches', matches)):
            print(f'| {sequence.name} | {after.told_by} | {what} | {_in_words(moves)} |')
        if options.pictures:
            for what, moves in (('frame', frames), ('match', matches)):
                draw(options.pictures, sequence, what, moves)


def moved_frames(sequence: GraphSequence, before: FrameLabels, after: FrameLabels
                 ) -> dict[tuple[str, str], list[Pair]]:
    """Return frames by what they were and what they are, each with an older one to look at."""
    poses = sequence.trajectory
    row = np.clip(np.searchsorted(poses.stamp_ns, after.stamp_ns), 0, len(poses) - 1)
    place = poses.position[row]
    moves: dict[tuple[str, str], list[Pair]] = {}
    for frame, kinds in enumerate(zip(before.names, after.names, strict=True)):
        old = np.arange(after.candidates[frame])
        loops = old[(after.relation[frame, old] > 0) | (before.relation[frame, old] > 0)]
        scaled = old[after.scaled[frame, old] & (kinds[1] == 'scale')]
        shared = old[after.possible[frame, old]]
        among = next((part for part in (loops, scaled, shared, old) if len(part)), None)
        nearest = (frame if among is None else
                   int(among[np.linalg.norm(place[among] - place[frame], axis=1).argmin()]))
        moves.setdefault(kinds, []).append((frame, nearest))
    return moves


def moved_matches(sequence: GraphSequence, before: FrameLabels, after: FrameLabels
                  ) -> dict[tuple[str, str], list[Pair]]:
    """Return the matches that the shipped detector declares, by both verdicts."""
    decisions = run_offline(sequence.graphs, LcdConfig())[0].decisions
    frame_of = {int(stamp): frame for frame, stamp in enumerate(after.stamp_ns)}
    query = np.array([frame for frame, decision in enumerate(decisions) if decision.is_loop], int)
    match = np.array([frame_of.get(decisions[frame].match_stamp_ns, NO_MATCH)
                      for frame in query], int)
    moves: dict[tuple[str, str], list[Pair]] = {}
    for pair, *verdicts in zip(zip(query.tolist(), match.tolist(), strict=True),
                               before.judge(query, match).tolist(),
                               after.judge(query, match).tolist(), strict=True):
        moves.setdefault((verdicts[0], verdicts[1]), []).append(pair)
    return moves


def _in_words(moves: Mapping[tuple[str, str], Sequence[Pair]]) -> str:
    counts = Counter({kinds: len(pairs) for kinds, pairs in moves.items()})
    return '; '.join(f'{old}: {count}' if old == new else f'{old} -> {new}: {count}'
                     for (old, new), count in sorted(counts.items()))


def draw(folder: Path, sequence: GraphSequence, what: str,
         moves: Mapping[tuple[str, str], Sequence[Pair]]) -> None:
    """Write a sheet for every kind of move: the newer frame on the left, the older beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    pictures = open_sequence(sequence.source)
    for (old, new), pairs in moves.items():
        if old == new:
            continue
        chosen = [pairs[at] for at in
                  np.unique(np.linspace(0, len(pairs) - 1, LOOKED_AT).astype(int))]
        wanted = {frame for pair in chosen for frame in pair}
        image = {number: frame.image() for number, frame in enumerate(pictures.frames())
                 if number in wanted}
        path = folder / f'{sequence.name}_{what}_{old}_to_{new}.png'
        cv2.imwrite(str(path), _sheet([(pair, [image[frame] for frame in pair])
                                       for pair in chosen]))


def _sheet(pairs: Iterable[tuple[Pair, Sequence[np.ndarray]]]) -> np.ndarray:
    cells = []
    for pair, images in pairs:
        cell = np.hstack([cv2.resize(image, (_WIDTH, _HEIGHT)) for image in images])
        cv2.putText(cell, f'{pair[0]} | {pair[1]}', (4, _TEXT), cv2.FONT_HERSHEY_SIMPLEX, 0.5,
                    (0, 255, 255), 1)
        cells.append(cell)
    if len(cells) % 2:
        cells.append(np.zeros_like(cells[0]))
    return np.vstack([np.hstack(cells[at:at + 2]) for at in range(0, len(cells), 2)])


if __name__ == '__main__':
    main()
