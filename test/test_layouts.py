# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings in the layouts of published data sets: a line of bags/README.md each."""

import bag_factory as make
import layout_factory as layouts
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.sequences import import_sequence, open_sequence
from adversarial_lcd_ros.sequences.bag_truth import TruthOptions

POSES = layouts.poses()


def assert_poses(trajectory, expected):
    np.testing.assert_allclose(trajectory.position, expected[:, :3, 3], atol=1e-9)
    turned = (Rotation.from_quat(trajectory.quaternion.copy()).inv()
              * Rotation.from_matrix(expected[:, :3, :3]))
    assert turned.magnitude().max() < 1e-6


def assert_shows(sequence, seed):
    for number, frame in enumerate(sequence.frames()):
        error = np.abs(frame.image().astype(int) - make.picture(seed + number)).mean()
        assert error < 12


@pytest.mark.parametrize('truth', ['state_groundtruth_estimate0', 'mocap0'])
def test_euroc(tmp_path, truth):
    folder = layouts.euroc(tmp_path / 'MH_01', truth)
    sequence = open_sequence(folder)
    assert (sequence.name, sequence.focal_length_px) == ('MH_01', 45.5)
    assert sequence.stamps_ns.tolist() == make.stamps()
    assert_poses(sequence.trajectory, POSES @ layouts.MOUNT)
    assert_shows(sequence, 0)
    note, = sequence.notes
    assert 'frames of cam0; not taken: cam1 (--camera)' in note


@pytest.mark.parametrize('part', ['mav0', 'mav0/cam1', 'mav0/cam1/data'])
def test_euroc_is_known_from_any_of_its_folders(tmp_path, part):
    folder = layouts.euroc(tmp_path / 'MH_01')
    sequence = open_sequence(folder / part, camera='cam1')
    assert_shows(sequence, 10)
    assert sequence.notes == ()
    assert_poses(sequence.trajectory, POSES @ layouts.MOUNT)


def test_euroc_without_a_mount_is_refused(tmp_path):
    folder = layouts.euroc(tmp_path / 'MH_01')
    (folder / 'mav0/cam0/sensor.yaml').write_text('sensor_type: camera\n')
    with pytest.raises(SequenceError, match=r'EuRoC: .*data\.csv has .*sensor\.yaml no T_BS'):
        open_sequence(folder)
    sequence = open_sequence(folder, ground_truth='none')
    assert (sequence.trajectory, sequence.focal_length_px) == (None, None)


@pytest.mark.parametrize('spoiled', [True, False])
def test_extrinsics_take_the_place_of_the_recordings_own_mount(tmp_path, spoiled):
    mount = np.eye(4)
    mount[:3, 3] = 0.5, -0.25, 1.0
    euroc, kitti = layouts.euroc(tmp_path / 'MH_01'), layouts.kitti(tmp_path)
    openloris, _ = layouts.openloris(tmp_path / 'cafe1-1')
    if spoiled:
        (euroc / 'mav0/cam0/sensor.yaml').unlink()
        (kitti / 'calib.txt').unlink()
        (openloris / 'trans_matrix.yaml').unlink()
    for folder, camera in ((euroc, 'cam0'), (kitti, 'image_1'), (openloris, 'color')):
        if spoiled:
            with pytest.raises(SequenceError, match='--extrinsics'):
                open_sequence(folder, camera=camera)
        sequence = open_sequence(folder, camera=camera, truth=TruthOptions(extrinsics=mount))
        assert_poses(sequence.trajectory, POSES @ mount)


def test_kitti(tmp_path):
    folder = layouts.kitti(tmp_path)
    sequence = open_sequence(folder)
    assert (sequence.name, sequence.focal_length_px) == ('07', 50.5)
    assert sequence.stamps_ns.tolist() == [0, 100_000_000, 200_000_000, 300_000_000]
    assert_poses(sequence.trajectory, POSES)
    assert_shows(sequence, 0)
    note, = sequence.notes
    assert 'frames of image_0; not taken: image_2, image_1 (--camera)' in note


def test_the_right_eye_of_kitti_sits_a_baseline_to_the_right(tmp_path):
    sequence = open_sequence(layouts.kitti(tmp_path), camera='image_1')
    shift = np.eye(4)
    shift[0, 3] = layouts.BASELINE
    assert_poses(sequence.trajectory, POSES @ shift)
    assert_shows(sequence, 10)


