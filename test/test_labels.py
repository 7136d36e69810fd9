# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

from dataclasses import dataclass, replace

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.config import LabelConfig
from adversarial_lcd_ros.errors import ConfigError, EvaluationError
from adversarial_lcd_ros.ground_truth.labels import (
    BY_INDEX,
    BY_POSES,
    NO_MATCH,
    label_frames,
)
from adversarial_lcd_ros.ground_truth.overlap import GRID_POINTS, visible_points
from adversarial_lcd_ros.ground_truth.pairs import sample_pairs

SIZE = (640, 480)
FORWARD = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Poses:
    """What labels read of a trajectory."""

    stamp_ns: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    frame_id: str = 'world'


def turning(degrees, axis='y'):
    return Rotation.from_euler(axis, degrees, degrees=True).as_quat()


def path(yaw_deg, x_m=None, period_s=1.0):
    count = len(yaw_deg)
    position = np.zeros((count, 3))
    position[:, 0] = 0.0 if x_m is None else x_m
    stamps = (np.arange(count) * period_s * 1e9).astype(np.int64)
    return Poses(stamps, position, turning(np.asarray(yaw_deg, float)[:, None]))


def relation_of(poses, size, config):
    return label_frames(poses, poses.stamp_ns, size, config).relation


def overlap(position, quaternion):
    return visible_points(np.asarray(position, float), np.asarray(quaternion, float), SIZE,
                          0.82) / GRID_POINTS


def naive_overlap(position, quaternion, focal=0.82):
    # One point after the other, in pixels, as the definition reads.
    turn, (width, height) = Rotation.from_quat(quaternion).as_matrix(), SIZE
    shares = []
    for depth in (1.0, 2.0, 4.0):
        seen = 0
        for column in range(9):
            for row in range(7):
                pixel = np.array([(column + 0.5) / 9 * width, (row + 0.5) / 7 * height])
                ray = np.append((pixel - [width / 2, height / 2]) / (focal * width), 1.0)
                x, y, z = turn[1].T @ (turn[0] @ (depth * ray) + position[0] - position[1])
                if z > 0:
                    u, v = focal * width * x / z + width / 2, focal * width * y / z + height / 2
                    seen += 0 <= u <= width and 0 <= v <= height
        shares.append(seen / 63)
    return max(shares)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_overlap_is_the_definition_point_by_point(seed):
    rng = np.random.default_rng(seed)
    position = rng.uniform(-1, 1, (2, 3)) + rng.uniform(-100, 100, 3)
    quaternion = Rotation.from_euler('xyz', rng.uniform(-40, 40, (2, 3)), degrees=True).as_quat()
    # A point within float32 of the border may fall to either side.
    assert overlap(position, quaternion)[0, 1] == pytest.approx(
        naive_overlap(position, quaternion), abs=1.01 / 63)


def test_overlap_of_known_views():
    views = np.array([turning(0), turning(0), turning(180), turning(90, 'z')])
    share = overlap(np.zeros((4, 3)), views)
    assert share[0, 1] == share[0, 0] == 1
    assert share[0, 2] == 0  # back to back
    assert 0.5 < share[0, 3] < 1  # rolled: the same scene within another frame


def test_overlap_takes_the_depth_that_shares_most_and_tells_the_sides_apart():
    # Three metres ahead: all that the front camera sees is in the rear camera's view, not back.
    share = overlap([[0, 0, 0], [0, 0, 3.0]], [FORWARD, FORWARD])
    assert share[1, 0] == 1
    assert 0 < share[0, 1] < 0.1


def test_overlap_does_not_depend_on_the_size_of_its_blocks(monkeypatch):
    rng = np.random.default_rng(1)
    position, quaternion = rng.normal(size=(50, 3)), Rotation.random(50, random_state=1).as_quat()
    whole = overlap(position, quaternion)
    monkeypatch.setattr('adversarial_lcd_ros.ground_truth.overlap._BLOCK_VALUES', 1)
    assert np.array_equal(overlap(position, quaternion), whole)


def test_quaternion_that_is_no_rotation_is_named():
    with pytest.raises(EvaluationError, match='pose 1'):
        overlap(np.zeros((2, 3)), [FORWARD, (0, 0, 0, 0)])


def test_loop_needs_the_camera_to_have_looked_elsewhere():
    still = relation_of(path([0.0] * 30), SIZE, LabelConfig(rule='overlap', min_gap_s=5.0))
    assert not still.any()
    # Away for frames 10 to 19, then back.
    back = relation_of(path([0.0] * 10 + [180.0] * 10 + [0.0] * 10), SIZE,
                       LabelConfig(rule='overlap', min_gap_s=5.0))
    assert back[25, 3] == back[3, 25] == 1
    assert back[9, 0] == 0
    assert back[29, 20] == 0
    assert back[15, 3] == -1
    assert back[12, 9] == 0  # different views, but too close in time to be candidates


@given(st.lists(st.floats(-180, 180), min_size=1, max_size=40), st.floats(0, 10),
       st.sampled_from(['overlap', 'distance']))
@settings(max_examples=40, deadline=None)
def test_relation_is_symmetric_and_silent_within_the_gap(yaw, gap_s, rule):
    poses = path(yaw)
    pairs = relation_of(poses, SIZE, LabelConfig(min_gap_s=gap_s, rule=rule))
    assert np.array_equal(pairs, pairs.T)
    apart = np.abs(np.subtract.outer(poses.stamp_ns, poses.stamp_ns)) * 1e-9
    assert not pairs[apart < gap_s - 1e-6].any()
    assert not np.diagonal(pairs).any()


