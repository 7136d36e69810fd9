"""
What another rule of labels moves: frames by kind, and a detector's matches by verdict.

    python benchmarks/label_moves.py SEQUENCE [SEQUENCE ...]
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import replace

import numpy as np

from adversarial_lcd_ros.config import BuilderConfig, LabelConfig, LcdConfig
from adversarial_lcd_ros.evaluation.replay.offline import run_offline
from adversarial_lcd_ros.graph_sequences.opening import open_graphs
from adversarial_lcd_ros.ground_truth.labelling import label_graphs


def main() -> None:
    """Print both tables of every sequence."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('sources', nargs='+', metavar='SEQUENCE')
    parser.add_argument('--before', default='overlap', metavar='RULE')
    parser.add_argument('--after', default='auto', metavar='RULE')
    options = parser.parse_args()
    for source in options.sources:
        sequence = open_graphs(source, BuilderConfig())
        before, after = (label_graphs(sequence.graphs, sequence.trajectory, sequence.source,
                                      replace(LabelConfig(), rule=rule))
                         for rule in (options.before, options.after))
        print(f'{sequence.name}: frames by {options.before} -> by {options.after}')
        for (old, new), count in sorted(Counter(zip(before.names, after.names,
                                                    strict=True)).items()):
            print(f'  {old} -> {new}: {count}')
        decisions = run_offline(sequence.graphs, LcdConfig())[0].decisions
        frame_of = {int(stamp): frame for frame, stamp in enumerate(after.stamp_ns)}
        query = np.array([frame for frame, decision in enumerate(decisions) if decision.is_loop])
        match = np.array([frame_of[decisions[frame].match_stamp_ns] for frame in query])
        verdicts = Counter()
        for frame, named in zip(query, match, strict=True):
            new = ('right' if after.possible[frame, named] else
                   'wrong' if after.elsewhere[frame, named] else 'cannot be told')
            verdicts['right' if before.possible[frame, named] else 'wrong', new] += 1
        print(f'  {len(query)} matches that the detector declares:')
        for (old, new), count in sorted(verdicts.items()):
            print(f'  {old} -> {new}: {count}')
        moved = [(int(f), int(m)) for f, m in zip(query, match, strict=True)
                 if before.possible[f, m] != after.possible[f, m]]
        print(f'  moved (frame, match), every so many-th: {moved[::max(len(moved) // 10, 1)]}')


if __name__ == '__main__':
    main()
