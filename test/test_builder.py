# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The graph builder: edges by the rules of the paper, what a frame may be, that it repeats."""

from itertools import combinations

import cv2
from hypothesis import example, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.config import BuilderConfig
from adversarial_lcd_ros.errors import GraphError, ModelError
from adversarial_lcd_ros.graph import SCENE_CLASS
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.vision.assembly import assemble, in_variant
from adversarial_lcd_ros.vision.builder import GraphBuilder
from adversarial_lcd_ros.vision.features import Features
from adversarial_lcd_ros.vision.objects import Detections

NO_WORDS = (np.zeros(0, np.uint32), np.zeros(0, np.float32))


def features_at(position, seed=0):
    position = np.array(position, np.float32).reshape(-1, 2)
    rng = np.random.default_rng(seed)
    return Features(position, rng.random(len(position)).astype(np.float32) + 31,
                    rng.random(len(position)).astype(np.float32),
                    rng.integers(0, 256, (len(position), 32)).astype(np.uint8))


def objects_at(box):
    box = np.array(box, np.float32).reshape(-1, 4)
    return Detections(np.arange(50, 50 + len(box), dtype=np.uint32), box,
                      np.linspace(0.9, 0.5, len(box), dtype=np.float32))


def assembled(features=(), objects=(), neighbours=0, bow=NO_WORDS, variant='tiers'):
    features = features_at(features)
    return assemble(features, np.arange(len(features), dtype=np.uint32) + 7, objects_at(objects),
                    bow, BuilderConfig(feature_neighbours=neighbours,
                                       graph_variant=variant),
                    width=640, height=480, stamp_ns=5, frame_id='left', sequence=2)


def edges(graph):
    return set(map(tuple, graph.edge.tolist()))


def test_every_two_objects_are_joined():
    graph = assembled(objects=[(0, 0, 9, 9), (50, 0, 9, 9), (90, 0, 9, 9), (0, 70, 9, 9)])
    assert edges(graph) == set(combinations(range(4), 2))


def test_a_feature_belongs_to_every_box_that_holds_it_or_to_the_nearest():
    graph = assembled(features=[(15, 15), (45, 45), (100, 30), (330, 50), (10, 10)],
                      objects=[(10, 10, 40, 40), (40, 40, 20, 20), (300, 0, 20, 20)])
    spokes = {(a, b) for a, b in edges(graph) if a < 3 <= b}
    # The last one, on the corner of the first box, is in it.
    assert spokes == {(0, 3), (0, 4), (1, 4), (1, 5), (2, 6), (0, 7)}


def test_the_scene_takes_what_no_box_holds_and_features_are_not_joined():
    graph = assembled(features=[(15, 15), (45, 45), (100, 30), (330, 50)], neighbours=3,
                      objects=[(10, 10, 40, 40), (40, 40, 20, 20)], variant='anchors')
    assert edges(graph) == {(0, 1), (0, 2), (1, 2), (0, 3), (0, 4), (1, 4), (2, 5), (2, 6)}
    assert (graph.has_scene, graph.found_objects, graph.object_count) == (True, 2, 3)
    assert graph.label[:3].tolist() == [50, 51, SCENE_CLASS]
    assert (graph.position[2].tolist(), graph.size[2].tolist()) == ([320, 240], [640, 480])
    assert codec.decode_graph(codec.encode_graph(graph)) == graph


BOX = st.tuples(st.floats(0, 600), st.floats(0, 400), st.floats(1, 300), st.floats(1, 300))
POINT = st.tuples(st.integers(0, 639), st.integers(0, 479))


@given(st.lists(POINT, max_size=30), st.lists(BOX, max_size=4), st.integers(0, 6))
def test_a_graph_turns_into_what_the_builder_makes_of_the_frame_in_the_other_variant(
        features, objects, neighbours):
    plain, anchored = (assembled(features, objects, neighbours, variant=variant)
                       for variant in ('tiers', 'anchors'))
    for graph in (plain, anchored):
        for wanted in (plain, anchored):
            assert in_variant(graph, BuilderConfig(
                graph_variant='anchors' if wanted is anchored else 'tiers',
                feature_neighbours=neighbours)) == wanted


def test_without_objects_everything_hangs_on_the_scene():
    graph = assembled(features=[(15, 15), (45, 45)], neighbours=3, variant='anchors')
    assert edges(graph) == {(0, 1), (0, 2)}
    assert (graph.has_scene, graph.found_objects) == (True, 0)
    assert not assembled(features=[(15, 15)]).has_scene


def test_a_feature_is_joined_with_its_nearest_and_with_those_it_is_nearest_to():
    graph = assembled(features=[(0, 0), (10, 0), (21, 0), (100, 0)], neighbours=1)
    assert edges(graph) == {(0, 1), (1, 2), (2, 3)}


def test_features_at_one_place_are_each_others_neighbours():
    graph = assembled(features=[(5, 5)] * 4, neighbours=3)
    assert edges(graph) == set(combinations(range(4), 2))


def test_nodes_carry_what_was_detected():
    bow = (np.array([3, 9], np.uint32), np.array([0.25, 0.75], np.float32))
    graph = assembled(features=[(15, 15), (45, 45)], objects=[(10, 20, 40, 60)], bow=bow)
    features = features_at([(15, 15), (45, 45)])
    assert (graph.object_count, graph.label.tolist()) == (1, [50, 7, 8])
    assert graph.position.tolist() == [[30, 50], [15, 15], [45, 45]]
    assert graph.size.tolist() == [[40, 60], *([size, size] for size in features.size.tolist())]
    np.testing.assert_array_equal(graph.score[1:], features.score)
    np.testing.assert_array_equal(graph.descriptor, [np.zeros(32), *features.descriptor])
    assert (graph.word.tolist(), graph.word_weight.tolist()) == ([3, 9], [0.25, 0.75])
    assert (graph.stamp_ns, graph.frame_id, graph.sequence, graph.width, graph.height) == (
        5, 'left', 2, 640, 480)


