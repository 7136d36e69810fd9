# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Labels by what can be shown: rooms made by hand, seen by cameras whose poses are known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.ground_truth.audit import evidence, look
from adversarial_lcd_ros.ground_truth.focal import measure_focal
from adversarial_lcd_ros.ground_truth.labels import count_old_enough
from adversarial_lcd_ros.ground_truth.motion_depth import Camera, inverse_depths
from adversarial_lcd_ros.ground_truth.view_features import ViewFeatures

WIDTH, HEIGHT, FOCAL = 640.0, 480.0, 500.0
GAP_S = 4.0


def surface(depth, count=600, x=0.0, seed=0, half=(3.0, 2.0)):
    """Return points of a wall across z, and what each looks like."""
    rng = np.random.default_rng(seed)
    point = np.column_stack([rng.uniform(x - half[0], x + half[0], count),
                             rng.uniform(-half[1], half[1], count), np.full(count, depth)])
    return point, rng.integers(0, 256, (count, 32), np.uint8)


def walk(*legs):
    """Return a camera for legs (seconds, from, to, yaw in degrees), ten frames a second."""
    place, yaw = [], []
    for seconds, start, stop, degrees in legs:
        count = round(10 * seconds)
        place.append(np.linspace(start, stop, count))
        yaw.append(np.linspace(*np.broadcast_to(degrees, 2), count))
    centre = np.concatenate(place)
    turn = Rotation.from_euler('y', np.concatenate(yaw)[:, None], degrees=True).as_matrix()
    return Camera(np.arange(len(centre)) / 10, turn, centre, np.ones(len(centre), bool), WIDTH,
                  HEIGHT, FOCAL)


def seen(camera, *surfaces, visible=lambda frame, surface: True):
    """Return the features of every frame; a surface may be hidden from some."""
    frames = []
    for frame in range(len(camera.centre)):
        place, word = [np.zeros((0, 2))], [np.zeros((0, 32), np.uint8)]
        for number, (point, looks) in enumerate(surfaces):
            inside = (point - camera.centre[frame]) @ camera.turn[frame]
            pixel = (inside[:, :2] / np.maximum(inside[:, 2:], 1e-6) * camera.focal
                     + [WIDTH / 2, HEIGHT / 2])
            kept = ((inside[:, 2] > 0.1) & (pixel >= 0).all(axis=1)
                    & (pixel < [WIDTH, HEIGHT]).all(axis=1) & visible(frame, number))
            place.append(pixel[kept])
            word.append(looks[kept])
        frames.append((np.concatenate(place), np.concatenate(word)))
    most = max(len(place) for place, _ in frames)
    features = ViewFeatures(np.zeros((len(frames), most, 2), np.float32),
                            np.zeros((len(frames), most, 32), np.uint8),
                            np.array([len(place) for place, _ in frames]))
    for frame, (place, word) in enumerate(frames):
        features.position[frame, :len(place)] = place
        features.descriptor[frame, :len(word)] = word
    return features


def judge(camera, features):
    candidates = count_old_enough(np.round(camera.time_s * 1e9).astype(np.int64), GAP_S)
    every = np.ones((len(candidates),) * 2, bool)
    return evidence(look(features, camera, candidates), camera.time_s, candidates, every, ~every)


def test_depth_comes_from_the_cameras_own_motion():
    camera = walk((2, [0, 0, 0], [0.8, 0, 0], 0))
    near, far, known = inverse_depths(seen(camera, surface(2.0)), camera, 3.0)
    assert known[10].mean() > 0.9
    assert (near[known] >= 0.5 - 1e-3).all()
    assert (far[known] <= 0.5 + 1e-3).all()


def test_depth_is_open_after_a_turn_in_place():
    camera = walk((2, [0, 0, 0], [0, 0, 0], (0, 20)))
    near, far, known = inverse_depths(seen(camera, surface(2.0)), camera, 3.0)
    assert not known.any()
    assert (far == 0).all()
    assert (near > 3).all()


def test_a_place_seen_again_is_shared():
    camera = walk((2, [0, 0, 0], [0.6, 0, 0], 0), (4, [0, 0, 0], [0, 0, 0], 180),
                  (2, [0, 0, 0], [0.6, 0.1, 0], 0))
    found = judge(camera, seen(camera, surface(2.0), surface(-2.0, seed=1)))
    assert found.shared[70, 10]
    assert found.loop[70, 10]
    assert not found.scaled[70, 10]
    assert not found.elsewhere[70, 10]
    assert found.elsewhere[55, 10]
    assert not found.shared[55, 10]


