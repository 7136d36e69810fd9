# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ground truth from every source that a bag or a file has, each on a small input of its own."""

import bag_factory as make
from bag_factory import ROS2, stamps
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.poses.frame_poses import parse_extrinsics
from adversarial_lcd_ros.sequences import import_sequence, open_sequence
from adversarial_lcd_ros.sequences.bag_truth import TruthOptions

COUNT = 4
PLACES = [(float(k), 0.0, 0.0) for k in range(COUNT)]
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
# x forward, z up, to the optical frame: z forward, y down.
OPTICAL = (-0.5, 0.5, -0.5, 0.5)
EXTRINSICS = ['0.1', '0.2', '0.3', *map(str, OPTICAL)]


def bag(path, *rows):
    return make.write_ros2(path / 'bag', sorted(
        [*make.jpeg_rows(COUNT), *(row for some in rows for row in some)],
        key=lambda row: row[2]))


def rows(topic, kind, message):
    return [(topic, kind, stamp, message(stamp, place))
            for stamp, place in zip(stamps(COUNT), PLACES, strict=True)]


def odometry(topic='/odom', **frames):
    return rows(topic, make.ODOMETRY, lambda *pose: ROS2.odometry(*pose, **frames))


def transforms(parent, child, topic='/tf', places=PLACES):
    return [(topic, make.TF, stamp, ROS2.tf(ROS2.link(stamp, parent, child, place)))
            for stamp, place in zip(stamps(COUNT), places, strict=True)]


def static(*links):
    return [('/tf_static', make.TF, make.START_NS, ROS2.tf(*(
        ROS2.link(0, parent, child, place, turn) for parent, child, place, turn in links)))]


def positions(sequence):
    return sequence.trajectory.position.tolist()


MOUNT = ('base_link', 'camera', (0.1, 0.2, 0.3), OPTICAL)
MOUNTED = [[k + 0.1, 0.2, 0.3] for k in range(COUNT)]


@pytest.mark.parametrize(('kind', 'message'), [
    (make.POSE, ROS2.pose),
    (make.POSE_COVARIANCE, ROS2.pose_with_covariance),
    (make.ODOMETRY, lambda stamp, place: ROS2.odometry(stamp, place, child='camera')),
    (make.TRANSFORM, lambda stamp, place: ROS2.link(stamp, 'world', 'camera', place)),
])
def test_every_stamped_pose_is_read(tmp_path, kind, message):
    sequence = open_sequence(bag(tmp_path, rows('/vicon', kind, message)))
    np.testing.assert_allclose(positions(sequence), PLACES)
    assert sequence.trajectory.stamp_ns.tolist() == stamps(COUNT)
    assert '/vicon (' in sequence.truth


def test_a_path_is_read_from_its_last_message(tmp_path):
    poses = [ROS2.pose(*pose) for pose in zip(stamps(COUNT), PLACES, strict=True)]
    growing = [('/slam/path', make.PATH, stamp, ROS2.path(poses[:k + 1]))
               for k, stamp in enumerate(stamps(COUNT))]
    assert positions(open_sequence(bag(tmp_path, growing))) == [list(place) for place in PLACES]


@pytest.mark.parametrize('topic', ['/goal_pose', '/move_base_simple/goal', '/robot1/goal_pose',
                                   '/target_pose', '/setpoint_position/local'])
def test_where_a_robot_is_sent_is_no_ground_truth(tmp_path, topic):
    sequence = open_sequence(bag(tmp_path, rows(topic, make.POSE, ROS2.pose)))
    assert sequence.trajectory is None
    assert f'{topic} (PoseStamped) is by its name where a robot was to be' in sequence.truth
    # Beside real poses it is no second source.
    both = make.write_ros2(tmp_path / 'both', make.jpeg_rows() + rows(
        topic, make.POSE, ROS2.pose) + rows('/vicon', make.POSE, ROS2.pose))
    assert open_sequence(both).truth.startswith('/vicon')