def test_kitti_from_the_folder_of_a_camera(tmp_path):
    folder = layouts.kitti(tmp_path)
    assert_shows(open_sequence(folder / 'image_2'), 20)
    (folder / 'calib.txt').unlink()
    assert open_sequence(folder).trajectory is not None
    with pytest.raises(SequenceError, match=r'poses of image_0, and .*calib\.txt no P2'):
        open_sequence(folder / 'image_2')
    with pytest.raises(SequenceError, match=r"no camera 'image_3': expected .*image_0, image_2"):
        open_sequence(folder, camera='image_3')


def test_kitti_that_does_not_fit_is_refused(tmp_path):
    folder = layouts.kitti(tmp_path)
    layouts.write_rows(tmp_path / 'poses/07.txt', POSES[:2, :3].reshape(-1, 12).tolist())
    with pytest.raises(SequenceError, match=r'07\.txt has 2 poses for 4 frames'):
        open_sequence(folder)
    layouts.write_rows(folder / 'times.txt', [[0.1]])
    with pytest.raises(SequenceError, match=r'holds 4 images, .*times\.txt 1 times'):
        open_sequence(folder)


@pytest.mark.parametrize('part', ['', 'results'])
def test_replica(tmp_path, part):
    sequence = open_sequence(layouts.replica(tmp_path) / part, rate_hz=10.0)
    assert (sequence.name, sequence.focal_length_px) == ('room0', 48.25)
    assert sequence.stamps_ns.tolist() == [0, 100_000_000, 200_000_000, 300_000_000]
    assert_poses(sequence.trajectory, POSES)
    assert_shows(sequence, 0)
    assert '4 depth maps are not taken' in sequence.notes[0]


@pytest.mark.parametrize('part', ['', 'color'])
def test_scannet(tmp_path, part):
    sequence = open_sequence(layouts.scannet(tmp_path / 'scene') / part, rate_hz=10.0)
    assert (sequence.frame_count, sequence.focal_length_px) == (4, 51.5)
    assert sequence.trajectory.stamp_ns.tolist() == [0, 200_000_000, 300_000_000]
    assert_poses(sequence.trajectory, POSES[[0, 2, 3]])


def test_scannet_without_any_pose_is_refused(tmp_path):
    folder = layouts.scannet(tmp_path / 'scene')
    for path in (folder / 'pose').iterdir():
        path.rename(path.with_name(f'frame-{path.name}'))
    with pytest.raises(SequenceError, match=r'no image has a pose of its name'):
        open_sequence(folder)


def test_openloris(tmp_path):
    folder, mount = layouts.openloris(tmp_path / 'cafe1-1')
    sequence = open_sequence(folder)
    assert sequence.focal_length_px == 61.5
    assert sequence.stamps_ns.tolist() == make.stamps()
    assert_poses(sequence.trajectory, POSES @ mount)
    assert 'frames of color; not taken: fisheye1' in sequence.notes[0]
    with pytest.raises(SequenceError, match=r'no chain from base_link to t265_fisheye1'):
        open_sequence(folder, camera='fisheye1')
    assert_shows(open_sequence(folder / 'fisheye1', ground_truth='none'), 10)
    (folder / 'trans_matrix.yaml').unlink()
    with pytest.raises(SequenceError, match=r'poses of base_link, and no trans_matrix\.yaml'):
        open_sequence(folder)
    own = open_sequence(folder, ground_truth=folder / 'groundtruth.txt')
    assert_poses(own.trajectory, POSES)


def test_bonn_is_a_tum_folder(tmp_path):
    folder = make.tum_folder(tmp_path / 'rgbd_bonn_balloon')
    layouts.depths(folder / 'depth', ['1.png'])
    (folder / 'depth.txt').write_text('1.0 depth/1.png\n')
    assert open_sequence(folder).frame_count == 4


@pytest.mark.parametrize('suffix', ['.mp4', '.avi', '.mkv'])
def test_video(tmp_path, suffix):
    path = layouts.video(tmp_path / f'walk{suffix}')
    sequence = open_sequence(path)
    assert (sequence.name, sequence.image_size) == ('walk', (make.WIDTH, make.HEIGHT))
    assert sequence.stamps_ns.tolist() == [0, 100_000_000, 200_000_000, 300_000_000]
    assert_shows(sequence, 0)
    assert [frame.stamp_ns for frame in sequence.frames(1, stride=2)] == [100_000_000,
                                                                          300_000_000]
    at_rate = open_sequence(path, rate_hz=2.0)
    assert at_rate.stamps_ns.tolist() == [0, 500_000_000, 1_000_000_000, 1_500_000_000]


