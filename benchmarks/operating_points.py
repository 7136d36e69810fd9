# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What a detector is worth at its operating points, live: one replay tells all of them.

    python benchmarks/operating_points.py SEQUENCE... [--target wl] [--part 0.5 1]

Where the line is drawn changes neither the candidates nor which of them is best, and a check of
the best one hangs on the two frames alone. Of each point, without and with the defence
common_part: precision, recall and balanced accuracy.
"""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import BuilderConfig, LabelConfig, LcdConfig
from adversarial_lcd_ros.evaluation.metrics import measure
from adversarial_lcd_ros.graph_sequences.opening import open_graphs
from adversarial_lcd_ros.ground_truth.labelling import label_graphs
from adversarial_lcd_ros.ground_truth.labels import UNSCORED
from adversarial_lcd_ros.lcd.common_part import share_in_common
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector

KEPT = (0.99, 0.97, 0.95, 0.9, 0.85, 0.75)


def replay(source: str, part: tuple[float, float], lcd: LcdConfig
           ) -> tuple[NDArray[np.int8], NDArray[np.float64], NDArray[np.float64],
                      NDArray[np.bool_]]:
    """Return kind, log odds, share in common and rightness of the best candidates, (n,) each."""
    opened = open_graphs(source, BuilderConfig())
    graphs = list(opened.graphs)
    if opened.trajectory is None:
        raise SystemExit(f'{source} has no ground truth')
    labels = label_graphs(graphs, opened.trajectory, Path(source), LabelConfig(rule='auto'))
    outside = np.ones(len(graphs), bool)
    outside[int(part[0] * len(graphs)):int(part[1] * len(graphs))] = False
    kind = np.where(outside, UNSCORED, labels.kind).astype(np.int8)
    detector = LoopClosureDetector(lcd)
    odds, share = np.full(len(graphs), -np.inf), np.zeros(len(graphs))
    match = np.full(len(graphs), -1)
    for frame, graph in enumerate(graphs):
        if kind[frame] != UNSCORED:
            logits = detector.log_odds(graph)
            best = int(logits.argmax())
            odds[frame] = logits[best]
            match[frame] = detector.query_nodes(graph).candidates[best]
            share[frame] = share_in_common(graph, graphs[match[frame]])
        detector.remember(graph)
    return kind, odds, share, labels.is_correct(np.arange(len(graphs)), match)


def lines(source: str, part: tuple[float, float], lcd: LcdConfig) -> Iterator[str]:
    """Yield the rows of the table of a sequence."""
    kind, odds, share, correct = replay(source, part, replace(lcd, kept_loops=1.0))
    fitted = LoopClosureDetector(replace(lcd, kept_loops=1.0)).decision
    for kept in KEPT:
        above = odds >= fitted.bias - fitted.keeping(kept).bias
        cells = []
        for declared in (above, above & (share >= lcd.common_share)):
            found = measure(kind, declared, declared.astype(np.float64), correct)
            cells += ['-' if figure is None else f'{figure:.3f}' for figure in
                      (found.precision, found.recall, found.balanced_accuracy)]
        yield (f'| {Path(source).name} | {(kind == 1).sum()} / {(kind == -1).sum()} | {kept:g} | '
               f'{" | ".join(cells)} |')


def main() -> None:
    """Print the table."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument('sequences', nargs='+')
    parser.add_argument('--target', default='wl')
    parser.add_argument('--model', default='')
    parser.add_argument('--part', nargs=2, type=float, default=(0.0, 1.0))
    options = parser.parse_args()
    print('| sequence | loops / new | kept_loops | precision | recall | balanced accuracy | '
          'checked: precision | recall | balanced accuracy |')
    print('|---|---|---|---|---|---|---|---|---|')
    for source in options.sequences:
        for line in lines(source, tuple(options.part),
                          LcdConfig(target=options.target, model=options.model)):
            print(line, flush=True)


if __name__ == '__main__':
    main()