def test_initial_poses_planned_paths_and_single_poses_are_none(tmp_path):
    first = rows('/initialpose', make.POSE_COVARIANCE, ROS2.pose_with_covariance)
    plan = [('/route', make.PATH, make.START_NS, ROS2.path(
        [ROS2.pose(0, place) for place in PLACES]))]
    single = rows('/detected_dock', make.POSE, ROS2.pose)[:1]
    sequence = open_sequence(bag(tmp_path, first, plan, single))
    assert sequence.trajectory is None
    for said in ('/initialpose', '/route (Path) is a path to go', '1 pose, no trajectory'):
        assert said in sequence.truth


def test_poses_of_a_robot_need_its_camera(tmp_path):
    source = bag(tmp_path, odometry())
    assert "'base_link', and there is no single chain" in open_sequence(source).truth
    with pytest.raises(SequenceError, match=r'--extrinsics TX TY TZ QX QY QZ QW'):
        open_sequence(source, ground_truth='/odom')
    given = open_sequence(source, ground_truth='odom', truth=TruthOptions(
        extrinsics=parse_extrinsics(EXTRINSICS)))
    np.testing.assert_allclose(positions(given), MOUNTED)
    same = open_sequence(source, truth=TruthOptions(extrinsics=parse_extrinsics(['identity'])))
    np.testing.assert_allclose(positions(same), PLACES)


def test_odometry_goes_through_the_mount_in_tf_static(tmp_path):
    sequence = open_sequence(bag(tmp_path, odometry(), static(MOUNT)))
    np.testing.assert_allclose(positions(sequence), MOUNTED, atol=1e-12)
    turn = Rotation.from_quat(sequence.trajectory.quaternion).apply([0, 0, 1.0])
    np.testing.assert_allclose(turn, [[1, 0, 0]] * COUNT, atol=1e-12)
    assert 'odom > base_link > camera; odometry drifts' in sequence.truth


def test_odometry_and_the_same_motion_in_tf_are_one_source(tmp_path):
    source = bag(tmp_path, odometry(), transforms('odom', 'base_link'), static(MOUNT))
    np.testing.assert_allclose(positions(open_sequence(source)), MOUNTED, atol=1e-12)
    corrected = [(1.0, 0.0, 0.1 * k) for k in range(COUNT)]
    two = make.write_ros2(tmp_path / 'two', make.jpeg_rows() + odometry() + transforms(
        'odom', 'base_link') + transforms('map', 'odom', places=corrected) + static(MOUNT))
    with pytest.raises(SequenceError, match=r'/odom \(Odometry\), /tf \(odom > .*/tf \(map > odom '
                                            r'.*--fixed-frame odom or map'):
        open_sequence(two)
    for options in ({'ground_truth': '/tf'}, {'ground_truth': '/odom'}):
        sequence = open_sequence(two, truth=TruthOptions(fixed_frame='map'), **options)
        np.testing.assert_allclose(positions(sequence), [
            [k + 1.1, 0.2, 0.3 + 0.1 * k] for k in range(COUNT)], atol=1e-12)
        assert sequence.trajectory.frame_id == 'map'


@pytest.mark.parametrize('top', ['world', 'map', 'odom'])
def test_any_fixed_frame_of_tf_will_do(tmp_path, top):
    sequence = open_sequence(bag(tmp_path, transforms(top, 'base_link'), static(MOUNT)))
    np.testing.assert_allclose(positions(sequence), MOUNTED, atol=1e-12)
    assert sequence.truth == f'/tf, {top} > base_link > camera'


def test_a_static_first_link_and_a_moving_head(tmp_path):
    tilted = [(0.0, 0.0, 0.1 * k) for k in range(COUNT)]
    source = bag(tmp_path, transforms('map', 'base_link'),
                 transforms('base_link', 'head', places=tilted),
                 static(('world', 'map', (5.0, 0.0, 0.0), UPRIGHT),
                        ('head', 'camera', (0.0, 0.0, 0.0), UPRIGHT)))
    np.testing.assert_allclose(positions(open_sequence(source)), [
        [5.0 + k, 0.0, 0.1 * k] for k in range(COUNT)])


