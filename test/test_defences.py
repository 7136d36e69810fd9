# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Defences that ship: what each lets through, and what not."""

from dataclasses import replace

import cv2
from graph_factory import graphs, make_graph
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from test_builder import assembled

from adversarial_lcd_ros.config import BuilderConfig, LcdConfig
from adversarial_lcd_ros.lcd.defences import DEFENCES, make_defences
from adversarial_lcd_ros.lcd.geometry import find_inliers
from adversarial_lcd_ros.lcd.scoring import Scoring
from adversarial_lcd_ros.lcd.targets import TARGETS
from adversarial_lcd_ros.lcd.views import Comparison, View
from adversarial_lcd_ros.messages.codec import decode_graph, encode_graph
from adversarial_lcd_ros.vision.builder import GraphBuilder

boxes = st.lists(st.tuples(*(st.floats(0, 300, width=32),) * 2,
                           *(st.floats(1, 300, width=32),) * 2), max_size=5)
# On a grid features share places and distances, as ORB's do.
points = st.lists(st.tuples(st.integers(0, 30), st.integers(0, 20)), max_size=25).map(
    lambda grid: [(20 * x + 0.5, 20 * y) for x, y in grid])


def defence(name, **values):
    return DEFENCES.find(name)(LcdConfig(**values))


def received(features, objects, neighbours):
    return decode_graph(encode_graph(assembled(features, objects, neighbours)))


@given(points, boxes, st.integers(0, 8))
@settings(deadline=None)
def test_no_clean_graph_has_an_edge_that_its_nodes_do_not_explain(features, objects, neighbours):
    graph = received(features, objects, neighbours)
    for name in ('rederive', 'rederive_check'):
        assert defence(name, rederive_neighbours=neighbours).unexplained(graph) == 0


def test_nor_has_one_of_real_features():
    # Of several octaves, at one place, equally far: as ORB finds them.
    image = cv2.resize(np.random.default_rng(0).integers(0, 255, (60, 80), np.uint8), (640, 480),
                       interpolation=cv2.INTER_NEAREST)
    with GraphBuilder(BuilderConfig(detector='none')) as builder:
        graph = decode_graph(encode_graph(builder.build(image, 0)))
    assert graph.edge_count > 900
    assert defence('rederive_check').unexplained(graph) == 0


@given(points, boxes, st.integers(0, 8), st.data())
@settings(deadline=None)
def test_flips_are_counted_one_by_one_and_undone(features, objects, neighbours, data):
    graph = received(features, objects, neighbours)
    pairs = np.stack(np.triu_indices(graph.node_count, 1), axis=1)
    chosen = (data.draw(st.sets(st.integers(0, len(pairs) - 1), max_size=12))
              if len(pairs) else ())
    flipped = graph.flip(pairs[sorted(chosen)])
    rederive = defence('rederive', rederive_neighbours=neighbours)
    assert rederive.unexplained(flipped) == len(chosen)
    assert rederive.prepare(flipped) == graph
    check = defence('rederive_check', rederive_neighbours=neighbours)
    assert check.unexplained(flipped) == len(chosen)
    assert check.prepare(flipped) is flipped


def test_every_single_flip_is_seen():
    rng = np.random.default_rng(0)
    graph = received(rng.uniform(0, 400, (40, 2)), [(10, 10, 200, 100), (250, 60, 90, 90)], 6)
    check = defence('rederive_check')
    pairs = np.stack(np.triu_indices(graph.node_count, 1), axis=1)
    assert {check.unexplained(graph.flip([pair])) for pair in pairs} == {1}


def test_of_several_defences_edges_are_counted_once():
    graph = received(np.random.default_rng(0).uniform(0, 400, (20, 2)), [], 6)
    several = make_defences(LcdConfig(defences='rederive_check, length_check, rederive'))
    scoring = Scoring(TARGETS['edges'](), several)
    assert scoring.unexplained(graph) == 0
    assert scoring.unexplained(graph.flip([(0, 1), (2, 3)])) == 2
    assert Scoring(TARGETS['edges']()).unexplained(graph.flip([(0, 1)])) == 0


@given(points, boxes, st.integers(0, 8), st.integers(0, 30))
@settings(deadline=None)
def test_whoever_passes_more_neighbours_takes_nothing_from_a_clean_graph(features, objects,
                                                                         neighbours, more):
    graph = received(features, objects, neighbours)
    check = defence('nearest_check', nearest_neighbours=neighbours + more)
    assert check.unexplained(graph) == 0
    assert check.prepare(graph) == graph