def test_video_with_a_pose_per_frame(tmp_path):
    path = layouts.video(tmp_path / 'walk.mp4')
    truth = tmp_path / 'truth.txt'
    truth.write_text('\n'.join(make.pose_line(stamp) for stamp in make.stamps()))
    assert open_sequence(path, ground_truth=truth).stamps_ns.tolist() == make.stamps()
    assert import_sequence(path, tmp_path / 'bag', ground_truth=truth).poses == 4


def test_poses_from_0_on_stamp_a_video_too(tmp_path):
    """The first pose happens to be near the first frame; the others are as far apart as filmed."""
    path, truth = layouts.video(tmp_path / 'walk.mp4'), tmp_path / 'truth.txt'
    truth.write_text('\n'.join(make.pose_line(800_000_000 * frame) for frame in range(4)))
    sequence = open_sequence(path, ground_truth=truth)
    assert sequence.stamps_ns.tolist() == [0, 800_000_000, 1_600_000_000, 2_400_000_000]


@pytest.mark.parametrize('content', [b'', b'<html>not found</html>', None])
def test_what_is_no_video_is_refused(tmp_path, content, capfd):
    path = layouts.video(tmp_path / 'walk.mp4')
    path.write_bytes(path.read_bytes()[:600] if content is None else content)
    with pytest.raises(SequenceError, match=r'walk\.mp4 (cannot|holds no frame).*ffmpeg'):
        open_sequence(path)


@pytest.mark.parametrize('write', [layouts.euroc, layouts.kitti, layouts.replica])
def test_the_focal_length_goes_into_the_bag(tmp_path, write):
    folder = write(tmp_path / 'source')
    import_sequence(folder, tmp_path / 'bag')
    expected, sequence = open_sequence(folder), open_sequence(tmp_path / 'bag')
    assert sequence.focal_length_px == expected.focal_length_px is not None
    assert sequence.frame_count == layouts.COUNT
    assert_poses(sequence.trajectory, np.stack([
        np.vstack([np.hstack([Rotation.from_quat(turn).as_matrix(), place[:, None]]),
                   [0, 0, 0, 1]])
        for place, turn in zip(expected.trajectory.position, expected.trajectory.quaternion,
                               strict=True)]))


@pytest.mark.parametrize(('write', 'option'), [
    (layouts.euroc, {'rate_hz': 10.0}), (layouts.kitti, {'topic': '/image'}),
    (make.tum_folder, {'camera': 'cam0'})])
def test_options_that_do_not_apply_are_refused(tmp_path, write, option):
    with pytest.raises(SequenceError, match=r'given, but .* brings its own'):
        open_sequence(write(tmp_path / 'source'), **option)


@pytest.mark.parametrize('names', [('image_0', 'image_1'), ('left', 'right'), ('cam0', 'cam1'),
                                   ('CAM_FRONT', 'CAM_BACK'), ('stereo_left', 'mono_rear'),
                                   ('rgb', 'depth'), ('color', 'mask'), ('a', 'b_depth')])
def test_views_of_one_recording_are_no_walks(tmp_path, names):
    for name in names:
        layouts.pictures(tmp_path / name, ['0.png', '1.png'])
    with pytest.raises(SequenceError, match=r'views of one recording .*\(--camera\) among'):
        open_sequence(tmp_path)
    assert open_sequence(tmp_path, camera=names[0]).frame_count == 2


def test_pictures_taken_at_once_are_no_walks(tmp_path):
    for seed, (name, offset) in enumerate((('one', 0), ('two', 50))):
        layouts.pictures(tmp_path / name, [f'{1_600_000_000_000 + offset + 100 * k}.png'
                                           for k in range(3)], 10 * seed)
    with pytest.raises(SequenceError, match=r'views of one recording \(one, two\)'):
        open_sequence(tmp_path)
    for path in (tmp_path / 'two').iterdir():
        path.rename(path.with_name(f'{int(path.stem) + 60_000}.png'))
    assert open_sequence(tmp_path).frame_count == 6


def test_a_bag_that_was_not_ended_is_named(tmp_path):
    path = tmp_path / 'walk.bag.active'
    path.write_bytes(b'#ROSBAG V2.0')
    with pytest.raises(SequenceError, match=r'was not ended: mend it with "rosbag reindex'):
        open_sequence(path)