def test_a_camera_on_the_wall_has_no_trajectory(tmp_path):
    source = bag(tmp_path, static(('world', 'camera', (1.0, 2.0, 3.0), UPRIGHT)))
    assert "the camera 'camera' does not move in world" in open_sequence(source).truth
    with pytest.raises(SequenceError, match=r'no single moving chain'):
        open_sequence(source, ground_truth='/tf')


def test_a_loop_in_tf_ends(tmp_path):
    source = bag(tmp_path, transforms('a', 'b'), transforms('b', 'a'), transforms('b', 'camera'))
    with pytest.raises(SequenceError, match='name the topic'):
        open_sequence(source)


def test_the_camera_frame_is_that_of_camera_info_where_the_images_name_another(tmp_path):
    optical = ('base_link', 'front_optical', (0.1, 0.2, 0.3), OPTICAL)
    info = [('/image/camera_info', make.CAMERA_INFO, make.START_NS,
             ROS2.camera_info(make.START_NS, 'front_optical'))]
    source = bag(tmp_path, odometry(), static(optical), info)
    np.testing.assert_allclose(positions(open_sequence(source)), MOUNTED, atol=1e-12)
    other = make.write_ros2(tmp_path / 'other', make.jpeg_rows() + odometry() + static(optical))
    assert open_sequence(other).trajectory is None
    np.testing.assert_allclose(positions(open_sequence(other, truth=TruthOptions(
        camera_frame='front_optical'))), MOUNTED, atol=1e-12)


def test_a_body_frame_makes_poses_those_of_the_camera(tmp_path):
    source = bag(tmp_path, rows('/vicon', make.POSE, ROS2.pose), static(MOUNT))
    assert positions(open_sequence(source)) == [list(place) for place in PLACES]
    np.testing.assert_allclose(positions(open_sequence(source, truth=TruthOptions(
        body_frame='base_link'))), MOUNTED, atol=1e-12)


def test_what_is_no_source_is_named_with_what_there_is(tmp_path):
    source = bag(tmp_path, odometry(child='camera'))
    with pytest.raises(SequenceError, match=r"'/vicon'; bag .* has /odom \(Odometry\)"):
        open_sequence(source, ground_truth='/vicon')
    with pytest.raises(SequenceError, match=r'is sensor_msgs/msg/CompressedImage.*poses are on'):
        open_sequence(source, ground_truth='/image/compressed')


# stamps --------------------------------------------------------------------------------------

def restamped(frames_ns, poses_ns):
    images = [(topic, kind, stamp, ROS2.compressed(new, make.encoded(make.picture(k))))
              for k, ((topic, kind, stamp, _), new) in enumerate(zip(
                  make.jpeg_rows(COUNT), frames_ns, strict=True))]
    poses = [('/vicon', make.POSE, stamp, ROS2.pose(new, place)) for stamp, new, place in zip(
        stamps(COUNT), poses_ns, PLACES, strict=True)]
    return images + poses


FIRST, SECOND, THIRD, FOURTH = stamps(COUNT)


