# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stepwise search: what becomes of flips that were asked about, and controls with a known end."""

from graph_factory import graphs, make_graph
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.attack.attacker import Attacker
from adversarial_lcd_ros.attack.perturbations import make_perturbation
from adversarial_lcd_ros.attack.searches.tries import Tries
from adversarial_lcd_ros.config import RETRIES, AttackConfig
from adversarial_lcd_ros.lcd.decision import probability
from adversarial_lcd_ros.messages.types import LcdAnswer

HUBS, LEAVES = 4, 14
# Objects pairwise joined, and fourteen features on each: 60 nodes, so 3 edits at r = 1e-3.
CLIQUE = [(a, b) for a in range(HUBS) for b in range(a + 1, HUBS)]
STAR = make_graph(HUBS * (1 + LEAVES), [
    *CLIQUE, *((hub, HUBS + hub * LEAVES + leaf) for hub in range(HUBS)
               for leaf in range(LEAVES))], objects=HUBS)


class CliqueDetector:
    """Declares a loop while at most two edges of the hub clique are gone, and never otherwise."""

    def __init__(self, soft=True, offset=0.0):
        self.soft, self.offset, self.asked = soft, offset, []

    def __call__(self, graph):
        self.asked.append(graph)
        there = int(graph.has_edges(np.array(CLIQUE)).sum())
        logit = there - len(CLIQUE) + 2.5
        chance = probability(logit + self.offset)
        return LcdAnswer(0, logit > 0, self.soft, chance if self.soft else float(logit > 0),
                         log_odds=logit + self.offset if self.soft else np.nan)


class PairDetector:
    """Gives each pair a weight of its own and adds up those of the edges."""

    def __init__(self, clean, seed, soft):
        rng = np.random.default_rng(seed)
        self.weight = rng.integers(-3, 4, (clean.node_count, clean.node_count)) / 4
        self.soft, self.asked = soft, []
        self.level = self.sum(clean) - rng.choice([-2.1, 2.1])

    def sum(self, graph):
        edge = graph.edge.astype(int)
        return float(self.weight[edge[:, 0], edge[:, 1]].sum())

    def __call__(self, graph):
        self.asked.append(graph)
        logit = self.sum(graph) - self.level
        return LcdAnswer(0, logit >= 0, self.soft,
                         probability(logit) if self.soft else float(logit >= 0))


def attacked(detector, graph=STAR, **values):
    return Attacker(AttackConfig(**{'ratio': 1e-3, 'surrogate': 'none', **values})).process(
        graph, detector)


@pytest.mark.parametrize('surrogate', ['none', 'svm_rbf'])
def test_eigencentrality_breaks_a_detector_of_hubs_and_random_flips_do_not(surrogate):
    result = attacked(CliqueDetector(), queries_per_edit=2, surrogate=surrogate)
    assert (result.edit_budget, result.query_budget) == (3, 6)
    assert (result.status, result.queries) == ('success', 6)
    assert {tuple(pair) for pair in result.flips.tolist()} < set(CLIQUE)
    for seed in range(20):
        result = attacked(CliqueDetector(), perturbation='random_flip', seed=seed,
                          queries_per_edit=2, surrogate=surrogate)
        assert (result.status, result.queries) == ('failure', 6)


@pytest.mark.parametrize('surrogate', ['none', 'svm_rbf'])
@pytest.mark.parametrize(('retry', 'status', 'clique_edges', 'queries'), [
    ('never', 'failure', 1, 30),  # all six are asked about first, and five thrown away
    ('gained', 'success', 3, 22),  # 1 on the clean graph, 10, 10, and the first one after
    ('set', 'success', 3, 30),  # 1, 28 flips, and the best three at once
])
def test_a_flip_that_gained_is_needed_again(retry, status, clique_edges, queries, surrogate):
    result = attacked(CliqueDetector(), retry=retry, queries_per_edit=10, surrogate=surrogate)
    assert result.status == status
    assert len({tuple(pair) for pair in result.flips.tolist()} & set(CLIQUE)) == clique_edges
    assert result.queries == queries <= result.query_budget == 30