def test_depth_under_any_name_is_no_walk(tmp_path):
    layouts.pictures(tmp_path / 'first', ['0.png', '1.png'])
    layouts.depths(tmp_path / 'second', ['0.png', '1.png'])
    with pytest.raises(SequenceError, match=r'views of one recording \(second\)'):
        open_sequence(tmp_path)


def test_depth_beside_pictures_is_left_out(tmp_path):
    layouts.pictures(tmp_path, ['c0.png', 'c1.png'])
    layouts.depths(tmp_path, ['a0.png', 'a1.png'])
    sequence = open_sequence(tmp_path)
    assert sequence.frame_count == 2
    assert '2 depth maps are not taken' in sequence.notes[0]
    assert_shows(sequence, 0)


def test_depth_alone_is_refused(tmp_path):
    layouts.depths(tmp_path, ['0.png', '1.png'])
    with pytest.raises(SequenceError, match=r'2 PNG of 16 bits without colour, as depth maps'):
        open_sequence(tmp_path)


@pytest.mark.parametrize('names', [('left_{}.png', 'right_{}.png'), ('cam0_{}.png', 'cam1_{}.png'),
                                   ('{}_rgb.png', '{}_mask.png')])
def test_two_views_in_one_folder_are_chosen_by_name(tmp_path, names):
    for seed, name in enumerate(names):
        layouts.pictures(tmp_path, [name.format(f'{k:04d}') for k in range(3)], 10 * seed)
    with pytest.raises(SequenceError, match=r'several views of the same moments'):
        open_sequence(tmp_path)
    if not names[0].startswith('{'):
        assert_shows(open_sequence(tmp_path, camera=names[1].split('{', maxsplit=1)[0]), 10)
    with pytest.raises(SequenceError, match=r'has no images up\*'):
        open_sequence(tmp_path, camera='up')


@pytest.mark.parametrize('unit', [1, 1_000, 1_000_000])
def test_names_that_are_times_are_the_stamps(tmp_path, unit):
    stamps = [1_600_000_000_000_000_000 + k * 100_000_000 for k in range(3)]
    layouts.pictures(tmp_path, [f'{stamp // unit}.png' for stamp in stamps])
    sequence = open_sequence(tmp_path)
    assert sequence.stamps_ns.tolist() == stamps
    assert 'named by' in sequence.notes[0]
    assert open_sequence(tmp_path, rate_hz=1.0).stamps_ns[0] == 0


def test_names_in_seconds_are_the_stamps(tmp_path):
    folder = make.tum_folder(tmp_path / 'tum')
    assert open_sequence(folder / 'rgb').stamps_ns.tolist() == make.stamps()


def test_hidden_files_are_nobodys(tmp_path):
    layouts.pictures(tmp_path / 'images', ['0.png', '1.png'])
    for name in ('._0.png', '.DS_Store', 'Thumbs.db', '._a.mcap'):
        (tmp_path / 'images' / name).write_bytes(b'\0\5\x16\7')
    (tmp_path / '__MACOSX').mkdir()
    (tmp_path / '__MACOSX' / '0.png').write_bytes(b'')
    assert open_sequence(tmp_path / 'images').frame_count == 2
    layouts.pictures(tmp_path / 'other', ['0.png', '1.png'])
    assert open_sequence(tmp_path).frame_count == 4


def test_a_folder_of_recordings_names_them(tmp_path):
    layouts.kitti(tmp_path / 'dataset')
    make.tum_folder(tmp_path / 'fr1')
    with pytest.raises(SequenceError, match=r'holds recordings, not one: .*sequences/07') as error:
        open_sequence(tmp_path / 'dataset')
    assert '\n' not in str(error.value)
    with pytest.raises(SequenceError, match=r'name one of .*fr1'):
        open_sequence(tmp_path)


def test_a_frame_of_replica_whose_pose_was_lost_has_none(tmp_path):
    room = layouts.replica(tmp_path)
    lines = (room / 'traj.txt').read_text().splitlines()
    (room / 'traj.txt').write_text('\n'.join([lines[0], ' '.join(['nan'] * 16), *lines[2:]]))
    found = open_sequence(room)
    assert found.frame_count == layouts.COUNT
    assert found.trajectory.stamp_ns.tolist() == [
        stamp for number, stamp in enumerate(found.stamps_ns) if number != 1]
    (room / 'traj.txt').write_text('\n'.join([' '.join(['nan'] * 16)] * layouts.COUNT))
    with pytest.raises(SequenceError, match=r'traj\.txt: none of 4 poses is of finite numbers'):
        open_sequence(room)
