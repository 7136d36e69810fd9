# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recall: which edges it replays and erases, what it learns from answers, what it spends."""

from dataclasses import replace

from graph_factory import graphs, make_graph
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.attack import deadline as deadline_module
from adversarial_lcd_ros.attack import memory as memory_module
from adversarial_lcd_ros.attack.attacker import Attacker
from adversarial_lcd_ros.attack.memory import Memory
from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.errors import BudgetError
from adversarial_lcd_ros.evaluation.replay.offline import run_offline
from adversarial_lcd_ros.lcd.decision import probability
from adversarial_lcd_ros.messages.types import LcdAnswer

RING = [(k, k + 1) for k in range(2, 59)]
SPOKES = [(0, k) for k in range(10, 22)] + [(1, k) for k in range(30, 42)]
LABELS = np.r_[5, 6, np.arange(58)].astype(np.uint32)
GRAPH = make_graph(60, RING + SPOKES, objects=2, label=LABELS)
SETTINGS = AttackConfig(search='recall', ratio=1e-3)


def later(graph, seconds):
    return replace(graph, stamp_ns=graph.stamp_ns + round(seconds * 1e9))


def pairs(array):
    return {tuple(pair) for pair in array.tolist()}


class Detector:
    """Counts the edges of a secret set; keeps what it was asked."""

    def __init__(self, secret, at_least, soft=True):
        self.secret, self.at_least, self.soft, self.asked = set(secret), at_least, soft, []

    def __call__(self, graph):
        self.asked.append(graph)
        logit = len(pairs(graph.edge) & self.secret) - self.at_least + 0.5
        return LcdAnswer(len(self.asked), logit >= 0, self.soft,
                         probability(logit) if self.soft else float(logit >= 0))


def silent(graph):
    """Answer as a detector does that has nothing to compare with."""
    return LcdAnswer(0, False, True, 0.0)


def remembering(*seen, config=SETTINGS):
    attacker = Attacker(config)
    for graph in seen:
        attacker.process(graph, Detector([], 1))
    return attacker


@pytest.mark.parametrize('step', ['mutual', '_match_objects'])
def test_matching_looks_at_the_clock_between_its_steps(monkeypatch, step):
    past = [False]
    known = getattr(memory_module, step)

    def slow(*given):
        past[0] = True
        return known(*given)

    def after(*given):
        pytest.fail('matched on beyond the deadline')

    memory = Memory()
    memory.add(GRAPH)
    monkeypatch.setattr(deadline_module.time, 'monotonic', lambda: float(past[0]))
    monkeypatch.setattr(memory_module, step, slow)
    following = {'mutual': '_match_objects', '_match_objects': 'Echo'}[step]
    monkeypatch.setattr(memory_module, following, after)
    with deadline_module.ending_at(0.5), pytest.raises(BudgetError, match='deadline'):
        memory.echo(GRAPH, 0)


def test_an_echo_of_the_same_graph_is_its_edges():
    memory = Memory()
    memory.add(GRAPH)
    echo = memory.echo(later(GRAPH, 20), 0)
    assert pairs(echo.pairs) == pairs(GRAPH.edge)
    assert echo.weight == pytest.approx(1)
    assert pairs(echo.pairs[echo.at_object]) == set(SPOKES)


@given(graphs(), graphs(), st.booleans())
@settings(max_examples=60, deadline=None)
def test_an_echo_names_valid_pairs_of_objects_of_one_class(now, past, same_descriptors):
    if same_descriptors and now.node_count == past.node_count:
        past = replace(past, descriptor=np.where(past.tier[:, None] == 1, now.descriptor, 0))
    memory = Memory()
    memory.add(past)
    echo = memory.echo(now, 0)
    assert len(echo.pairs) == len(echo.weight) == len(echo.at_object) <= past.edge_count
    assert len(pairs(echo.pairs)) == len(echo.pairs)
    assert (echo.pairs[:, 0] < echo.pairs[:, 1]).all()
    assert (echo.pairs < now.node_count).all()
    assert (echo.at_object == (echo.pairs[:, 0] < now.object_count)).all()
    assert (echo.weight > 0).all()
    assert (echo.weight <= 1).all()


def test_objects_of_another_class_are_not_taken_for_one_another():
    other = replace(GRAPH, label=np.r_[7, 6, GRAPH.label[2:]].astype(np.uint32))
    memory = Memory()
    memory.add(other)
    echo = memory.echo(GRAPH, 0)
    assert pairs(echo.pairs[echo.at_object]) == {(1, k) for k in range(30, 42)}


