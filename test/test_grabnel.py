# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""GRABNEL as a rival search: budgets, its acquisition, and a detector that it should break."""

from graph_factory import graphs, make_graph
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from adversarial_lcd_ros.attack.attacker import Attacker
from adversarial_lcd_ros.attack.searches.grabnel import _mutated
from adversarial_lcd_ros.attack.surrogates import Kernel
from adversarial_lcd_ros.attack.surrogates.ard import RelevanceDetermination
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.lcd.decision import probability

RING = make_graph(60, [*((k, (k + 1) % 60) for k in range(60)), *((0, k) for k in range(2, 30))])


class EdgeDetector:
    """Wants the clean graph's edges back: each that is gone costs one log odd."""

    def __init__(self, clean, level=6.5):
        self.clean, self.level, self.asked = clean, level, []

    def __call__(self, graph):
        self.asked.append(graph)
        gone = self.clean.has_edges(self.clean.flips_to(graph).astype(np.int64)).sum()
        return probability(self.level - gone)


def attacked(graph, detector, **values):
    return Attacker(AttackConfig(**{'search': 'grabnel', **values})).process(graph, detector)


@given(graphs(min_nodes=6), st.integers(1, 4), st.integers(2, 15),
       st.sampled_from(['both', 'add', 'delete']))
@settings(max_examples=25, deadline=None)
def test_it_keeps_to_its_budgets_and_repeats(graph, edits, queries, which):
    ratio, runs = (edits + 0.5) / graph.node_count**2, []
    for _ in range(2):
        detector = EdgeDetector(graph)
        result = attacked(graph, detector, ratio=ratio, queries_per_edit=queries, edits=which)
        runs.append((result.perturbed, detector.asked))
    assert runs[0] == runs[1]
    assert result.queries == len(detector.asked) <= result.query_budget == edits * queries
    for asked in detector.asked:
        flips = graph.flips_to(asked)
        assert len(flips) <= edits
        if which != 'both':
            assert (graph.has_edges(flips.astype(np.int64)) == (which == 'delete')).all()
    assert result.loss_after >= result.loss_before


def test_every_stage_has_its_share_of_the_queries():
    detector = EdgeDetector(RING)
    attacked(RING, detector, ratio=1e-3, queries_per_edit=20)
    flips = [len(RING.flips_to(graph)) for graph in detector.asked]
    assert [flips.count(number) for number in range(4)] == [1, 20, 20, 19]


def test_it_learns_that_deletions_gain_where_random_flips_mostly_add():
    detector = EdgeDetector(RING, level=20.0)
    result = attacked(RING, detector, ratio=2e-3, queries_per_edit=20)
    assert result.loss_after - result.loss_before == pytest.approx(7)  # a log odd each edit
    late = detector.asked[len(detector.asked) // 2:]
    deletes = np.mean([len(RING.flips_to(graph)) == RING.edge_count - graph.edge_count
                       for graph in late])
    assert deletes > 0.5  # one in twenty pairs is an edge


def test_expected_improvement_is_the_mean_of_what_exceeds_the_best():
    rng = np.random.default_rng(0)
    features = rng.normal(size=(30, 3))
    loss = features @ (2.0, 0.0, -1.0) + rng.normal(size=30)
    model = RelevanceDetermination(Kernel())
    assert model.fit(features, loss)
    asked, best = rng.normal(size=(5, 3)), float(loss.max()) - 1
    found = model.expected_improvement(asked, best)
    mean = model.predict(asked)
    spread = model._model.predict(
        (asked - features.mean(axis=0)) / features.std(axis=0), return_std=True)[1]
    level = (best - loss.mean()) / loss.std()
    for row in range(5):
        expected, _ = quad(lambda y, row=row: (y - level) * norm.pdf(y, mean[row], spread[row]),
                           level, level + 20)
        assert found[row] == pytest.approx(expected, abs=1e-6)


def test_a_mutation_moves_one_end():
    pairs = np.array([[3, 8], [1, 5], [0, 9]])
    moved = _mutated(pairs, 30, 10, np.random.default_rng(0))
    kept = moved == pairs[np.arange(30) % 3]
    assert (kept.sum(axis=1) >= 1).all()
    assert (kept.sum(axis=1) == 1).sum() > 15
    assert pairs.tolist() == [[3, 8], [1, 5], [0, 9]]


def test_without_queries_it_is_refused():
    with pytest.raises(ConfigError, match='"surrogate"'):
        Attacker(AttackConfig(search='grabnel', mode='surrogate'))
