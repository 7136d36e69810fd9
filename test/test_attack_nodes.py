# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Attacks on nodes: moved features and replayed graphs, their budgets and what is counted."""

from dataclasses import replace

import cv2
from graph_factory import flips_of, graphs, make_graph
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.attack.attacker import Attacker, AttackResult
from adversarial_lcd_ros.attack.forging import (
    Change,
    among_nearest,
    change_between,
    neighbours_of,
    with_positions,
)
from adversarial_lcd_ros.attack.oracle import edit_budget
from adversarial_lcd_ros.attack.searches.move_nodes import _closest_knit
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.frames.attacked import _check_budgets
from adversarial_lcd_ros.messages import codec

SECOND = 1_000_000_000
K = 4


def built(seed=0, nodes=40, objects=2, **fields):
    """Return a graph with the edges that the builder's rule gives its nodes."""
    graph = make_graph(nodes, (), objects, seed, **fields)
    return with_positions(graph, graph.position, K)


def walked(attacker, count=6):
    """Let some graphs go by, ten seconds apart; return them."""
    past = [built(seed, stamp_ns=10 * seed * SECOND, sequence=seed) for seed in range(count)]
    for graph in past:
        attacker.observe(graph)
    return past


def alike(graph, **fields):
    """Return another view whose features look like a graph's, at other places."""
    rng = np.random.default_rng(99)
    position = (rng.random(graph.position.shape) * (640, 480)).astype(np.float32)
    return replace(with_positions(graph, position, K), stamp_ns=1000 * SECOND, sequence=77,
                   session=5, **fields)


@pytest.mark.parametrize('objects', [0, 1, 3])
def test_k_of_the_rule_shows_in_a_graph(objects):
    assert neighbours_of(built(nodes=40, objects=objects)) == K


def test_a_graph_moved_nowhere_is_the_same():
    graph = built()
    assert with_positions(graph, graph.position, neighbours_of(graph)) == graph
    assert change_between(graph, graph) == Change()


def test_edges_that_follow_from_moved_nodes_are_no_edits():
    graph = built()
    position = graph.position.copy()
    position[5:9] = position[[6, 7, 8, 5]]
    moved = with_positions(graph, position, K)
    assert change_between(graph, moved) == Change(0, 4)
    assert len(moved.edge)
    assert not np.array_equal(moved.edge, graph.edge)


def test_edges_flipped_beside_moved_nodes_are_edits():
    graph = built()
    position = graph.position.copy()
    position[5] = 1.0
    moved = with_positions(graph, position, K).flip(
        flips_of(graph, np.random.default_rng(1), 3))
    assert change_between(graph, moved) == Change(3, 1)


@given(graphs(), st.integers(0, 5), st.integers(0, 99))
def test_flips_alone_are_edits_alone(graph, count, seed):
    pairs = flips_of(graph, np.random.default_rng(seed), count)
    assert change_between(graph, graph.flip(pairs)) == Change(len(pairs), 0)


@given(st.integers(2, 12), st.integers(1, 12), st.integers(0, 99))
def test_peeling_keeps_what_is_joined(nodes, count, seed):
    joined = np.triu(np.random.default_rng(seed).random((nodes, nodes)), 1)
    joined += joined.T
    kept = _closest_knit(joined, count)
    assert len(kept) == min(nodes, count)
    if 1 < count < nodes:
        # The average of all sets of that size is no better.
        average = joined.sum() / (nodes * (nodes - 1))
        assert joined[np.ix_(kept, kept)].sum() >= average * count * (count - 1) - 1e-9


def never(graph):
    """Answer that a graph is likely no loop."""
    return 0.2


def spied(answer, asked):
    """Return a detector that keeps what it was asked."""
    def ask(graph):
        asked.append(graph)
        return answer
    return ask


@pytest.mark.parametrize('budget', [3, 12, 100])
def test_moved_features_take_the_places_of_the_past(budget):
    attacker = Attacker(AttackConfig(search='move_nodes', nodes_moved=budget))
    past = walked(attacker)
    clean, asked = alike(past[2]), []
    attacker.attack(clean, spied(0.2, asked))
    forged = asked[1]  # the graph that shares most words is tried first
    moved = (forged.position != clean.position).any(axis=1)
    assert 0 < moved.sum() <= min(budget, 38)
    np.testing.assert_array_equal(forged.position[moved], past[2].position[moved])
    assert not moved[:clean.object_count].any()
    assert codec.decode_graph(codec.encode_graph(forged)) == forged


def test_with_all_features_moved_all_edges_between_them_recur():
    attacker = Attacker(AttackConfig(search='move_nodes', nodes_moved=100))
    past = walked(attacker)
    asked = []
    attacker.attack(alike(past[2]), spied(0.2, asked))
    between = past[2].edge[:, 0] >= 2
    assert asked[1].has_edges(past[2].edge[between]).all()


