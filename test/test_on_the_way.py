# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings that were not imported: imported on the way, once, and kept by their content."""

import json
import shutil

import bag_factory as make
import cv2
import layout_factory as layouts
import pytest

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.config import ReplayConfig
from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.poses.frame_poses import parse_extrinsics
from adversarial_lcd_ros.sequences import import_sequence, open_sequence
from adversarial_lcd_ros.sequences.bag_truth import TruthOptions
from adversarial_lcd_ros.sequences.on_the_way import imported, is_imported
from adversarial_lcd_ros.sequences.replay import Replay


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv('ADVERSARIAL_LCD_CACHE', str(tmp_path / 'cache'))
    return tmp_path / 'cache' / 'imports'


def test_what_import_wrote_is_taken_as_it_is(tmp_path, cache):
    import_sequence(make.tum_folder(tmp_path / 'tum'), tmp_path / 'bag')
    assert is_imported(tmp_path / 'bag')
    assert imported(tmp_path / 'bag', {}) == tmp_path / 'bag'
    assert not cache.exists()


def test_a_recording_is_imported_once(tmp_path):
    source, said = make.tum_folder(tmp_path / 'tum'), []
    bag = imported(source, {}, tell=said.append)
    assert is_imported(bag)
    assert open_sequence(bag).name == 'tum'
    assert open_sequence(bag).stamps_ns.tolist() == make.stamps()
    assert 'importing it to' in said[0]
    assert '4 of 4 frames have a pose' in said[1]
    before = (bag / 'metadata.yaml').stat().st_mtime_ns
    assert imported(source, {}, tell=said.append) == bag
    assert 'was imported before' in said[2]
    assert (bag / 'metadata.yaml').stat().st_mtime_ns == before
    # By content: a copy elsewhere of the same name is the same recording.
    shutil.copytree(source, tmp_path / 'copy' / 'tum')
    assert imported(tmp_path / 'copy' / 'tum', {}) == bag


def test_other_content_or_options_are_another_import(tmp_path):
    source = make.tum_folder(tmp_path / 'tum')
    mount = TruthOptions(extrinsics=parse_extrinsics(['1', '0', '0', '0', '0', '0', '1']))
    bags = [imported(source, options) for options in (
        {}, {'ground_truth': 'none'}, {'truth': mount})]
    (source / 'groundtruth.txt').write_text('\n'.join(
        make.pose_line(stamp, 9.0) for stamp in make.stamps()))
    bags.append(imported(source, {}))
    assert len(set(bags)) == 4
    found = [open_sequence(bag).trajectory for bag in bags]
    assert found[1] is None
    assert [found[k].position[0, 0] for k in (0, 2, 3)] == [0.0, 1.0, 9.0]


@pytest.mark.parametrize('name', ['covisibility.npz', 'depth.npz'])
@pytest.mark.parametrize('write', [make.tum_folder, lambda path: make.write_ros2(
    path, make.raw_rows()), lambda path: next(make.write_ros2(path, make.raw_rows()).glob(
        '*.mcap'))])
def test_what_tells_labels_what_views_share_goes_with_them(tmp_path, write, name):
    source = write(tmp_path / 'walk')
    before = imported(source, {})
    beside = (source if source.is_dir() else source.parent) / name
    beside.write_bytes(b'one')
    carried = imported(source, {})
    assert not (before / name).exists()
    assert (carried / name).read_bytes() == b'one'
    assert (import_sequence(source, tmp_path / 'bag').path / name).read_bytes() == b'one'
    beside.write_bytes(b'two')
    assert (imported(source, {}) / name).read_bytes() == b'two'
    beside.unlink()
    beside.symlink_to('/etc/passwd')
    with pytest.raises(SequenceError, match=rf'{name} is a link out of its folder'):
        import_sequence(source, tmp_path / 'bag', overwrite=True)