def test_what_was_seen_through_a_turn_in_place_only_is_shared():
    camera = walk((2, [0, 0, 0], [0, 0, 0], (-5, 5)), (4, [0, 0, 0], [0, 0, 0], (120, 170)),
                  (2, [0, 0, 0], [0, 0, 0], (5, -5)))
    found = judge(camera, seen(camera, surface(3.0), surface(-3.0, seed=1, half=(9, 3))))
    assert found.shared[70, 10]
    assert found.elsewhere[50, 10]


def test_the_next_room_is_another_place_though_the_poses_look_the_same_way():
    # The wall of the first room is at 2 m; the second room begins there and ends at 6 m.
    camera = walk((2, [0, 0, 0], [0.6, 0, 0], 0), (4, [0, 0, 0], [0, 0, 0], 180),
                  (2, [0, 0, 2.5], [0.6, 0, 2.5], 0))
    features = seen(camera, surface(2.0), surface(-2.0, seed=1), surface(6.0, seed=2),
                    visible=lambda frame, number: (number == 2) == (frame >= 60))
    found = judge(camera, features)
    assert found.elsewhere[70, 10]
    assert not found.shared[70].any()


def test_rooms_that_look_alike_are_not_shared():
    # The second room is the first one, five metres aside.
    point, looks = surface(2.0)
    camera = walk((2, [0, 0, 0], [0.6, 0, 0], 0), (4, [0, 0, 0], [0, 0, 0], 180),
                  (2, [5, 0, 0], [5.6, 0, 0], 0))
    features = seen(camera, (point, looks), (point + [5.0, 0, 0], looks),
                    visible=lambda frame, number: (number == 1) == (frame >= 60))
    found = judge(camera, features)
    assert not found.shared[70, 10]
    assert found.elsewhere[70, 10]


def test_the_same_from_much_nearer_is_a_change_of_scale_and_no_other_place():
    camera = walk((2, [0, 0, 0], [0.6, 0, 0], 0), (4, [0, 0, 0], [0, 0, 0], 180),
                  (2, [0, 0, 3.0], [0.6, 0, 3.0], 0))
    found = judge(camera, seen(camera, surface(4.0, count=2000), surface(-2.0, seed=1)))
    assert found.scaled[70, 10]
    assert not found.elsewhere[70, 10]
    assert not found.loop[70, 10]


def test_evidence_has_two_equal_sides_and_repeats():
    camera = walk((2, [0, 0, 0], [0.6, 0, 0], 0), (3, [0, 0, 0], [0, 0, 0], 180),
                  (2, [0, 0, 0], [0.6, 0.1, 0], 0))
    features = seen(camera, surface(2.0), surface(-2.0, seed=1))
    once, again = judge(camera, features), judge(camera, features)
    for name, part in vars(once).items():
        assert np.array_equal(part, part.T)
        assert np.array_equal(part, getattr(again, name))
    assert not (once.shared & once.elsewhere).any()


def test_frames_without_a_pose_are_not_compared():
    camera = walk((2, [0, 0, 0], [0.6, 0, 0], 0), (4, [0, 0, 0], [0, 0, 0], 180),
                  (2, [0, 0, 0], [0.6, 0.1, 0], 0))
    located = camera.located.copy()
    located[70] = False
    camera = replace(camera, located=located)
    assert not judge(camera, seen(camera, surface(2.0), surface(-2.0, seed=1))).shared[70].any()


@pytest.mark.parametrize('focal', [320.0, 500.0, 900.0])
def test_the_focal_length_is_measured(focal):
    camera = replace(walk((6, [0, 0, 0], [0.5, 0, 0], (-20, 20))), focal=focal)
    features = seen(camera, surface(3.0, count=1500, half=(6, 3)))
    measured = measure_focal(features, replace(camera, focal=1.0))
    assert measured == pytest.approx(focal / WIDTH, rel=0.02)


def test_a_camera_that_does_not_turn_tells_no_focal_length():
    camera = walk((4, [0, 0, 0], [0.5, 0, 0], 0))
    assert measure_focal(seen(camera, surface(3.0)), camera) is None
