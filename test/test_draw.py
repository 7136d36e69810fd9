# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of graphs: size, colours of what was flipped, what is refused."""

from dataclasses import replace

from graph_factory import make_graph, with_scene
import numpy as np
import pytest

from adversarial_lcd_ros.errors import GraphError
from adversarial_lcd_ros.vision.draw import OBJECT, draw_graph
from adversarial_lcd_ros.vision.panels import draw_attack, draw_decision

FRAME = np.full((480, 640, 3), 128, np.uint8)
PLACES = np.array([(320, 100), (100, 300), (540, 300), (300, 440), (40, 40), (600, 60)],
                  np.float32)


def scene(**fields):
    return make_graph(nodes=6, edges=((0, 1), (2, 3)), objects=1, position=PLACES, **fields)


def reds(picture, place):
    """Return how many pixels near a place are red."""
    x, y = np.rint(place).astype(int)
    patch = picture[y - 5:y + 6, x - 5:x + 6].astype(int)
    return int(((patch[..., 2] > 180) & (patch[..., :2].max(axis=2) < 110)).sum())


def red_share(picture, a, b):
    """Return the share of points on a line that are red."""
    steps = np.linspace(0.1, 0.9, 200)[:, None]
    points = np.rint(PLACES[a] + steps * (PLACES[b] - PLACES[a])).astype(int)
    pixel = picture[points[:, 1], points[:, 0]].astype(int)
    return ((pixel[:, 2] > 180) & (pixel[:, :2].max(axis=1) < 110)).mean()


def test_added_edges_are_solid_red_and_deleted_ones_dashed():
    flips = [(2, 3), (1, 2)]
    picture = draw_graph(FRAME, scene().flip(flips), flips)
    assert red_share(picture, 1, 2) > 0.95
    assert 0.3 < red_share(picture, 2, 3) < 0.8
    assert red_share(picture, 0, 1) < 0.05


def test_without_flips_nothing_is_red_and_the_frame_is_left_alone():
    frame = FRAME.copy()
    frame.flags.writeable = False
    picture = draw_graph(frame, scene())
    assert picture.shape == frame.shape
    assert all(reds(picture, place) == 0 for place in PLACES)
    assert not np.array_equal(picture, frame)


@pytest.mark.parametrize('scale', [0.5, 1.0, 1.5])
def test_a_picture_has_the_size_that_is_asked_for(scale):
    grey = FRAME[..., 0].copy()
    assert draw_graph(grey, scene(), scale=scale).shape == (480 * scale, 640 * scale, 3)


def test_graphs_without_nodes_and_unknown_classes_are_drawn():
    assert draw_graph(FRAME, make_graph(0, (), 0)).shape == FRAME.shape
    assert draw_graph(FRAME, scene(label=np.full(6, 4_000_000_000, np.uint32))).any()


def test_the_scene_is_a_tag_in_the_middle_without_a_box():
    graph = with_scene(make_graph(5, (), 0, position=PLACES[1:]))
    of_object = (draw_graph(FRAME, graph, legend=False) == OBJECT).all(axis=2)
    y, x = np.nonzero(of_object)
    assert len(y) > 100
    assert np.abs(y - 240).max() < 20
    assert np.abs(x - 320).max() < 60


def test_tags_of_boxes_at_one_place_do_not_hide_each_other():
    def tag_area(objects):
        same = np.repeat(PLACES[:1], 6, axis=0)
        picture = draw_graph(FRAME, make_graph(
            6, (), objects, position=same, size=np.full((6, 2), 60, np.float32),
            label=np.full(6, 56, np.uint32)), legend=False)
        return (picture == OBJECT).all(axis=2).sum()
    assert tag_area(3) > 2.5 * tag_area(1)


def test_an_attack_shows_query_match_and_flips():
    clean, match = scene(), scene(seed=4)
    perturbed = clean.flip([(1, 2)])
    plain = draw_attack(FRAME, clean, FRAME, match, perturbed)
    told = draw_attack(FRAME, clean, FRAME, None, perturbed, 'Frame 7: suppressed ' * 20)
    assert plain.shape[1] == told.shape[1] >= 3 * 480
    assert told.shape[0] == plain.shape[0] + 30
    third = plain.shape[1] - 480
    red = (plain[..., 2] > 180) & (plain[..., :2].max(axis=2) < 110)
    assert red[:, third:].any()
    assert not red[:, :third].any()


def test_what_does_not_belong_together_is_refused():
    with pytest.raises(GraphError, match='the graph is of one of 640 x 480'):
        draw_graph(FRAME[:100], scene())
    with pytest.raises(GraphError):
        draw_graph(FRAME, scene(), [(0, 6)])


def test_moved_nodes_are_shown_with_where_they_came_from():
    clean = scene()
    position = clean.position.copy()
    position[4] = 600, 20
    picture = draw_attack(FRAME, clean, FRAME, None, replace(clean, position=position))
    third = picture.shape[1] - 480
    red = (picture[..., 2] > 180) & (picture[..., :2].max(axis=2) < 110)
    assert red[:, third + 440:].any()
    assert not red[:, :third].any()


@pytest.mark.parametrize('is_loop', [True, False])
def test_a_decision_shows_the_match_beside_and_the_verdict_below(is_loop):
    match = np.full((480, 640, 3), 200, np.uint8)
    shown = draw_decision(FRAME, None, scene(), match, 'verdict', 'why', is_loop=is_loop)
    assert shown.shape == (450, 958, 3)
    assert (shown[200, 700] == 200).all()
    alone = draw_decision(FRAME, None, scene(), None, '', '', is_loop=is_loop)
    assert (alone[200, 700] < 40).all()
    position = scene().position.copy()
    position[4] = 600, 20
    moved = draw_decision(FRAME, scene(), replace(scene(), position=position), match, '', '',
                          is_loop=is_loop)
    red = (moved[30:390, :476, 2] > 180) & (moved[30:390, :476, :2].max(axis=2) < 110)
    assert red.any()
    coloured = np.ptp(shown[390:420].astype(int), axis=2).max()
    assert (coloured > 100) == is_loop


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('size', [1e30, 3e38, 1e-45])
def test_boxes_of_any_size_are_drawn(size):
    graph = scene()
    drawn = draw_graph(FRAME, replace(graph, size=np.full_like(graph.size, size)))
    assert drawn.shape == FRAME.shape