def test_it_replays_edges_at_objects_and_learns_that_they_pay():
    missing = [(0, 10), (0, 11), (1, 30)]
    attacker = remembering(GRAPH)
    spent = []
    for at in (20, 21, 22):
        detector = Detector(SPOKES, len(SPOKES))
        result = attacker.process(later(GRAPH.flip([*missing, (40, 41)]), at), detector)
        assert pairs(result.flips) == set(missing)
        spent.append(result.queries)
    assert spent[0] > spent[-1] == 2


def test_it_erases_edges_at_objects():
    result = remembering(GRAPH).process(later(GRAPH, 20), Detector(SPOKES, len(SPOKES) - 2))
    assert result.status == 'success'
    assert pairs(result.flips) <= set(SPOKES)


@pytest.mark.parametrize(('echoes', 'succeeds'), [('objects', True), ('features', False)])
def test_the_family_can_be_chosen(echoes, succeeds):
    attacker = remembering(GRAPH, config=replace(SETTINGS, echoes=echoes))
    result = attacker.process(later(GRAPH, 20), Detector(SPOKES, len(SPOKES) - 2))
    assert (result.status == 'success') == succeeds


def test_single_flips_are_weighed_where_no_plan_succeeds():
    # All edges recur alike, so the plan deletes the first three: one of the three that count.
    config = replace(SETTINGS, echoes='features')
    secret, now = [(2, 3), (6, 7), (8, 9)], later(GRAPH, 20)
    detector = Detector(secret, 1)
    result = remembering(GRAPH, config=config).process(now, detector)
    assert (result.status, result.edit_budget) == ('success', 3)
    assert pairs(result.flips) == set(secret)
    assert result.queries == 1 + 1 + 3 + 6 + 1
    assert all(len(now.flips_to(asked)) <= 3 for asked in detector.asked)
    attacker = remembering(GRAPH, config=replace(config, max_queries=8))
    result = attacker.process(now, Detector(secret, 1))
    assert (result.status, result.queries) == ('failure', 8)
    assert result.loss_after > result.loss_before


def test_hard_answers_cost_a_query_a_plan_and_no_more():
    detector = Detector(SPOKES, 1, soft=False)
    result = remembering(GRAPH).process(later(GRAPH, 20), detector)
    assert (result.status, result.queries, len(result.flips)) == ('failure', 3, 0)
    detector = Detector(SPOKES, len(SPOKES) - 2, soft=False)
    assert remembering(GRAPH).process(later(GRAPH, 20), detector).status == 'success'


def test_it_learns_the_temporal_gap_from_answers():
    attacker = Attacker(SETTINGS)
    attacker.process(GRAPH, silent)
    attacker.process(later(GRAPH, 2), silent)
    result = attacker.process(later(GRAPH, 3), Detector(RING, len(RING) - 2))
    assert result.status == 'success'
    attacker = Attacker(SETTINGS)
    for at in (0, 6, 15):
        attacker.process(later(GRAPH, at), silent)
    result = attacker.process(later(GRAPH, 14.5), Detector(RING, len(RING) - 2))
    assert result.reason == 'no graph left to recall'


def test_it_remembers_what_it_forwarded():
    attacker = remembering(GRAPH)
    first = attacker.process(later(GRAPH, 20), Detector(RING, len(RING) - 2))
    second = attacker.process(later(GRAPH, 40), Detector(RING, len(RING) - 2))
    assert first.status == second.status == 'success'
    attacker = remembering(GRAPH.flip(RING))
    assert attacker.process(later(GRAPH, 20), Detector(RING, 57)).status == 'failure'


def test_an_attack_may_ask_one_detector_and_be_judged_by_another():
    stream = [replace(later(GRAPH, at), sequence=at) for at in (0, 10, 20)]
    attack = AttackConfig(perturbation='random_flip', surrogate='none', ratio=1e-3,
                          queries_per_edit=5)
    own, _ = run_offline(stream, LcdConfig(), attack)
    asked, sent = run_offline(stream, LcdConfig(), attack, asked=LcdConfig(target='vbow'))
    same, _ = run_offline(stream, LcdConfig(), attack, asked=LcdConfig())
    assert [d.probability for d in same.decisions] == [d.probability for d in own.decisions]
    # No flip moves vbow: the reports tell what the detector said that was asked.
    assert all(report.loss_after == report.loss_before for report in asked.reports)
    assert [d.sequence for d in asked.decisions] == [0, 10, 20]
    assert len(sent) == 3