def test_wrong_settings_are_told_before_an_import(tmp_path, cache, capsys):
    pytest.importorskip('rclpy')
    (tmp_path / 'settings.yaml').write_text('lcd: {threshold: "0.5"}')
    assert main(['evaluate', str(make.tum_folder(tmp_path / 'tum')), '--config',
                 str(tmp_path / 'settings.yaml'), '--output', str(tmp_path / 'results')]) == 2
    assert capsys.readouterr().err.count('\n') == 1
    assert not cache.exists()


def test_what_cannot_be_imported_is_said_in_one_line(tmp_path, capsys):
    (tmp_path / 'empty').mkdir()
    assert main(['import', str(tmp_path / 'empty'), str(tmp_path / 'bag')]) == 2
    line, = capsys.readouterr().err.splitlines()
    assert line.startswith(f'error: {tmp_path / "empty"} holds no sequence')


@pytest.mark.parametrize('rows', [
    make.raw_rows(), make.jpeg_rows(topic='/camera/image_raw/compressed'),
    make.jpeg_rows() + [('/odom', make.ODOMETRY, make.START_NS, make.ROS2.odometry(
        make.START_NS, (0.0, 0.0, 0.0)))]])
def test_a_bag_that_the_nodes_would_not_hear_is_no_imported_one(tmp_path, rows):
    bag = make.write_ros2(tmp_path / 'bag', rows)
    assert not is_imported(bag)
    assert is_imported(imported(bag, {}))


def test_what_cannot_be_imported_is_refused_and_leaves_nothing(tmp_path, cache):
    rows = make.raw_rows() + make.pose_rows(topic='/a') + make.pose_rows(topic='/b')
    with pytest.raises(SequenceError, match='such as --ground-truth /a'):
        imported(make.write_ros2(tmp_path / 'bag', rows), {})
    assert not list(cache.iterdir())
    with pytest.raises(SequenceError, match='there is no sequence'):
        imported(tmp_path / 'nonesuch', {})


def test_build_takes_the_options_of_an_import(tmp_path, capsys):
    bag = make.write_ros2(tmp_path / 'mine', [
        (topic, kind, stamp, make.ROS2.compressed(stamp, make.encoded(make.noise(k))))
        for k, (topic, kind, stamp, _) in enumerate(make.jpeg_rows(topic='/camera/compressed'))
    ] + make.pose_rows(topic='/a') + make.pose_rows(topic='/b'))
    line = ['build', str(bag), str(tmp_path / 'graphs'), '--detector', 'none']
    assert main(line) == 2
    assert '--ground-truth /a' in capsys.readouterr().err
    assert main([*line, '--ground-truth', '/b']) == 0
    assert '4 poses' in capsys.readouterr().out


def test_graphs_of_blank_pictures_are_said_to_be_empty(tmp_path, capsys):
    folder = make.tum_folder(tmp_path / 'tum')
    for file in (folder / 'rgb').iterdir():
        file.write_bytes(make.encoded(make.noise() * 0 + 128))
    assert main(['build', str(folder), str(tmp_path / 'graphs'), '--detector', 'none']) == 0
    assert 'warning: 4 of 4 graphs are empty' in capsys.readouterr().err


def test_a_part_cannot_be_replayed(tmp_path, capsys):
    folder = make.tum_folder(tmp_path / 'tum')
    assert main(['evaluate', f'{folder}@0:0.5', '--output', str(tmp_path / 'results')]) == 2
    assert '--replay-duration-s' in capsys.readouterr().err


def test_inspect_tells_of_any_recording(tmp_path, capsys):
    folder = make.tum_folder(tmp_path / 'tum')
    assert main(['inspect', str(folder)]) == 0
    said = capsys.readouterr().out
    assert 'frames: 4 of 64 x 48 pixels' in said
    assert '4 of 4 frames have a pose, over 0.1 s and a path of 3.00 m' in said
    goal = make.write_ros2(tmp_path / 'goal', make.jpeg_rows() + make.pose_rows(
        topic='/goal_pose'))
    assert main(['inspect', str(goal)]) == 0
    assert '/goal_pose (PoseStamped) is by its name' in capsys.readouterr().out
    two = make.write_ros2(tmp_path / 'two', make.jpeg_rows() + make.pose_rows(
        topic='/a') + make.pose_rows(topic='/b'))
    assert main(['inspect', str(two)]) == 0
    assert 'import: bag' in capsys.readouterr().out
    assert main(['inspect', str(two), '--ground-truth', '/b']) == 0
    assert 'ground truth: /b (PoseStamped)' in capsys.readouterr().out


