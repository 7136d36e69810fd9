# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The geometric check counts matches that agree on one motion, whatever the scene."""

from dataclasses import replace

import cv2
from graph_factory import make_graph
import numpy as np
import pytest

from adversarial_lcd_ros.lcd import geometry
from adversarial_lcd_ros.lcd.geometry import LEAST_MATCHES, find_inliers

PX = 3.0


def count_inliers(one, other):
    return find_inliers(one, other, PX).count


def views(first, second, objects=2):
    """Return two graphs whose features, alike by descriptor, are at the given positions."""
    count = len(first) + objects
    one = make_graph(count, [(0, 1)], objects)
    corner = np.zeros((objects, 2))
    return tuple(replace(one, position=np.concatenate([corner, at]).astype(np.float32))
                 for at in (first, second))


def somewhere(seed, count=60):
    return np.random.default_rng(seed).uniform((0, 0), (640, 480), (count, 2))


def camera_motion(seed, count=60):
    """Return where a camera sees random points before and after it moves, pixels."""
    rng = np.random.default_rng(seed)
    point = rng.uniform((-2, -1.5, 3), (2, 1.5, 8), (count, 3))
    turn = cv2.Rodrigues(np.array([0.02, 0.1, 0.01]))[0]
    moved = point @ turn.T + (0.5, 0.1, 0.2)
    return tuple(500 * seen[:, :2] / seen[:, 2:] + (320, 240) for seen in (point, moved))


@pytest.mark.parametrize('seed', range(5))
def test_matches_of_one_motion_count_and_torn_ones_do_not(seed):
    before, after = camera_motion(seed)
    assert count_inliers(*views(before, after)) == 60
    # Eight places fit some motion by themselves, others come near an epipolar line by chance.
    assert count_inliers(*views(before, somewhere(seed + 100))) < 30
    after[:20] = somewhere(seed + 200, 20)
    assert 40 <= count_inliers(*views(before, after)) < 55


def test_the_same_graphs_give_the_same_number():
    before, after = camera_motion(0)
    after[:30] = somewhere(1, 30)
    assert len({count_inliers(*views(before, after)) for _ in range(5)}) == 1


def test_edges_are_not_looked_at():
    one, other = views(*camera_motion(0))
    flipped = make_graph(62, [(k, k + 1) for k in range(61)], 2)
    bare = replace(one, edge=flipped.edge, edge_length=flipped.edge_length)
    assert count_inliers(bare, other) == count_inliers(one, other)


def test_too_few_matches_are_none():
    before, after = camera_motion(0, LEAST_MATCHES - 1)
    assert count_inliers(*views(before, after)) == 0
    one, other = views(*camera_motion(0))
    assert count_inliers(one, replace(other, descriptor=~other.descriptor)) == 0
    objects = make_graph(5, [(0, 1)], objects=5)
    assert count_inliers(objects, objects) == 0


def test_unrelated_features_on_one_line_determine_no_motion():
    one, other = (np.repeat(somewhere(seed)[:, :1], 2, axis=1) for seed in (0, 1))
    assert count_inliers(*views(one, other)) == 0


@pytest.mark.parametrize('seed', range(5))
def test_a_plane_that_moves_sideways_is_one_motion(seed):
    seen = somewhere(seed, 20)
    assert count_inliers(*views(seen, seen + (4, 2))) == 20


def test_a_planar_scene_that_usac_gives_up_on_is_counted():
    # Of flat_train at 100 features: USAC of OpenCV 5.0 raises "!model.empty()".
    seen = np.array([
        [399.6, 358.8, 513.6, 384.0], [252.0, 159.0, 372.0, 159.0], [231.6, 225.6, 342.0, 222.0],
        [464.0, 336.0, 593.0, 370.0], [136.16, 197.07, 256.79, 194.09], [57.0, 87.0, 194.0, 84.0],
        [382.0, 263.0, 500.0, 276.0], [316.8, 265.2, 70.5, 124.42], [444.0, 207.0, 581.0, 220.0]])
    # The last but one is a wrong match.
    assert count_inliers(*views(seen[:, :2], seen[:, 2:])) >= 7


@pytest.mark.parametrize('gives_up', ['raises', 'finds nothing'])  # OpenCV 5.0, and 4.6
def test_ransac_takes_over_where_usac_gives_up(monkeypatch, gives_up):
    plain = geometry._fundamental

    def without_usac(points, method, threshold_px):
        if method != cv2.USAC_DEFAULT:
            return plain(points, method, threshold_px)
        if gives_up == 'raises':
            raise cv2.error('model.empty()')
        return None, None

    monkeypatch.setattr(geometry, '_fundamental', without_usac)
    assert count_inliers(*views(*camera_motion(0))) == 60