@pytest.mark.parametrize(('frames_ns', 'said'), [
    ((5_000_000_000, 5_033_333_333, THIRD, FOURTH), 'frames 1 and 2 the clock .* jumps by 13'),
    ((FIRST, SECOND, THIRD + 10**12, FOURTH + 10**12), r'jumps by 1000\.0 s'),
    ((0, 0, 0, 0), 'all 4 frames are stamped 0'),
    ([stamp // 1000 for stamp in stamps(COUNT)], r'0\.000100 s pass .* 0\.100000 s'),
    ([stamp // 10**6 for stamp in stamps(COUNT)], 'stamps in milliseconds or microseconds'),
    ((FIRST, SECOND, SECOND, FOURTH), 'frame 2, at .* does not follow'),
    ((FIRST, THIRD, SECOND, FOURTH), 'frame 2, at .* does not follow')])
def test_wrong_stamps_of_frames_are_named_and_log_times_help(tmp_path, frames_ns, said):
    source = make.write_ros2(tmp_path / 'bag', restamped(frames_ns, stamps(COUNT)))
    with pytest.raises(SequenceError, match=f'{said}.*--stamps log'):
        open_sequence(source)
    done = import_sequence(source, tmp_path / 'out', stamps='log')
    assert (done.coverage.posed_frames, done.coverage.path_m) == (4, 3.0)
    again = open_sequence(tmp_path / 'out')
    assert again.stamps_ns.tolist() == stamps(COUNT)
    assert [frame.stamp_ns for frame in again.frames()] == stamps(COUNT)


def test_headers_are_taken_as_they_are_where_that_is_asked_for(tmp_path):
    frames_ns = (5_000_000_000, 5_033_333_333, THIRD, FOURTH)
    source = make.write_ros2(tmp_path / 'bag', restamped(frames_ns, stamps(COUNT)))
    assert open_sequence(source, stamps='header').stamps_ns.tolist() == list(frames_ns)


def test_wrong_stamps_of_poses(tmp_path):
    twice = make.write_ros2(tmp_path / 'twice', restamped(
        stamps(COUNT), (FIRST, SECOND, SECOND, FOURTH)))
    sequence = open_sequence(twice)
    assert positions(sequence) == [list(PLACES[k]) for k in (0, 1, 3)]
    assert 'left out: 1' in sequence.truth
    for name, poses_ns, said in (('zero', (0, 0, 0, 0), 'all 4 poses are stamped 0'),
                                 ('back', (FIRST, THIRD, SECOND, FOURTH), 'does not follow')):
        source = make.write_ros2(tmp_path / name, restamped(stamps(COUNT), poses_ns))
        with pytest.raises(SequenceError, match=f'/vicon: .*{said}.*--stamps log'):
            open_sequence(source)
        assert len(open_sequence(source, stamps='log').trajectory) == COUNT


# files ---------------------------------------------------------------------------------------

def lines(numbers):
    return '\n'.join(f'{number} {number} 0 0 0 0 0 1' for number in numbers)


def test_a_bag_takes_files_in_every_form(tmp_path):
    source = bag(tmp_path)
    shifted = [(k, np.array([[1, 0, 0, k], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))
               for k in range(COUNT)]
    forms = {
        'tum': '\n'.join(make.pose_line(stamp, k) for k, stamp in enumerate(stamps(COUNT))),
        'euroc': '#timestamp,x,y,z,qw,qx,qy,qz\n' + '\n'.join(
            f'{stamp},{k},0,0,1,0,0,0' for k, stamp in enumerate(stamps(COUNT))),
        'kitti': '\n'.join(' '.join(map(str, m[:3].ravel())) for _, m in shifted),
        'matrices': '\n'.join(' '.join(map(str, m.ravel())) for _, m in shifted)}
    for name, text in forms.items():
        (tmp_path / name).write_text(text)
        assert positions(open_sequence(source, ground_truth=tmp_path / name)) == [
            list(place) for place in PLACES], name
    (tmp_path / 'short').write_text(forms['kitti'].split('\n')[0])
    with pytest.raises(SequenceError, match='1 poses without stamps, for 4 frames'):
        open_sequence(source, ground_truth=tmp_path / 'short')


@pytest.mark.parametrize(('numbers', 'placed'), [
    (range(4), [0, 1, 2, 3]), (range(1, 5), [0, 1, 2, 3]), ([0, 2], [0, 2]), ([2, 4], [1, 3])])
def test_stamps_that_are_frame_numbers_are_recognised(tmp_path, numbers, placed):
    (tmp_path / 'truth.txt').write_text(lines(numbers))
    found = open_sequence(make.tum_folder(tmp_path / 'tum'), ground_truth=tmp_path / 'truth.txt')
    assert found.trajectory.stamp_ns.tolist() == [stamps(COUNT)[k] for k in placed]


def test_numbers_that_could_count_from_0_or_from_1_are_refused(tmp_path):
    (tmp_path / 'truth.txt').write_text(lines([1, 2]))
    with pytest.raises(SequenceError, match='count from 0 or from 1'):
        open_sequence(make.tum_folder(tmp_path / 'tum'), ground_truth=tmp_path / 'truth.txt')


def test_a_rate_does_not_stretch_numbered_poses(tmp_path):
    folder = make.tum_folder(tmp_path / 'tum', count=6) / 'rgb'
    (tmp_path / 'truth.txt').write_text(lines(range(6)))
    found = open_sequence(folder, ground_truth=tmp_path / 'truth.txt', rate_hz=10.0)
    assert found.stamps_ns.tolist() == [k * 100_000_000 for k in range(6)]
    assert found.trajectory.stamp_ns.tolist() == found.stamps_ns.tolist()
    assert open_sequence(folder, ground_truth=tmp_path / 'truth.txt').coverage.posed_frames == 6


def test_poses_at_whole_seconds_of_a_simulated_clock_stay_seconds(tmp_path):
    folder = make.tum_folder(tmp_path / 'tum', count=41) / 'rgb'
    (tmp_path / 'truth.txt').write_text(lines(range(5)))
    found = open_sequence(folder, ground_truth=tmp_path / 'truth.txt', rate_hz=10.0)
    assert found.trajectory.stamp_ns.tolist() == [k * 10**9 for k in range(5)]
    assert found.coverage.posed_frames == 5


def test_poses_on_a_topic_may_be_numbered_as_well(tmp_path):
    source = make.write_ros2(tmp_path / 'bag', restamped(
        stamps(COUNT), [k * 10**9 for k in range(COUNT)]))
    assert open_sequence(source).trajectory.stamp_ns.tolist() == stamps(COUNT)


def test_an_empty_path_is_no_trajectory(tmp_path):
    source = bag(tmp_path, [('/path', make.PATH, make.START_NS, ROS2.path([]))])
    assert open_sequence(source).trajectory is None
    with pytest.raises(SequenceError, match='there is no pose'):
        open_sequence(source, ground_truth='/path')


def test_seconds_at_one_hertz_stay_seconds(tmp_path):
    folder = make.tum_folder(tmp_path / 'tum', count=3) / 'rgb'
    (tmp_path / 'truth.txt').write_text(lines(range(3)))
    found = open_sequence(folder, ground_truth=tmp_path / 'truth.txt', rate_hz=1.0)
    assert found.trajectory.stamp_ns.tolist() == [0, 10**9, 2 * 10**9]


@pytest.mark.parametrize('words', [['1', '2'], ['a'] * 7, ['0'] * 7, ['nan', *'000001'],
                                   ['/nonesuch']])
def test_wrong_extrinsics_are_refused(words):
    with pytest.raises(SequenceError, match=r'expected tx ty tz|cannot be read'):
        parse_extrinsics(words)


def test_extrinsics_from_a_file_and_for_a_folder(tmp_path):
    (tmp_path / 'mount.txt').write_text('1 0 0 0.5\n0 1 0 0\n0 0 1 0\n0 0 0 1\n')
    options = TruthOptions(extrinsics=parse_extrinsics([str(tmp_path / 'mount.txt')]))
    folder = make.tum_folder(tmp_path / 'tum')
    assert positions(open_sequence(folder, truth=options))[0] == [0.5, 0.0, 0.0]
    with pytest.raises(SequenceError, match='no poses in metres'):
        open_sequence(folder, ground_truth='none', truth=options)
    with pytest.raises(SequenceError, match='fixed_frame given'):
        open_sequence(folder, truth=TruthOptions(fixed_frame='map'))


def test_an_import_ends_with_what_has_a_pose(tmp_path):
    (tmp_path / 'truth.txt').write_text('\n'.join(
        make.pose_line(stamp, 2.0 * k) for k, stamp in enumerate(stamps(3))))
    folder = make.tum_folder(tmp_path / 'tum', count=30)
    done = import_sequence(folder, tmp_path / 'bag', ground_truth=tmp_path / 'truth.txt')
    assert str(done.coverage).startswith(
        '4 of 30 frames have a pose, over 0.1 s and a path of 4.00 m')
    bare = import_sequence(make.tum_folder(tmp_path / 'bare', truth=False), tmp_path / 'other')
    assert str(bare.coverage) == 'no ground truth: the source has none'