def test_nothing_seen_is_an_empty_graph():
    graph = assembled()
    assert (graph.node_count, graph.edge_count) == (0, 0)


def test_one_feature_alone_has_no_edges():
    assert assembled(features=[(5, 5)], neighbours=6).edge_count == 0


places = st.tuples(st.integers(0, 639), st.integers(0, 479))
boxes = st.tuples(st.integers(0, 600), st.integers(0, 440), st.integers(1, 40),
                  st.integers(1, 40))


@settings(max_examples=60)
@example([(0, 0)] * 4, [], 1)
@given(st.lists(places, max_size=25), st.lists(boxes, max_size=5), st.integers(0, 5))
def test_the_rules_hold_for_any_scene(features, objects, neighbours):
    graph = assembled(features, objects, neighbours)
    first, joined = len(objects), edges(graph)
    assert graph.node_count == first + len(features)
    np.testing.assert_array_equal(graph.edge_length, graph.length_between(graph.edge))
    assert {pair for pair in joined if pair[1] < first} == set(combinations(range(first), 2))
    owners = [sum((owner, first + k) in joined for owner in range(first))
              for k in range(len(features))]
    assert all(count >= min(first, 1) for count in owners)
    nearest = min(neighbours, len(features) - 1)
    among = np.zeros((len(features),) * 2, int)
    for a, b in joined:
        if a >= first:
            among[a - first, b - first] = among[b - first, a - first] = 1
    assert (among.sum(axis=0) >= nearest).all()
    assert among.sum() <= 2 * neighbours * len(features)
    assert codec.decode_graph(codec.encode_graph(graph)) == graph


def texture(seed=0, height=240, width=320):
    coarse = np.random.default_rng(seed).integers(0, 256, (height // 8, width // 8, 3))
    return cv2.resize(coarse.astype(np.uint8), (width, height), interpolation=cv2.INTER_CUBIC)


@pytest.fixture(scope='module')
def builder():
    with GraphBuilder(BuilderConfig(detector='none', features=50)) as builder:
        yield builder


def test_same_image_same_bytes_and_the_image_is_left_alone(builder):
    image = texture()
    image.flags.writeable = False
    graph = builder.build(image, 7, 'left', 3)
    assert (graph.stamp_ns, graph.frame_id, graph.sequence) == (7, 'left', 3)
    assert (graph.width, graph.height, graph.node_count) == (320, 240, 50)
    with GraphBuilder(BuilderConfig(detector='none', features=50)) as other:
        assert codec.encode_graph(other.build(image, 7, 'left', 3)) == codec.encode_graph(graph)


def test_all_features_count_for_the_words_not_the_nodes_only(builder):
    graph = builder.build(texture(), 0)
    assert len(graph.word) > 50
    assert graph.word_weight.sum() == pytest.approx(1, abs=1e-5)


def test_a_view_of_an_image_is_as_good_as_a_copy(builder):
    image = texture()[20:220, 300:10:-1]
    assert builder.build(image, 0) == builder.build(image.copy(), 0)


def test_grey_frames_are_taken(builder):
    grey = cv2.cvtColor(texture(), cv2.COLOR_BGR2GRAY)
    assert builder.build(grey, 0) == builder.build(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), 0)


@pytest.mark.parametrize('image', [np.zeros((240, 320, 3), np.uint8), np.zeros((1, 1), np.uint8)])
def test_a_frame_without_anything_to_see_gives_an_empty_graph(builder, image):
    graph = builder.build(image, 0)
    assert (graph.node_count, graph.edge_count, len(graph.word)) == (0, 0, 0)


@pytest.mark.parametrize('image', [np.zeros((0, 4, 3), np.uint8), np.zeros((9, 9), np.float32)])
def test_what_is_no_image_is_refused_and_the_next_frame_is_built(builder, image):
    with pytest.raises(GraphError, match='expected uint8'):
        builder.build(image, 0)
    assert builder.build(texture(), 0).node_count == 50


def test_frames_begun_side_by_side_give_the_graphs_they_give_alone(builder):
    images = [texture(seed) for seed in range(4)]
    with GraphBuilder(builder.config, frames_at_once=3) as other:
        begun = [other.begin(image, stamp) for stamp, image in enumerate(images)]
        assert [building.graph() for building in begun] == [
            builder.build(image, stamp) for stamp, image in enumerate(images)]


def test_a_builder_without_its_model_does_not_start(tmp_path):
    with pytest.raises(ModelError, match='the one that ships'):
        GraphBuilder(BuilderConfig(model=str(tmp_path / 'none.onnx')))
    with pytest.raises(ModelError, match='no vocabulary'):
        GraphBuilder(BuilderConfig(vocabulary=str(tmp_path / 'none.npz'), detector='none'))


def test_a_real_frame_gives_objects_features_and_the_same_graph_again(shared_data):
    image = cv2.imread(str(sorted(shared_data('7scenes_redkitchen').glob('**/*.jpg'))[808]))
    with GraphBuilder() as builder:
        graph = builder.build(image, 1)
        assert builder.build(image, 1) == graph
        grey = builder.build(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), 1)
    assert 3 <= graph.object_count <= 10
    assert graph.node_count == graph.object_count + 300
    assert 1000 < graph.edge_count < 3000
    assert grey.object_count > 0
