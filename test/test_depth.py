# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.ground_truth.depth import find_depth, read_archive, shares_of

SECOND_NS = 1_000_000_000
AHEAD = Rotation.identity().as_matrix()


def archive(path, depth_m, **changes):
    arrays = {'depth_mm': np.round(np.asarray(depth_m) * 1000).astype(np.uint16),
              'timestamp': np.arange(len(depth_m), dtype=float), **changes}
    np.savez(path, **arrays)
    return path


def shares(tmp_path, depth_m, centre, turn=None):
    images = read_archive(archive(tmp_path / 'depth.npz', depth_m))
    count = len(depth_m)
    turns = np.tile(AHEAD, (count, 1, 1)) if turn is None else np.asarray(turn)
    return shares_of(images, np.arange(count) * SECOND_NS, turns, np.asarray(centre, float), 0.8)


def wall(depth_m):
    return np.full((48, 64), depth_m)


def test_two_views_of_one_wall_share_what_lies_in_both(tmp_path):
    # 2 m off, the frame is 2.5 m wide: half a metre aside, four fifths stay.
    share = shares(tmp_path, [wall(2), wall(2)], [[0, 0, 0], [0.5, 0, 0]])
    assert share[0, 1] == pytest.approx(0.8, abs=0.02)
    assert share[1, 0] == pytest.approx(0.8, abs=0.02)


def test_a_nearer_view_is_a_small_part_of_the_further_one(tmp_path):
    share = shares(tmp_path, [wall(4), wall(1)], [[0, 0, 0], [0, 0, 3]])
    assert share[1, 0] == 1
    assert share[0, 1] == pytest.approx(1 / 16, abs=0.02)


def test_a_view_from_behind_the_wall_shares_nothing(tmp_path):
    share = shares(tmp_path, [wall(2), wall(3)], [[0, 0, 0], [0, 0, 2.5]])
    assert share[0, 1] == share[1, 0] == 0


def test_a_view_back_to_back_shares_nothing(tmp_path):
    back = Rotation.from_euler('y', 180, degrees=True).as_matrix()
    share = shares(tmp_path, [wall(2), wall(2)], np.zeros((2, 3)), [AHEAD, back])
    assert share[0, 1] == share[1, 0] == 0


def test_nothing_is_known_without_depth(tmp_path):
    share = shares(tmp_path, [wall(2), wall(0)], np.zeros((2, 3)))
    assert np.isnan(share[0, 1])
    assert np.isnan(share[1, 0])


def test_depth_images_of_tum_are_read(tmp_path):
    (tmp_path / 'depth').mkdir()
    rows = []
    for number in range(3):
        name = f'depth/{number}.png'
        cv2.imwrite(str(tmp_path / name), np.full((480, 640), 5000 * (number + 1), np.uint16))
        rows.append(f'{number}.010000 {name}\n')
    (tmp_path / 'depth.txt').write_text('# depth maps\n' + ''.join(rows))
    images = find_depth(tmp_path)
    found = images.at(np.array([0, SECOND_NS, SECOND_NS + SECOND_NS // 2]))
    assert found.shape == (3, 48, 64)
    assert (found[0] == 1).all()
    assert (found[1] == 2).all()
    assert not found[2].any()  # half a second from any depth image


def test_no_depth_is_none(tmp_path):
    assert find_depth(tmp_path) is None


@pytest.mark.parametrize('changes', [
    {'timestamp': np.zeros(2)}, {'timestamp': np.arange(3.0)},
    {'depth_mm': np.zeros((2, 4, 4))}, {'depth_mm': np.zeros((2, 4), np.uint16)}])
def test_archives_of_something_else_are_refused(tmp_path, changes):
    path = archive(tmp_path / 'depth.npz', [wall(2), wall(2)], **changes)
    with pytest.raises(EvaluationError, match='expected'):
        read_archive(path)


def test_a_depth_image_of_another_kind_is_named(tmp_path):
    cv2.imwrite(str(tmp_path / 'a.png'), np.zeros((4, 4, 3), np.uint8))
    (tmp_path / 'depth.txt').write_text('0.0 a.png\n')
    with pytest.raises(EvaluationError, match=r'a\.png'):
        find_depth(tmp_path)
