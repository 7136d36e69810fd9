# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What the target symbio owes to its iterations and class weights: training data alone.

    python benchmarks/symbio_designs.py FLAT_TRAIN FR1_RPY@0:0.5 --nodes 60 100 150 300

Of each design, sequence and size of graph: balanced accuracy of the decision that the other
sequence taught, AUC, and the share of the loops found that are lost by the budget of r = 3e-4
in three ways: edges of the clique of objects deleted, spokes deleted at random, random flips.
No attack: nobody is asked, the flips are the same for all designs.
"""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import balanced_accuracy_score, roc_auc_score

from adversarial_lcd_ros.attack.oracle import edit_budget
from adversarial_lcd_ros.config import ANCHORS, BuilderConfig, LcdConfig
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.graph_sequences.opening import open_graphs
from adversarial_lcd_ros.lcd.scoring import Scoring
from adversarial_lcd_ros.lcd.targets.symbio import SymbioTarget
from adversarial_lcd_ros.lcd.views import View
from adversarial_lcd_ros.training.decisions import TrainingSequence, training_pairs
from adversarial_lcd_ros.training.pair_scores import LabelledPairs, PairScorer, fit_decision
from adversarial_lcd_ros.training.plan import TRAINING_LABELS

RATIO, SEED = 3e-4, 7
DESIGNS = [(iterations, 0.5) for iterations in (1, 2, 3, 4)] + [(3, 0.0), (3, 0.25), (3, 1.0)]
WAYS = ('clique', 'spokes', 'random')


@dataclass(frozen=True)
class Part:
    """A training sequence, its pairs, and the loops whose queries are perturbed."""

    pairs: LabelledPairs
    perturbed: dict[str, dict[int, MultiTierGraph]]


def perturb(graph: MultiTierGraph, way: str, rng: np.random.Generator) -> MultiTierGraph:
    """Return a graph with its budget spent in one of the ways, or as far as it goes."""
    edge, objects = graph.edge.astype(np.int64), graph.object_count
    if way == 'random':
        pool = np.stack(np.triu_indices(graph.node_count, 1), axis=1)
    else:
        pool = edge[(edge[:, 1] < objects) if way == 'clique' else
                    ((edge[:, 0] < objects) & (edge[:, 1] >= objects))]
    budget = min(edit_budget(graph.node_count, RATIO), len(pool))
    return graph.flip(pool[rng.choice(len(pool), budget, replace=False)])


def open_part(source: str, nodes: int, count: int, loops: int) -> Part:
    """Return the pairs of a sequence at a size of graph."""
    found = open_graphs(source, BuilderConfig(features=nodes, graph_variant=ANCHORS))
    assert found.trajectory is not None
    sequence = TrainingSequence(found.name, found.graphs, found.trajectory, found.source)
    rng = np.random.default_rng(SEED)
    pairs = training_pairs(sequence, TRAINING_LABELS, count, rng)
    queries = np.unique(pairs.query[pairs.is_loop])
    queries = np.sort(rng.choice(queries, min(loops, len(queries)), replace=False)).tolist()
    return Part(pairs, {way: {query: perturb(found.graphs[query], way, rng) for query in queries}
                        for way in WAYS})


def figures(target: SymbioTarget, parts: Sequence[Part]) -> list[str]:
    """Return the cells of a design, one for each sequence."""
    scoring, window = Scoring(target), LcdConfig().map_window
    cells = []
    for place, part in enumerate(parts):
        other = parts[1 - place]
        decision = fit_decision(scoring, [other.pairs], window)
        scorer = PairScorer(scoring, part.pairs.graphs, window)
        logit = decision.logit(scorer.pairs(part.pairs))
        accuracy = balanced_accuracy_score(part.pairs.is_loop, logit >= 0)
        area = roc_auc_score(part.pairs.is_loop, logit)
        lost = [_lost(scorer, decision.logit, part, logit, graphs)
                for graphs in part.perturbed.values()]
        cells.append(f'{accuracy:.3f} {area:.3f} / ' + ' '.join(f'{share:.2f}' for share in lost))
    return cells


def _lost(scorer: PairScorer, logit_of: object, part: Part, logit: NDArray[np.float64],
          graphs: dict[int, MultiTierGraph]) -> float:
    """Return the share of the loops found that are not found any more."""
    found = [place for place in np.flatnonzero(part.pairs.is_loop & (logit >= 0)).tolist()
             if int(part.pairs.query[place]) in graphs]
    left = [logit_of(scorer.scores(View(graphs[int(part.pairs.query[place])]),  # type: ignore
                                   int(part.pairs.reference[place]))) >= 0 for place in found]
    return 1 - float(np.mean(left)) if left else 0.0


def main() -> None:
    """Print the table."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument('sequences', nargs=2)
    parser.add_argument('--nodes', nargs='+', type=int, default=[300])
    parser.add_argument('--pairs', type=int, default=250)
    parser.add_argument('--loops', type=int, default=60)
    options = parser.parse_args()
    print('n, iterations, other class: accuracy AUC / lost by', *WAYS)
    for nodes in options.nodes:
        parts = [open_part(source, nodes, options.pairs, options.loops)
                 for source in options.sequences]
        for iterations, other_class in DESIGNS:
            target = type('Design', (SymbioTarget,), {
                'iterations': iterations, 'other_class': other_class, 'flip_channels': ()})()
            print(nodes, iterations, other_class, '|', ' | '.join(figures(target, parts)),
                  flush=True)


if __name__ == '__main__':
    main()
