"""
GRABNEL's recipe (Wan et al., NeurIPS 2021) beside ours: same target, same queries.

Written here from the paper's description: Bayesian linear regression with automatic relevance
determination on Weisfeiler-Lehman features node by node, fitted anew after each batch; expected
improvement; candidates from a genetic search over flips; one edit committed after another.
"""

import time

import numpy as np
import pytest
from scipy.stats import norm
from sklearn.linear_model import ARDRegression

from adversarial_lcd_ros.attack.attacker import Attacker
from adversarial_lcd_ros.attack.oracle import Oracle, edit_budget
from adversarial_lcd_ros.attack.search import Hunt
from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.messages.types import LcdQuery
from adversarial_lcd_ros.weisfeiler_lehman.continuous import concatenated_features, node_features

ITERATIONS = 2
START, BATCH, POPULATION, GENERATIONS = 10, 5, 50, 4
# Features: queries a graph, and graphs. A refit takes seconds, and its cost grows as n^3.
SIZES = {100: (40, 3), 200: (15, 1)}


class Grabnel:
    """The recipe, on one graph."""

    def __init__(self, hunt, queries, rng):
        self.hunt, self.rng = hunt, rng
        edits = hunt.edit_budget
        self.queries_an_edit = max(queries // edits, START + BATCH)
        self.x = node_features(hunt.clean)
        self.rows, self.losses = [], []

    def features(self, graph):
        return concatenated_features(graph, self.x, ITERATIONS)

    def random_pairs(self, count):
        return [tuple(sorted(self.rng.choice(self.hunt.clean.node_count, 2, replace=False)))
                for _ in range(count)]

    def evolved(self, base, asked):
        """Return candidates: the best pairs with an end moved, and new ones."""
        best = sorted(asked, key=asked.get)[-POPULATION // 5:]
        population = set(self.random_pairs(POPULATION))
        for _ in range(GENERATIONS):
            for u, v in best:
                w = int(self.rng.integers(base.node_count))
                population.add(tuple(sorted((u if self.rng.random() < 0.5 else v, w))))
        return [pair for pair in population if pair[0] != pair[1] and pair not in asked]

    def expected_improvement(self, graphs):
        rows = np.array(self.rows)
        mean, deviation = rows.mean(axis=0), rows.std(axis=0)
        deviation[deviation == 0] = 1
        model = ARDRegression().fit((rows - mean) / deviation, self.losses)
        expected, spread = model.predict(
            (np.array([self.features(graph) for graph in graphs]) - mean) / deviation,
            return_std=True)
        gain = expected - max(self.losses)
        return gain * norm.cdf(gain / spread) + spread * norm.pdf(gain / spread)

    def step(self):
        """Query flips of the best graph so far, and keep the best of them."""
        base, asked, found = self.hunt.best, {}, None
        chosen = self.random_pairs(START)
        while chosen and len(asked) < self.queries_an_edit and not self.hunt.over:
            for pair in chosen:
                graph = base.flip([pair])
                loss, succeeded = self.hunt.ask(graph)
                asked[pair] = loss
                self.rows.append(self.features(graph))
                self.losses.append(loss)
                if found is None or loss > found[1]:
                    found = graph, loss, succeeded
                if succeeded or self.hunt.over:
                    break
            pairs = self.evolved(base, asked)
            if self.hunt.over or len(asked) >= self.queries_an_edit or succeeded:
                break
            worth = self.expected_improvement([base.flip([pair]) for pair in pairs])
            chosen = [pairs[place] for place in np.argsort(-worth)[:BATCH]]
        if found and found[1] >= self.hunt.loss:
            self.hunt.keep(*found)

    def run(self):
        for _ in range(self.hunt.edit_budget):
            if self.hunt.over:
                break
            self.step()


class Asked:
    """The detector, and how long it took."""

    def __init__(self, detector):
        self.detector, self.seconds = detector, 0.0

    def __call__(self, graph):
        began_s = time.perf_counter()
        answer = self.detector.answer(LcdQuery(0, graph))
        self.seconds += time.perf_counter() - began_s
        return answer


def by_grabnel(graph, ask, queries):
    hunt = Hunt.begin(graph, edit_budget(graph.node_count, AttackConfig().ratio),
                      Oracle(ask, queries))
    before = hunt.loss
    Grabnel(hunt, queries, np.random.default_rng(graph.sequence)).run()
    return hunt.loss - before, hunt.succeeded


def by(attacker, graph, ask):
    result = attacker.attack(graph, ask)
    return result.loss_after - result.loss_before, result.status == 'success'


def cost_and_gain(detector, graphs, attack):
    """Return seconds of the attacker's own, a graph, mean loss gained, decisions changed."""
    ask = Asked(detector)
    began_s = time.perf_counter()
    outcomes = [attack(graph, ask) for graph in graphs]
    own_s = time.perf_counter() - began_s - ask.seconds
    gained, changed = zip(*outcomes, strict=True)
    return own_s / len(graphs), float(np.mean(gained)), sum(changed)


@pytest.mark.parametrize('features', SIZES)
@pytest.mark.parametrize('search', ['stepwise', 'recall'])
def test_beside_grabnel(measured, tour_graphs, features, search, grabnel_costs):
    queries, count = SIZES[features]
    graphs = tour_graphs(features)
    detector = LoopClosureDetector(LcdConfig())
    attacker = Attacker(AttackConfig(search=search, max_queries=queries))
    for graph in graphs[:30]:
        detector.detect(graph)
        attacker.observe(graph)
    attacked = graphs[30:30 + count]
    by(attacker, attacked[0], Asked(detector))  # compiles
    ours_s, gain, changed = cost_and_gain(
        detector, attacked, lambda graph, ask: by(attacker, graph, ask))
    if features not in grabnel_costs:
        grabnel_costs[features] = cost_and_gain(
            detector, attacked, lambda graph, ask: by_grabnel(graph, ask, queries))
    rival_s, rival_gain, rival_changed = grabnel_costs[features]
    measured('grabnel',
             f'n = {attacked[0].node_count}, {queries} queries, {search}: loss gained '
             f'{gain:.3f} beside {rival_gain:.3f}, decisions changed {changed} beside '
             f'{rival_changed} of {count}', ours_s,
             "GRABNEL's recipe, seconds a graph beside the queries", rival_s)


@pytest.fixture(scope='module')
def grabnel_costs():
    """Return what GRABNEL's recipe has cost by size: it is measured once."""
    return {}
