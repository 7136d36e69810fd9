# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The target symbio by hand: what a match is worth by the objects it hangs on, and what is not."""

from dataclasses import replace

from graph_factory import flips_of, graphs, make_graph, with_scene
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.config import BuilderConfig, LabelConfig, LcdConfig, ReplayConfig
from adversarial_lcd_ros.errors import GraphError
from adversarial_lcd_ros.evaluation.replay.plan import Plan
from adversarial_lcd_ros.evaluation.replay.run import evaluate_live
from adversarial_lcd_ros.graph import SCENE_CLASS
from adversarial_lcd_ros.graph_sequences.bags import CLEAN_TOPIC, write_graphs
from adversarial_lcd_ros.graph_sequences.opening import GraphSequence
from adversarial_lcd_ros.lcd.defences import make_defences
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.targets import builder_for, make_target, needed_variant
from adversarial_lcd_ros.lcd.views import Comparison, View
from adversarial_lcd_ros.sequences.bagfile import BagWriter

# Objects 0 (class 4), 1 (class 8) and 2, the scene, are joined; 3 and 4 hang on 0, 5 on 0 and 1,
# 6 on 1, 7 to 10 on the scene.
LABEL = np.array([4, 8, SCENE_CLASS, *range(3, 11)], np.uint32)
EDGES = [(0, 1), (0, 2), (1, 2), (0, 3), (0, 4), (0, 5), (1, 5), (1, 6), *((2, k) for k in
                                                                          range(7, 11))]
GRAPH = make_graph(11, EDGES, objects=3, label=LABEL)
WEIGHT, FEATURES = np.sqrt(0.6), 8
# One object with itself; 0 with 1, 0 with the scene: what they are joined with has one class of
# three in common (1 + 1 over 1 + 3).
SAME, OTHER = 3.0, 0.5 * (1 + 1 / 2 + 1 / 4)


def score(query, reference):
    view = View(query)
    return make_target('symbio').compare(view, Comparison(view, [View(reference)])).item()


def worth(*matches):
    return pytest.approx(WEIGHT * sum(matches) / FEATURES, abs=1e-6)


def test_a_match_is_worth_the_mean_over_its_objects():
    # The match of 5 hangs on 0 and 1 on both sides: two pairs of one object, two of both.
    assert score(GRAPH, GRAPH) == worth(*[SAME] * 7, (SAME + OTHER) / 2)


def test_a_feature_without_object_counts_nothing():
    assert score(GRAPH.flip([(0, 3)]), GRAPH) == worth(*[SAME] * 6, (SAME + OTHER) / 2)
    assert score(GRAPH, GRAPH.flip([(0, 3)])) == worth(*[SAME] * 6, (SAME + OTHER) / 2)


def test_a_spoke_more_draws_in_another_object():
    assert score(GRAPH.flip([(1, 3)]), GRAPH) == worth(
        *[SAME] * 6, (SAME + OTHER) / 2, (SAME + OTHER) / 2)


def test_an_edge_of_the_clique_is_felt_by_all_that_hangs_on_its_ends():
    # 0 has the scene left of {8, scene}, and 1 of {4, scene}: 2 of 3 in common with before.
    # Then 0 and 1 are joined with the same, and the share of 0 with 1 is 1 + 1 over 1 + 2.
    part = 1 + 2 / 3 + 4 / 9
    other = 0.5 * part
    assert score(GRAPH.flip([(0, 1)]), GRAPH) == worth(
        *[part] * 3, *[SAME] * 4, (2 * part + 2 * other) / 4)


def test_another_class_counts_half_and_changes_what_others_are_joined_with():
    label = LABEL.copy()
    label[0] = 5
    other = replace(GRAPH, label=label)
    # 0 keeps its neighbours, 1 and the scene lose class 4 and gain class 5: 2 of 4 in common.
    part = 1 + 1 / 2 + 1 / 4
    both = (0.5 * SAME + part + OTHER + 0.5 * (1 + 1 / 2 + 1 / 4)) / 4
    assert score(GRAPH, other) == worth(*[0.5 * SAME] * 2, *[part] * 5, both)