@given(points, boxes, st.integers(0, 4), st.integers(0, 8), st.data())
@settings(deadline=None)
def test_what_is_left_is_among_the_nearest_and_all_at_objects(features, objects, neighbours, more,
                                                              data):
    graph = received(features, objects, neighbours)
    pairs = np.stack(np.triu_indices(graph.node_count, 1), axis=1)
    chosen = data.draw(st.sets(st.integers(0, len(pairs) - 1), max_size=12)) if len(pairs) else ()
    flipped = graph.flip(pairs[sorted(chosen)])
    check = defence('nearest_check', nearest_neighbours=neighbours + more)
    left = check.prepare(flipped)
    changed = {tuple(pair) for pair in flipped.flips_to(left).tolist()}
    assert check.unexplained(flipped) == len(changed)
    # By brute force: how many other features are nearer, from either end.
    first = graph.object_count
    place = graph.position[first:].astype(float)
    apart = np.linalg.norm(place[:, None] - place, axis=2)
    np.fill_diagonal(apart, np.inf)
    for pair in pairs[sorted(chosen)]:
        u, v = pair - first
        nearer = u >= 0 and min((apart[end] < apart[u, v] - 1e-6).sum() for end in (u, v))
        cannot_be = not graph.has_edges([pair])[0] and nearer >= neighbours + more
        assert (tuple(pair) in changed) == (u < 0 or cannot_be)


def test_an_edge_to_a_far_feature_is_dropped_and_one_to_an_object_is_put_back():
    # Along a line: the nearest of each are those beside it.
    graph = received([(20 * x + 300, 200) for x in range(8)], [(10, 10, 100, 100)], 2)
    check = defence('nearest_check', nearest_neighbours=3)
    # Node 0 is the object. The third nearest of node 1 is 4; 6 is none of those of 3, nor 3 of 6.
    assert check.unexplained(graph.flip([(1, 4)])) == 0
    for pair in [(3, 6), (0, 4)]:
        flipped = graph.flip([pair])
        assert check.unexplained(flipped) == 1
        assert check.prepare(flipped) == graph
    # One that was taken away between neighbours cannot be told.
    taken = graph.flip([(3, 4)])
    assert check.unexplained(taken) == 0
    assert check.prepare(taken) == taken


def test_with_the_scene_all_edges_follow_from_the_nodes():
    graph = assembled(features=[(15, 15), (45, 45), (300, 90), (320, 240)], neighbours=2,
                      objects=[(10, 10, 40, 40), (40, 40, 20, 20)], variant='anchors')
    check = defence('nearest_check', nearest_neighbours=40)
    assert check.prepare(graph) == graph
    flipped = graph.flip([(0, 1), (0, 5), (4, 5)])
    assert check.unexplained(flipped) == 3
    assert check.prepare(flipped) == graph


def credited(one, other, **values):
    """Return the edges of one graph that may recur in the other."""
    nodes = defence('length_check', **values).compare(Comparison(View(one), [View(other)]))
    return {divmod(key, one.node_count) for key in nodes.credit[0].tolist()}


def test_an_edge_recurs_only_at_about_its_length():
    one = make_graph(4, [(0, 1), (0, 2), (0, 3), (1, 2)], objects=0)
    near = replace(one, position=np.array([(0, 0), (100, 0), (0, 100), (30, 40)], np.float32))
    # The diagonal is 800: a slack of 8 pixels.
    far = replace(one, position=np.array([(0, 0), (208, 0), (0, 209), (30, 40)], np.float32))
    assert credited(near, far) == credited(far, near) == {(0, 1), (0, 3)}
    assert credited(near, far, length_factor=3.0) == {(0, 1), (0, 2), (0, 3), (1, 2)}
    assert credited(near, far, length_slack=0.0) == {(0, 3)}


@given(graphs(max_nodes=12), st.integers(0, 2**16))
@settings(deadline=None)
def test_the_length_check_is_the_same_from_either_side(graph, seed):
    other = replace(graph, position=np.random.default_rng(seed).uniform(
        0, 480, graph.position.shape).astype(np.float32))
    assert credited(graph, other) == credited(other, graph)
    assert credited(graph, graph) == {
        (u, v) for u, v in graph.edge.tolist() if u >= graph.object_count}


def poster(size, seed=0, count=60):
    """Return two frames that agree on a motion within a square of so many pixels alone."""
    rng = np.random.default_rng(seed)
    one = make_graph(count, [], objects=0, seed=seed)
    at = rng.uniform(0, size, (count, 2)).astype(np.float32)
    return replace(one, position=at), replace(one, position=at * 0.9 + np.float32(3))


def test_the_hull_of_the_inliers_is_a_share_of_the_smaller_frame():
    one, other = poster(400)
    found = find_inliers(one, other, 3.0)
    assert found.count == 60
    assert 0.7 * 0.81 * 400**2 < found.cover * 640 * 480 < 0.81 * 400**2
    assert find_inliers(other, one, 3.0).cover == pytest.approx(found.cover)


def test_a_poster_passes_the_check_and_not_its_hull():
    one, other = poster(150)
    assert defence('geometric_check').support(one, other) == 3.0
    covered = find_inliers(one, other, 3.0).cover
    assert defence('geometric_check', geometric_hull=0.1).support(one, other) == pytest.approx(
        covered / 0.1)
    assert covered < 0.07
    whole = poster(450)
    assert defence('geometric_check', geometric_hull=0.1).support(*whole) > 1
