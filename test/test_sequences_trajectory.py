# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ground truth between its stamps."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.sequences import PLACE_INDEX, Trajectory

MS = 1_000_000
START_NS = 1_305_031_229_528_748_123


def trajectory(offsets_ms, seed=0, frame_id='world'):
    rng = np.random.default_rng(seed)
    stamps = START_NS + np.array(offsets_ms, np.int64) * MS
    return Trajectory(stamps, rng.normal(size=(len(stamps), 3)),
                      Rotation.random(len(stamps), random_state=seed).as_quat(), frame_id)


def angle(first, second):
    return (Rotation.from_quat(first).inv() * Rotation.from_quat(second)).magnitude()


offsets = st.lists(st.integers(0, 2000), min_size=1, max_size=20, unique=True).map(sorted)


@settings(max_examples=60, deadline=None)
@given(offsets, st.integers(0, 99))
def test_a_pose_at_its_own_stamp_is_itself(offsets_ms, seed):
    known = trajectory(offsets_ms, seed)
    there = known.at(known.stamp_ns)
    np.testing.assert_array_equal(there.position, known.position)
    np.testing.assert_array_equal(there.quaternion, known.quaternion)


@settings(max_examples=100, deadline=None)
@given(offsets, offsets, st.integers(0, 99))
def test_every_pose_lies_between_its_neighbours_or_none_is_near(offsets_ms, wanted_ms, seed):
    known = trajectory(offsets_ms, seed)
    wanted = START_NS + np.array(wanted_ms, np.int64) * MS + 1
    gap = np.abs(known.stamp_ns[:, None] - wanted)
    np.testing.assert_array_equal(known.is_near(wanted), gap.min(axis=0) <= 50 * MS)
    if not known.is_near(wanted).all():
        with pytest.raises(SequenceError, match=r'no ground truth within 0.05 s'):
            known.at(wanted)
        return
    there = known.at(wanted)
    np.testing.assert_array_equal(there.stamp_ns, wanted)
    np.testing.assert_allclose(np.linalg.norm(there.quaternion, axis=1), 1, atol=1e-9)
    for row, stamp in enumerate(wanted):
        after = int(np.searchsorted(known.stamp_ns, stamp))
        both = [k for k in (after - 1, after) if 0 <= k < len(known)]
        low, high = known.position[both].min(axis=0), known.position[both].max(axis=0)
        assert (there.position[row] >= low - 1e-9).all()
        assert (there.position[row] <= high + 1e-9).all()
        if len(both) == 2:
            whole = angle(*known.quaternion[both])
            parts = [angle(known.quaternion[k], there.quaternion[row]) for k in both]
            assert sum(parts) == pytest.approx(whole, abs=1e-5)


def test_halfway_is_half_the_way_and_half_the_turn():
    turn = Rotation.from_euler('z', [[0], [80]], degrees=True).as_quat()
    # -q is the same rotation: the turn must not go the long way round.
    known = Trajectory([START_NS, START_NS + 60 * MS], [[0, 0, 0], [2, 4, 6]],
                       [turn[0], -turn[1]])
    there = known.at([START_NS + 30 * MS])
    np.testing.assert_allclose(there.position, [[1, 2, 3]])
    assert np.degrees(angle(turn[0], there.quaternion[0])) == pytest.approx(40)


def test_across_a_hole_the_nearest_pose_counts():
    known = trajectory([0, 1000])
    np.testing.assert_array_equal(known.at([START_NS + 970 * MS]).position, known.position[1:])
    with pytest.raises(SequenceError, match=r'nearest pose is 0\.400 s away'):
        known.at([START_NS + 400 * MS])


def test_a_place_index_is_never_between_two_places():
    known = trajectory([0, 40], frame_id=PLACE_INDEX)
    there = known.at([START_NS + 30 * MS])
    assert there.frame_id == PLACE_INDEX
    np.testing.assert_array_equal(there.position, known.position[1:])


def test_a_trajectory_cannot_be_changed_by_its_arrays():
    stamps = np.array([1, 2])
    known = Trajectory(stamps, np.zeros((2, 3)), [[0, 0, 0, 1]] * 2)
    stamps[0] = 7
    assert known.stamp_ns.tolist() == [1, 2]
    with pytest.raises(ValueError, match=r'read-only'):
        known.position[0, 0] = 1.0


@pytest.mark.parametrize(('stamps', 'position', 'quaternion', 'message'), [
    ([], np.zeros((0, 3)), np.zeros((0, 4)), 'without a pose'),
    ([1], np.zeros((1, 2)), [[0, 0, 0, 1]], 'shapes'),
    ([1], [[0, np.nan, 0]], [[0, 0, 0, 1]], 'pose 0 .* NaN'),
    ([1], np.zeros((1, 3)), [[0, 0, 0, 0]], 'norm 0'),
    ([2, 2], np.zeros((2, 3)), [[0, 0, 0, 1]] * 2, 'does not follow'),
])
def test_what_is_no_trajectory_is_refused(stamps, position, quaternion, message):
    with pytest.raises(SequenceError, match=message):
        Trajectory(stamps, position, quaternion)