@pytest.mark.parametrize('retry', ['gained', 'set'])
def test_answers_that_are_certain_in_double_precision_still_tell_what_gains(retry):
    detector = CliqueDetector(offset=60.0)
    assert detector(STAR).probability == detector(STAR.flip([(0, 1)])).probability == 1.0
    result = attacked(detector, retry=retry, queries_per_edit=10)
    assert result.status == 'success'
    assert result.loss_after - result.loss_before == pytest.approx(3)


def test_hard_answers_have_nothing_that_gained():
    never, gained = (CliqueDetector(soft=False) for _ in range(2))
    attacked(never, retry='never', queries_per_edit=10)
    attacked(gained, retry='gained', queries_per_edit=10)
    assert never.asked == gained.asked


@pytest.mark.parametrize('perturbation', ['eigencentrality', 'random_flip', 'shortest_path'])
@given(graph=graphs(min_nodes=6), seed=st.integers(0, 2**16), soft=st.booleans(),
       retry=st.sampled_from(RETRIES), queries=st.integers(1, 7), edits=st.integers(1, 7))
@settings(max_examples=60, deadline=None)
def test_every_rule_keeps_to_its_budgets_and_repeats(perturbation, graph, seed, soft, retry,
                                                     queries, edits):
    ratio = (edits + 0.5) / graph.node_count**2
    runs = []
    for _ in range(2):
        detector = PairDetector(graph, seed, soft)
        result = attacked(detector, graph, retry=retry, ratio=ratio, queries_per_edit=queries,
                          perturbation=perturbation, seed=seed)
        runs.append((result.perturbed, detector.asked))
    assert runs[0] == runs[1]
    if result.status == 'skipped':
        assert edits * queries < 2
        return
    assert result.edit_budget == edits
    assert result.queries == len(detector.asked) <= result.query_budget == edits * queries
    assert all(len(graph.flips_to(asked)) <= edits for asked in detector.asked)
    assert result.loss_after >= result.loss_before
    turned = detector(result.perturbed).is_loop != detector(graph).is_loop
    assert result.status == ('success' if turned else 'failure')


def test_what_gained_waits_by_falling_gain_and_nothing_else_comes_again():
    perturbation, rng = make_perturbation('eigencentrality'), np.random.default_rng(0)
    for retry in RETRIES:
        tries = Tries(retry, 'both')
        first = tries.pool(perturbation, STAR, 6, rng)
        assert {tuple(pair) for pair in first.tolist()} == set(CLIQUE)
        for pair, gain in zip(first, (0.5, 0.0, 2.0, -1.0, 2.0, 1.0), strict=True):
            tries.asking(STAR, pair)
            tries.asked(pair, gain)
        tries.committed(first[2:3])
        again = tries.pool(perturbation, STAR, 6, rng)
        waiting = first[[4, 5, 0]].tolist() if retry == 'gained' else []
        assert again[:len(waiting)].tolist() == waiting
        assert len(again) == len(waiting) + 6
        assert not {tuple(pair) for pair in again[len(waiting):].tolist()} & set(CLIQUE)
        if waiting:  # asked about again, now without gain
            tries.asking(STAR, again[0])
            tries.asked(again[0], 0.0)
            assert tries.pool(perturbation, STAR, 0, rng).tolist() == waiting[1:]


@pytest.mark.parametrize(('retry', 'sizes'), [
    ('never', [1, 1, 1, 1]), ('gained', [1, 1, 1, 1]), ('set', [3, 1])])
def test_no_step_commits_more_than_is_left(retry, sizes):
    tries, left, found = Tries(retry, 'both'), 4, []
    while left:
        found.append(tries.step_size(left))
        left -= found[-1]
    assert found == sizes