@pytest.mark.parametrize('search', ['move_nodes', 'replay'])
@pytest.mark.parametrize('answer', [0.2, 0.9, False, True])
def test_budgets_hold_and_the_same_seed_gives_the_same(search, answer):
    results = []
    for _ in range(2):
        attacker = Attacker(AttackConfig(search=search, nodes_moved=10))
        past, asked = walked(attacker), []
        clean = replace(alike(past[1]), stamp_ns=past[-1].stamp_ns + SECOND)
        result = attacker.attack(clean, spied(answer, asked))
        assert result.change.nodes <= result.node_budget
        assert not result.change.edits
        assert len(asked) == result.queries <= result.query_budget
        assert len(asked) > 1
        assert result.edit_budget == 0
        _check_budgets(result, len(asked))
        results.append([codec.encode_graph(graph) for graph in asked])
    assert results[0] == results[1]


def test_a_replayed_graph_has_the_present_stamp():
    attacker = Attacker(AttackConfig(search='replay'))
    past = walked(attacker)
    clean = alike(past[2])
    result = attacker.attack(clean, lambda graph: 0.9 if graph != clean else 0.2)
    assert result.status == 'success'
    assert result.queries == 2
    forged = result.perturbed
    assert (forged.stamp_ns, forged.sequence, forged.session) == (1000 * SECOND, 77, 5)
    assert forged == replace(past[2], stamp_ns=1000 * SECOND, sequence=77)
    report = result.report()
    assert report.nodes_moved == report.node_budget == 40
    assert report.edits == 0


def test_to_suppress_a_graph_is_replayed_that_is_too_young():
    attacker = Attacker(AttackConfig(search='replay'))
    past = walked(attacker)
    clean, asked = replace(alike(past[0]), stamp_ns=past[-1].stamp_ns + SECOND), []
    attacker.attack(clean, spied(0.9, asked))
    assert asked[1:] == [replace(past[-1], stamp_ns=clean.stamp_ns, sequence=77)]


@pytest.mark.parametrize('search', ['move_nodes', 'replay'])
def test_without_queries_the_most_alike_graph_is_repeated(search):
    attacker = Attacker(AttackConfig(search=search, mode='surrogate', nodes_moved=10))
    past = walked(attacker)
    result = attacker.attack(alike(past[3]), never)
    assert result.queries == 0
    assert 0 < result.change.nodes <= result.node_budget


@pytest.mark.parametrize('search', ['move_nodes', 'replay'])
def test_with_nothing_remembered_nothing_is_changed(search):
    result = Attacker(AttackConfig(search=search)).process(built(), never)
    assert result.perturbed is result.clean
    assert result.reason == 'no graph left to recall'


def test_pictures_of_another_size_are_not_recalled():
    attacker = Attacker(AttackConfig(search='move_nodes'))
    past = walked(attacker)
    result = attacker.attack(replace(alike(past[2]), width=1280, height=960), never)
    assert result.queries == 1
    assert result.reason == 'no graph left to recall'


def test_who_moves_more_nodes_than_granted_is_refused():
    graph = built()
    moved = with_positions(graph, graph.position[::-1].copy(), K)
    with pytest.raises(EvaluationError, match='nodes of 5'):
        _check_budgets(AttackResult(graph, moved, 'failure', node_budget=5), 0)


def test_edge_attacks_keep_their_budget():
    result = Attacker(AttackConfig(search='recall', ratio=1e-2)).attack(built(), never)
    assert result.edit_budget == edit_budget(40, 1e-2)
    assert result.node_budget == 0


def test_reports_of_version_1_are_read():
    report = codec.AttackReport(1, 'camera', 2, 'success', node_budget=7, nodes_moved=6)
    assert codec.decode_attack_report(codec.encode_attack_report(report)) == report


def area(graph, rows):
    return cv2.contourArea(cv2.convexHull(graph.position[rows]))


def test_spread_nodes_have_a_larger_hull():
    found = {}
    for moved in ('close', 'spread'):
        attacker = Attacker(AttackConfig(search='move_nodes', nodes_moved=8, moved=moved))
        past, asked = walked(attacker), []
        clean = alike(past[2])
        attacker.attack(clean, spied(0.2, asked))
        found[moved] = area(asked[1], (asked[1].position != clean.position).any(axis=1))
    assert found['spread'] > found['close']


@pytest.mark.parametrize('settings', [{'lengths': True}, {'nearest': 8}])
def test_recall_keeps_to_what_a_check_passes(settings):
    attacker = Attacker(AttackConfig(search='recall', ratio=0.02, **settings))
    past, asked = walked(attacker), []
    clean = alike(past[2])
    attacker.attack(clean, spied(0.2, asked))
    assert len(asked) > 1
    for graph in asked[1:]:
        pairs = clean.flips_to(graph).astype(np.int64)
        assert not clean.has_edges(pairs).any()
        if 'nearest' in settings:
            assert among_nearest(clean, pairs, 8).all()
        else:
            # All features look like those of one graph, node for node.
            here, there = clean.length_between(pairs), past[2].length_between(pairs)
            assert (np.maximum(here, there) <= 2 * np.minimum(here, there) + 0.01).all()


def test_who_may_only_add_suppresses_nothing():
    attacker = Attacker(AttackConfig(search='recall', ratio=0.02, nearest=8))
    past = walked(attacker)
    assert attacker.attack(alike(past[2]), lambda graph: 0.9).queries == 1
