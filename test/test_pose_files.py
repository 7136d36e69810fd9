# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of poses: every form, whatever wrote the text, and what is refused."""

from pathlib import Path

import bag_factory as make
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.poses.pose_files import (
    matrix_trajectory,
    mounted,
    read_euroc,
    read_kitti,
    read_matrices,
    read_tum,
)

seeds = st.integers(0, 999_999)
PLACE = Path('poses')


def matrices(seed, count=3):
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = Rotation.random(count, random_state=seed).as_matrix()
    poses[:, :3, 3] = np.random.default_rng(seed).normal(size=(count, 3))
    return poses


def text(rows):
    return '\n'.join(' '.join(f'{number:.17g}' for number in row) for row in rows)


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_forms_of_matrices_give_the_same_poses(tmp_path_factory, seed):
    folder, poses = tmp_path_factory.mktemp('poses'), matrices(seed)
    forms = {'kitti': poses[:, :3].reshape(-1, 12), 'line': poses.reshape(-1, 16),
             'block': poses.reshape(-1, 4)}
    for name, rows in forms.items():
        (folder / name).write_text(text(rows))
    np.testing.assert_array_equal(read_kitti(folder / 'kitti'), poses)
    np.testing.assert_array_equal(read_matrices(folder / 'line'), poses)
    np.testing.assert_array_equal(read_matrices(folder / 'block'), poses)


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_euroc_has_the_real_part_first(tmp_path_factory, seed):
    poses = matrix_trajectory(make.stamps(3), matrices(seed), PLACE)
    path = tmp_path_factory.mktemp('poses') / 'data.csv'
    path.write_text('#timestamp [ns],p_x,p_y,p_z,q_w,q_x,q_y,q_z,v_x\r\n' + ''.join(
        f'{stamp},' + ','.join(map(repr, [*place, turn[3], *turn[:3], 7.0])) + '\r\n'
        for stamp, place, turn in zip(poses.stamp_ns, poses.position.tolist(),
                                      poses.quaternion.tolist(), strict=True)))
    found = read_euroc(path)
    np.testing.assert_array_equal(found.stamp_ns, poses.stamp_ns)
    np.testing.assert_array_equal(found.position, poses.position)
    np.testing.assert_array_equal(found.quaternion, poses.quaternion)


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_a_mount_is_the_product_of_matrices(seed):
    poses, mount = matrices(seed), matrices(seed + 1, 1)[0]
    camera = mounted(matrix_trajectory([1, 2, 3], poses, PLACE), mount)
    np.testing.assert_allclose(camera.position, (poses @ mount)[:, :3, 3], atol=1e-12)
    turn = Rotation.from_quat(camera.quaternion).as_matrix()
    np.testing.assert_allclose(turn, (poses @ mount)[:, :3, :3], atol=1e-12)


@pytest.mark.parametrize('encoding', ['utf-8', 'utf-8-sig', 'utf-16', 'utf-32'])
@pytest.mark.parametrize('end', ['\n', '\r\n'])
def test_a_text_made_elsewhere_is_read(tmp_path, encoding, end):
    path = tmp_path / 'truth.txt'
    path.write_bytes(end.join([make.pose_line(1), make.pose_line(2), '']).encode(encoding))
    assert read_tum(path).stamp_ns.tolist() == [1, 2]


@pytest.mark.parametrize('encoding', ['utf-16-le', 'utf-16-be'])
def test_utf16_without_a_mark_is_named(tmp_path, encoding):
    path = tmp_path / 'truth.txt'
    path.write_bytes(make.pose_line(1).encode(encoding))
    with pytest.raises(SequenceError, match=r'truth\.txt is no text in UTF-8'):
        read_tum(path)


def test_a_frame_without_a_pose_is_kept_as_one(tmp_path):
    path = tmp_path / 'lost.txt'
    path.write_text(text(np.full((4, 4), -np.inf)))
    assert not np.isfinite(read_matrices(path)).any()


@pytest.mark.parametrize(('read', 'content', 'message'), [
    (read_kitti, '1 0 0 0', r'line 1: 4 fields; expected 12'),
    (read_kitti, text([[2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]]), r'line 1: .* no rotation'),
    (read_kitti, '# nothing', r'holds no pose'),
    (read_matrices, '1 0 0 0\n0 1 0 0', r'expected 4 rows of 4 numbers a pose, found 2'),
    (read_matrices, '1 0 0 0 0', r'5 numbers; expected a row of 4, or a matrix of 16'),
    (read_matrices, text([np.ones(16)]), r'pose 0: .* no rotation'),
    (read_matrices, '', r'found 0 rows'),
    (read_euroc, '1.5,0,0,0,1,0,0,0', r'line 1: 1\.5 is no .* those of TUM between blanks'),
    (read_euroc, '9' * 5000 + ',0,0,0,1,0,0,0', r'no time stamp in nanoseconds'),
    (read_euroc, '-1,0,0,0,1,0,0,0', r'no time stamp in nanoseconds'),
    (read_euroc, '1,0,0,0,1,0,0', r'7 fields; expected 8 or more'),
    (read_euroc, '1,0,0,0,1,1,0,0', r'norm 1\.414: expected 1, .*qw,qx'),
    (read_euroc, '2,0,0,0,1,0,0,0\n1,0,0,0,1,0,0,0', r'line 2: .* is earlier'),
])
def test_what_is_no_such_file_is_refused_by_line(tmp_path, read, content, message):
    path = tmp_path / 'poses.txt'
    path.write_text(content)
    with pytest.raises(SequenceError, match=message):
        read(path)