def test_distance_rule_knows_distance_and_angle_only():
    config = LabelConfig(rule='distance', min_gap_s=1.0)
    pairs = relation_of(path([0, 0, 0, 90, 0], x_m=[0, 1, 9, 0, 0.2]), SIZE, config)
    assert pairs[4, 0] == 1
    assert pairs[2, 0] == -1
    assert pairs[3, 0] == -1
    assert pairs[1, 0] == 0


def test_ground_truth_by_index():
    index = np.r_[np.arange(30), np.arange(30)].astype(float)  # two walks
    poses = replace(path(np.zeros(60), x_m=index), frame_id='place_index')
    labels = label_frames(poses, poses.stamp_ns, SIZE, LabelConfig(negative_index=5))
    assert labels.told_by == BY_INDEX
    assert labels.relation[40, 10] == 1
    assert labels.relation[40, 25] == -1
    assert (labels.kind[30:] == 1).all()
    assert (labels.kind[8:30] == -1).all()


def test_kinds_of_frames():
    yaw = [0.0] * 10 + [180.0] * 10 + [0.0] * 10 + [90.0] * 5
    poses = path(yaw)
    labels = label_frames(poses, poses.stamp_ns, SIZE, LabelConfig(rule='overlap', min_gap_s=5.0))
    assert labels.names[:5] == ['no_candidate'] * 5
    assert labels.names[5:10] == ['between'] * 5  # the camera never left
    assert labels.names[10:15] == ['negative'] * 5
    assert labels.names[20:30] == ['positive'] * 10
    assert labels.names[30:] == ['negative'] * 5
    assert labels.count('positive') == 10


def test_right_and_wrong_matches():
    # Frame 3 has turned by 28 degrees: enough in common to be named, too little for a loop.
    poses = path([0, 0, 0, 28, *[180] * 5, 0], period_s=2.0)
    labels = label_frames(poses, poses.stamp_ns, SIZE, LabelConfig(rule='overlap', min_gap_s=4.0))
    assert labels.kind[9] == 1
    assert labels.relation[9, 3] == 0
    assert labels.is_correct([9] * 5, [0, 3, 5, 8, NO_MATCH]).tolist() == [
        True, True, False, False, False]


def test_holes_in_the_ground_truth_cost_their_frames_only():
    poses = path([0.0] * 10 + [180.0] * 10 + [0.0] * 10)
    known = np.r_[0:15, 17:30]
    partial = Poses(poses.stamp_ns[known], poses.position[known], poses.quaternion[known])
    labels = label_frames(partial, poses.stamp_ns, SIZE,
                          LabelConfig(rule='overlap', min_gap_s=5.0))
    assert [labels.names[i] for i in (15, 16)] == ['no_ground_truth'] * 2
    assert not labels.relation[15].any()
    assert labels.names[25] == 'positive'
    with pytest.raises(EvaluationError, match='none of 30 frames'):
        label_frames(replace(poses, stamp_ns=poses.stamp_ns + 10**15), poses.stamp_ns, SIZE,
                     LabelConfig(rule='overlap'))


def test_stamps_must_ascend():
    poses = path([0.0, 1.0])
    with pytest.raises(EvaluationError, match='frame 1 is not later'):
        label_frames(poses, [5, 5], SIZE, LabelConfig(rule='overlap'))


def test_contradicting_thresholds_are_refused():
    with pytest.raises(ConfigError, match='possible_overlap'):
        LabelConfig(possible_overlap=0.7)


def test_pairs_are_balanced_distinct_and_spread_over_time():
    rng = np.random.default_rng(0)
    poses = path(np.r_[np.zeros(100), np.full(50, 180.0), np.zeros(100)], period_s=0.5)
    pairs = relation_of(poses, SIZE, LabelConfig(rule='overlap'))
    sample = sample_pairs(pairs, rng, 80)
    assert sample.is_loop.sum() == 80
    assert len(sample.query) == 160
    assert (sample.reference < sample.query).all()
    assert (pairs[sample.query, sample.reference] == np.where(sample.is_loop, 1, -1)).all()
    assert len(set(zip(sample.query, sample.reference, strict=True))) == 160
    loops = sample.query[sample.is_loop]
    assert np.bincount(loops).max() == 1  # 100 queries have loops: none is taken twice
    assert {query // 25 for query in loops.tolist()} == {6, 7, 8, 9}
    again = sample_pairs(pairs, np.random.default_rng(0), 80)
    assert np.array_equal(again.query, sample.query)
    with pytest.raises(EvaluationError, match='5001 pairs'):
        sample_pairs(np.zeros((9, 9), np.int8), rng, 5001)


@pytest.mark.parametrize(('name', 'positives', 'negatives'), [
    ('flat_tour', 240, 61), ('7scenes_redkitchen', 278, 37),
    ('rgbd_dataset_freiburg1_rpy', 196, 39)])
def test_real_sequences(shared_data, name, positives, negatives):
    folder = shared_data(name)
    truth = np.loadtxt(folder / 'groundtruth.txt')
    seconds = np.loadtxt(folder / 'rgb.txt', usecols=0)
    poses = Poses(np.round(truth[:, 0] * 1e9).astype(np.int64), truth[:, 1:4], truth[:, 4:8])
    labels = label_frames(poses, np.round(seconds * 1e9).astype(np.int64), SIZE,
                          LabelConfig(rule='overlap'))
    assert labels.told_by == BY_POSES
    assert (labels.count('positive'), labels.count('negative')) == (positives, negatives)