def test_a_replay_refuses_a_clock_that_jumps(tmp_path):
    rows = make.jpeg_rows()
    early = [(*rows[0][:3], make.ROS2.compressed(5_000_000_000, make.encoded(make.picture()))),
             *rows[1:]]
    with pytest.raises(SequenceError, match=r'clock of the headers jumps.*--stamps log'):
        Replay(make.write_ros2(tmp_path / 'bag', early), ReplayConfig())


def robot_bag(path, count):
    """Write a robot's bag: raw images, camera_info, odometry, /tf and /tf_static."""
    times = make.stamps(count)
    optical = ('base_link', 'camera_optical', (0.1, 0.0, 0.4), (-0.5, 0.5, -0.5, 0.5))
    rows = [('/tf_static', make.TF, times[0], make.ROS2.tf(make.ROS2.link(0, *optical)))]
    for k, stamp in enumerate(times):
        place = (0.05 * k, 0.0, 0.0)
        rows += [
            ('/camera/image_raw', make.IMAGE, stamp, make.ROS2.image(
                stamp, cv2.cvtColor(make.noise(k), cv2.COLOR_GRAY2BGRA), 'bgra8',
                frame_id='camera_optical')),
            ('/camera/camera_info', make.CAMERA_INFO, stamp,
             make.ROS2.camera_info(stamp, 'camera_optical')),
            ('/odom', make.ODOMETRY, stamp, make.ROS2.odometry(stamp, place)),
            ('/tf', make.TF, stamp, make.ROS2.tf(
                make.ROS2.link(stamp, 'odom', 'base_link', place)))]
    return make.write_ros2(path, rows)


def test_a_robots_bag_goes_from_file_to_report_by_one_command(tmp_path, capsys):
    pytest.importorskip('rclpy')
    recipe = tmp_path / 'one.yaml'
    recipe.write_text('attacks: [{name: recall, search: recall, max_queries: 2}]')
    line = ['evaluate', str(robot_bag(tmp_path / 'robot', 8)), '--output',
            str(tmp_path / 'results'), '--builder-detector', 'none', '--recipe', str(recipe)]
    assert main(line) == 0
    said = capsys.readouterr().err
    assert '8 of 8 frames have a pose, over 0.2 s and a path of 0.35 m' in said
    assert 'odom > base_link > camera_optical' in said
    latest = tmp_path / 'results' / 'latest'
    summary = json.loads((latest / 'summary.json').read_text())
    assert (summary['sequence'], summary['frames'], summary['labelled']) == ('robot', 8, True)
    assert (latest / 'report.html').stat().st_size
    assert main([*line, '--ground-truth', 'none']) == 0
    assert not json.loads((latest / 'summary.json').read_text())['labelled']


@pytest.mark.parametrize('write', [
    lambda path: layouts.video(path / 'walk.mp4', count=8),
    lambda path: make.write_ros2(path / 'walk', make.raw_rows(8))])
def test_what_has_no_ground_truth_goes_from_file_to_report_by_one_command(
        tmp_path, capsys, write):
    pytest.importorskip('rclpy')
    recipe = tmp_path / 'one.yaml'
    recipe.write_text('attacks: [{name: recall, search: recall, max_queries: 2}]')
    assert main(['evaluate', str(write(tmp_path)), '--output', str(tmp_path / 'results'),
                 '--builder-detector', 'none', '--recipe', str(recipe)]) == 0
    said = capsys.readouterr()
    assert 'no ground truth' in said.err
    latest = tmp_path / 'results' / 'latest'
    summary = json.loads((latest / 'summary.json').read_text())
    assert (summary['sequence'], summary['frames'], summary['labelled']) == ('walk', 8, False)
    assert 'no ground truth' in (latest / 'report.html').read_text()
