# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The bounds of certificates beside what the greedy optimum reaches, on frames at full size.

    python benchmarks/certificate_gaps.py FLAT_TOUR REDKITCHEN --frames 20

Of each sequence, detector and class: frames, flips of the optimum and draws of random flips that
were compared, the smallest distance of any candidate from its bounds (below 0 a bound is none),
certificates that claimed what was not so, and how loose the bounds are: of the best candidate,
bound less reached, in log odds, quantiles over the flips of the optimum. Exit code 1 where a
bound is none. The detectors are those that ship, keyframes clean, graphs of 300 features.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections import defaultdict
from collections.abc import Iterator
from itertools import product
import os
import sys

import numpy as np

from adversarial_lcd_ros.commands.common import progress_bar
from adversarial_lcd_ros.config import BuilderConfig, LabelConfig, LcdConfig
from adversarial_lcd_ros.evaluation.certificates.gaps import Gap, optimum_gaps, random_gaps
from adversarial_lcd_ros.evaluation.certificates.run import (
    CLASSES,
    CertificateTask,
    certificate_tasks,
)
from adversarial_lcd_ros.evaluation.markdown import table
from adversarial_lcd_ros.evaluation.streams import load_stream_graphs, open_streams
from adversarial_lcd_ros.evaluation.workers import local_workers
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.targets import needed_variant

# Bounds and scores are summed in another order; certificates allow for it.
SLACK = 1e-4
QUANTILES = (0.1, 0.5, 0.9)
DRAWS, SEED = 20, 11
HEAD = ('sequence', 'detector', 'class', 'frames', 'steps', 'random draws', 'smallest distance',
        'false claims', *(f'loose, {100 * share:.0f} %' for share in QUANTILES))
# Sequence, detector, class.
Name = tuple[str, str, str]


def compare(task: CertificateTask) -> list[tuple[Name, list[Gap], list[Gap]]]:
    """Return of each frame what the optimum and random flips leave of its bounds."""
    detector, rng = LoopClosureDetector(task.lcd), np.random.default_rng(SEED)
    found = []
    for number, graph in enumerate(load_stream_graphs(task.stream.graphs)[:task.frames[-1] + 1]):
        if number in task.frames:
            kind = next(name for name, value in CLASSES.items()
                        if task.stream.labels.kind[number] == value)
            draws = rng.integers(1, task.budget + 1, DRAWS).tolist()
            found.append(((task.stream.name, f'`{task.lcd.target}, {task.lcd.defences}`', kind),
                          list(optimum_gaps(detector, graph, task.budget)),
                          list(random_gaps(detector, graph, task.budget, draws, rng))))
        detector.remember(graph)
    return found


def make_tasks(options: Namespace) -> Iterator[CertificateTask]:
    """Yield the frames of every detector on every sequence, a few at a time."""
    for variant in dict.fromkeys(map(needed_variant, options.targets)):
        streams = open_streams(options.sequences, [options.features], BuilderConfig(),
                               LabelConfig(), None, lambda *_: None, variant=variant)
        for stream, target, defences in product(streams, options.targets, options.defences):
            if needed_variant(target) == variant:
                lcd = LcdConfig(target=target, defences=defences)
                yield from certificate_tasks(stream, lcd, options.budget, options.frames)


def line(name: Name, frames: list[tuple[list[Gap], list[Gap]]]) -> list[str]:
    """Return a line of the table."""
    best = [gap for of, _ in frames for gap in of]
    drawn = [gap for _, of in frames for gap in of]
    every = [*best, *drawn]
    loose = [f'{value:.2f}' for value in np.quantile([gap.loose for gap in best], QUANTILES)
             ] if best else ['-'] * len(QUANTILES)
    cells = [*name, str(len(frames)), str(len(best)), str(len(drawn)),
             f'{min(gap.inside for gap in every):.1e}',
             str(sum(not gap.kept for gap in every)), *loose]
    return cells


def main() -> None:
    """Print the table."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument('sequences', nargs='+')
    parser.add_argument('--targets', nargs='+', default=['edges', 'wl', 'symbio'])
    parser.add_argument('--defences', nargs='+', default=['none', 'length_check'])
    parser.add_argument('--frames', type=int, default=20, help='most of each class, spread over '
                        'the sequence (default: %(default)s)')
    parser.add_argument('--budget', type=int, default=27, help='most flips (default: %(default)s)')
    parser.add_argument('--features', type=int, default=300, help='(default: %(default)s)')
    parser.add_argument('--jobs', type=int, default=os.cpu_count())
    options = parser.parse_args()
    tasks = list(make_tasks(options))
    found: dict[Name, list[tuple[list[Gap], list[Gap]]]] = defaultdict(list)
    with local_workers(options.jobs) as run, progress_bar('frames') as progress:
        for part in run(compare, tasks):
            for name, best, drawn in part:
                found[name].append((best, drawn))
            progress(sum(map(len, found.values())), sum(len(task.frames) for task in tasks))
    print(*table(HEAD, (line(name, found[name]) for name in sorted(found))), sep='\n')
    gaps = [gap for frames in found.values() for pair in frames for of in pair for gap in of]
    least = min((gap.inside for gap in gaps), default=0.0)
    print(f'\n{len(gaps)} comparisons; the smallest distance is {least:.1e}')
    sys.exit(least < -SLACK or not all(gap.kept for gap in gaps))


if __name__ == '__main__':
    main()