@pytest.mark.parametrize('pair', [(3, 4), (5, 6), (3, 10)])
def test_edges_between_features_do_not_count(pair):
    assert score(GRAPH.flip([pair]), GRAPH) == score(GRAPH, GRAPH)


@given(graphs(), graphs())
@settings(max_examples=40, deadline=None)
def test_it_does_not_matter_which_graph_asks(one, other):
    assert score(one, other) == pytest.approx(score(other, one), abs=1e-6)
    assert score(one, other) <= 3 * WEIGHT + 1e-6


@given(graphs(), graphs(), st.integers(0, 2**16))
@settings(max_examples=40, deadline=None)
def test_the_order_of_nodes_does_not_matter(graph, reference, seed):
    rng, first = np.random.default_rng(seed), graph.object_count
    order = np.r_[rng.permutation(first), first + rng.permutation(graph.node_count - first)]
    edge = np.sort(np.argsort(order)[graph.edge.astype(int)], axis=1).reshape(-1, 2)
    rank = np.lexsort((edge[:, 1], edge[:, 0]))
    mixed = replace(
        graph, **{name: getattr(graph, name)[order] for name in
                  ('tier', 'label', 'position', 'size', 'score', 'descriptor')},
        edge=edge[rank].astype(np.uint32), edge_length=graph.edge_length[rank])
    assert score(mixed, reference) == pytest.approx(score(graph, reference), abs=1e-9)
    assert score(reference, mixed) == pytest.approx(score(reference, graph), abs=1e-9)


@given(graphs(), graphs(), st.integers(0, 2**16))
@settings(max_examples=30, deadline=None)
def test_a_prepared_target_scores_flips_as_from_scratch(graph, reference, seed):
    view, target = View(graph), make_target('symbio')
    nodes = Comparison(view, [View(reference), view])
    flipped = View(graph.flip(flips_of(graph, np.random.default_rng(seed), 4)), view)
    assert target.prepare(view, nodes)(flipped).tolist() == target.compare(
        flipped, Comparison(flipped, nodes.references)).tolist()


def test_graphs_without_a_scene_are_refused():
    detector = LoopClosureDetector(LcdConfig(target='symbio'))
    with pytest.raises(GraphError, match='needs graphs with a node for the scene') as told:
        detector.judge(make_graph())
    assert told.value.cause == 'graph variant'
    detector.detect(with_scene(make_graph()))
    assert detector.keyframe_count == 1


def test_what_builds_graphs_for_a_target_takes_the_variant_it_needs():
    assert builder_for(BuilderConfig(), 'wl', 'symbio') == BuilderConfig(graph_variant='anchors')
    assert builder_for(BuilderConfig(), 'wl') == BuilderConfig()
    chosen = BuilderConfig(graph_variant='anchors')
    assert builder_for(chosen, 'wl') == chosen
    assert (needed_variant('wl'), needed_variant('wl', 'symbio')) == ('', 'anchors')


def test_a_bag_of_other_graphs_is_refused_before_a_node_starts(tmp_path):
    graphs = [replace(make_graph(), stamp_ns=(1 + k) * 10**9, sequence=k) for k in range(3)]
    with BagWriter(tmp_path / 'bag') as copy:
        write_graphs(copy, GraphSequence('bag', graphs, None, (640, 480), tmp_path), CLEAN_TOPIC)
    plan = Plan(BuilderConfig(), LcdConfig(target='symbio'), LabelConfig(), ReplayConfig(), {})
    with pytest.raises(GraphError, match='graph_variant'):
        evaluate_live(tmp_path / 'bag', tmp_path / 'out', plan)


def test_edges_can_be_made_again_from_the_nodes_of_either_variant():
    from test_builder import assembled

    for variant in ('tiers', 'anchors'):
        graph = assembled(features=[(15, 15), (45, 45), (300, 90), (320, 240)], neighbours=2,
                          objects=[(10, 10, 40, 40), (40, 40, 20, 20)], variant=variant)
        rederive = make_defences(LcdConfig(defences='rederive', rederive_neighbours=2))[0]
        assert rederive.prepare(graph.flip([(0, 1), (0, 5)])) == graph
