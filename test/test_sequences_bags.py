# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sequences from bags of ROS 1 and ROS 2, and the bag that an import writes."""

from pathlib import Path
import shutil
import sqlite3

import bag_factory as make
from bag_factory import ROS2, encoded, picture, stamps
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.sequences import PLACE_INDEX, import_sequence, open_sequence
from adversarial_lcd_ros.sequences.bagfile import BagFile, BagWriter

TOUR = Path(__file__).resolve().parents[1] / 'bags' / 'flat_tour'
PLUGINS = pytest.mark.parametrize('plugin', [StoragePlugin.MCAP, StoragePlugin.SQLITE3])


def storage(bag):
    """Return the one file of a rosbag2 that holds its messages."""
    return next(path for path in bag.iterdir() if path.suffix in ('.mcap', '.db3'))


def cut(path, share):
    data = path.read_bytes()
    path.write_bytes(data[:int(len(data) * share)])


def tum_bag(path, count=4, **options):
    """Write a bag with TUM's topics; /kinect moves along x and turns about z."""
    truth = [make.START_NS - 5_000_000 + k * 10_000_000 for k in range(count * 4)]
    turn = Rotation.from_euler('z', np.linspace(0, 40, len(truth))[:, None], degrees=True)
    position = np.stack([np.linspace(0, 2, len(truth)), np.ones(len(truth)),
                         np.full(len(truth), 1.5)], axis=1)
    make.tum_bag(path, [picture(k) for k in range(count)], stamps(count), truth, position,
                 turn.as_quat(), **options)
    return truth, position, turn


# reading -------------------------------------------------------------------------------------

@PLUGINS
def test_rosbag2_with_raw_images(tmp_path, plugin):
    bag = make.write_ros2(tmp_path / 'bag', make.raw_rows(padding=5) + make.pose_rows(), plugin)
    for source in (bag, storage(bag)):
        sequence = open_sequence(source)
        assert sequence.stamps_ns.tolist() == stamps()
        assert sequence.trajectory.position[:, 0].tolist() == [0, 1, 2, 3]
        for k, frame in enumerate(sequence.frames()):
            np.testing.assert_array_equal(frame.image(), picture(k))


@PLUGINS
def test_rosbag2_with_compressed_images(tmp_path, plugin):
    rows = make.jpeg_rows(topic='/robot/camera/color/compressed')
    sequence = open_sequence(make.write_ros2(tmp_path / 'bag', rows, plugin))
    assert sequence.trajectory is None
    assert [frame.data for frame in sequence.frames()] == [encoded(picture(k)) for k in range(4)]


def test_stamps_are_those_of_the_headers(tmp_path):
    late = [(topic, kind, stamp + 7_000_000, message)
            for topic, kind, stamp, message in make.raw_rows()]
    assert open_sequence(
        make.write_ros2(tmp_path / 'bag', late)).stamps_ns.tolist() == stamps()


def test_several_cameras_are_ambiguous_and_depth_is_none(tmp_path):
    depth = [('/depth', make.IMAGE, stamp, ROS2.image(stamp, np.zeros((4, 4), np.uint16), '16UC1'))
             for stamp in stamps()]
    packed = [('/depth/compressed', make.COMPRESSED, stamp,
               ROS2.compressed(stamp, b'12 bytes', '16UC1; compressedDepth png'))
              for stamp in stamps()]
    one = make.write_ros2(tmp_path / 'one', make.raw_rows(topic='/left') + depth + packed)
    assert open_sequence(one).frame_count == 4
    two = make.write_ros2(tmp_path / 'two', make.raw_rows(topic='/left')
                          + make.raw_rows(3, topic='/right') + depth)
    with pytest.raises(SequenceError, match=r'/left, /right: name the topic'):
        open_sequence(two)
    assert open_sequence(two, topic='/right').frame_count == 3
    with pytest.raises(SequenceError, match=r"no images on '/up'; topics with images: .*/left"):
        open_sequence(two, topic='/up')
    with pytest.raises(SequenceError, match=r"encoding '16UC1' is depth"):
        open_sequence(two, topic='/depth')
    none = make.write_ros2(tmp_path / 'none', depth)
    with pytest.raises(SequenceError, match=r"no camera images.*/depth .*depth '16UC1'"):
        open_sequence(none)


def test_ground_truth_topics_are_ambiguous_unless_named(tmp_path):
    rows = make.raw_rows() + make.pose_rows(topic='/a') + make.pose_rows(topic='/b')
    bag = make.write_ros2(tmp_path / 'bag', rows)
    with pytest.raises(SequenceError, match=r'poses on /a \(PoseStamped\), /b .*: name the topic'):
        open_sequence(bag)
    assert len(open_sequence(bag, ground_truth='/b').trajectory) == 4
    assert open_sequence(bag, ground_truth='none').trajectory is None


def test_poses_in_two_frames_or_out_of_order_are_refused(tmp_path):
    rows = make.pose_rows()
    mixed = make.write_ros2(tmp_path / 'mixed', make.raw_rows() + rows[:2]
                            + make.pose_rows(frame_id='odom')[2:])
    with pytest.raises(SequenceError, match=r'in several frames: odom, world'):
        open_sequence(mixed)
    swapped = [(*new[:3], old[3]) for new, old in zip(rows, rows[::-1], strict=True)]
    with pytest.raises(SequenceError, match=r'/ground_truth: pose 1 .* does not follow'):
        open_sequence(make.write_ros2(tmp_path / 'swapped', make.raw_rows() + swapped))


def test_tum_bag_of_ros1(tmp_path):
    truth, position, turn = tum_bag(tmp_path / 'tum.bag')
    sequence = open_sequence(tmp_path / 'tum.bag')
    assert (sequence.name, sequence.stamps_ns.tolist()) == ('tum', stamps())
    for k, frame in enumerate(sequence.frames()):
        np.testing.assert_array_equal(frame.image(), picture(k))
    # The chain by matrices, one link after the other.
    assert sequence.trajectory.stamp_ns.tolist() == truth
    for k in range(len(truth)):
        pose = matrix(position[k], turn[k])
        for _, _, place, quaternion in make.TUM_MOUNT:
            pose = pose @ matrix(place, Rotation.from_quat(quaternion))
        np.testing.assert_allclose(sequence.trajectory.position[k], pose[:3, 3], atol=1e-12)
        found = Rotation.from_quat(sequence.trajectory.quaternion[k]).as_matrix()
        np.testing.assert_allclose(found, pose[:3, :3], atol=1e-12)


def matrix(position, turn):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn.as_matrix(), position
    return pose


def test_groundtruth_beside_a_bag_wins_over_its_tf(tmp_path):
    tum_bag(tmp_path / 'tum.bag')
    (tmp_path / 'groundtruth.txt').write_text(
        '\n'.join(make.pose_line(stamp, 42.0) for stamp in stamps()))
    assert open_sequence(tmp_path / 'tum.bag').trajectory.position[:, 0].tolist() == [42.0] * 4


def test_tf_without_the_camera_gives_no_poses_and_says_why(tmp_path):
    tum_bag(tmp_path / 'bare.bag', mount=make.TUM_MOUNT[:1])
    bare = open_sequence(tmp_path / 'bare.bag')
    assert bare.trajectory is None
    assert "camera 'openni_rgb_optical_frame' hangs from no frame there" in bare.truth
    with pytest.raises(SequenceError, match=r"no single moving chain.*'openni_rgb.*it has kinect"):
        open_sequence(tmp_path / 'bare.bag', ground_truth='/tf')


def test_motion_capture_wins_over_another_parent(tmp_path):
    tum_bag(tmp_path / 'robot.bag', mount=(
        *make.TUM_MOUNT, ('/base_link', '/kinect', (9, 9, 9), (0, 0, 0, 1))))
    tum_bag(tmp_path / 'tum.bag')
    np.testing.assert_array_equal(open_sequence(tmp_path / 'robot.bag').trajectory.position,
                                  open_sequence(tmp_path / 'tum.bag').trajectory.position)


# damage --------------------------------------------------------------------------------------

@PLUGINS
@pytest.mark.parametrize('share', [0.0, 0.3, 0.9])
def test_truncated_rosbag2_is_refused(tmp_path, plugin, share):
    bag = make.write_ros2(tmp_path / 'bag', make.raw_rows(8), plugin)
    cut(storage(bag), share)
    with pytest.raises(SequenceError, match=r'truncated|no messages|no camera'):
        [frame.image() for frame in open_sequence(bag).frames()]


@pytest.mark.parametrize('share', [0.0, 0.3, 0.9, 0.99])
def test_truncated_ros1_bag_is_refused(tmp_path, share):
    tum_bag(tmp_path / 'tum.bag')
    cut(tmp_path / 'tum.bag', share)
    with pytest.raises(SequenceError, match=r'bag .*tum\.bag cannot be read'):
        open_sequence(tmp_path / 'tum.bag')


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """Return one bag of every kind."""
    folder = tmp_path_factory.mktemp('whole')
    rows = make.jpeg_rows() + make.pose_rows()
    tum_bag(folder / 'tum.bag')
    return {'ros1': folder / 'tum.bag', 'mcap': make.write_ros2(folder / 'mcap', rows),
            'sqlite3': make.write_ros2(folder / 'sqlite3', rows, StoragePlugin.SQLITE3)}


@settings(max_examples=40, deadline=None)
@given(st.data())
@pytest.mark.parametrize('kind', ['ros1', 'mcap', 'sqlite3'])
def test_damage_anywhere_gives_no_other_error(whole, tmp_path_factory, kind, data):
    bag = tmp_path_factory.mktemp('damaged') / whole[kind].name
    (shutil.copytree if whole[kind].is_dir() else shutil.copy)(whole[kind], bag)
    files = sorted(bag.iterdir()) if bag.is_dir() else [bag]
    file = data.draw(st.sampled_from(files), 'file')
    content = bytearray(file.read_bytes())
    places = st.integers(0, len(content) - 1)
    for place, value in data.draw(st.lists(st.tuples(places, st.integers(0, 255)), min_size=1,
                                           max_size=8), 'damage'):
        content[place] = value
    file.write_bytes(content)
    try:
        found = [frame.image().shape for frame in open_sequence(bag).frames()]
    except SequenceError:
        return
    assert found == [(make.HEIGHT, make.WIDTH, 3)] * 4


def test_metadata_that_are_no_numbers_are_refused(tmp_path):
    bag = make.write_ros2(tmp_path / 'bag', make.raw_rows())
    text = (bag / 'metadata.yaml').read_text()
    (bag / 'metadata.yaml').write_text(text.replace('message_count: 4', 'message_count: four'))
    with pytest.raises(SequenceError, match=r'cannot be read'):
        open_sequence(bag)


def test_messages_missing_from_a_database_are_noticed(tmp_path):
    bag = make.write_ros2(tmp_path / 'bag', make.raw_rows(), StoragePlugin.SQLITE3)
    with sqlite3.connect(storage(bag)) as database:
        database.execute('DELETE FROM messages WHERE id = 4')
    with pytest.raises(SequenceError, match=r'truncated: 3 of 4 messages'):
        open_sequence(bag)


def test_truncated_message_is_refused(tmp_path):
    rows = make.raw_rows()
    rows[2][3].data = rows[2][3].data[:-9]
    with pytest.raises(SequenceError, match=r'frame 2 on /camera/image_raw: .* is truncated'):
        list(open_sequence(make.write_ros2(tmp_path / 'raw', rows)).frames())
    rows = make.jpeg_rows()
    rows[2][3].data = rows[2][3].data[:-9]
    with pytest.raises(SequenceError, match=r'frame 2 on /image/compressed: .* truncated JPEG'):
        list(open_sequence(make.write_ros2(tmp_path / 'jpeg', rows)).frames())


def test_frames_out_of_order_are_refused(tmp_path):
    rows = make.raw_rows()
    swapped = [(*new[:3], old[3]) for new, old in zip(rows, rows[::-1], strict=True)]
    with pytest.raises(SequenceError, match=r'frame 1, at .* does not follow'):
        open_sequence(make.write_ros2(tmp_path / 'bag', swapped))


def test_empty_bags_and_topics_are_refused(tmp_path):
    with pytest.raises(SequenceError, match=r'it has no topics'):
        open_sequence(make.write_ros2(tmp_path / 'empty', []))
    bag = make.write_ros2(tmp_path / 'poses', make.pose_rows())
    with pytest.raises(SequenceError, match=r'no camera images'):
        open_sequence(bag)
    (bag / 'metadata.yaml').unlink()
    with pytest.raises(SequenceError, match=r'metadata.*ros2 bag reindex'):
        open_sequence(bag)


# importing -----------------------------------------------------------------------------------

def contents(bag):
    with BagFile(bag) as reader:
        return reader.topics, [
            (topic, log_ns, reader.decode(topic, wire))
            for topic, log_ns, wire in reader.messages(list(reader.topics))]


@pytest.mark.parametrize('suffix', ['.jpg', '.png'])
def test_import_keeps_every_byte(tmp_path, suffix):
    source = make.tum_folder(tmp_path / 'tum', suffix=suffix)
    (source / 'CREDITS.txt').write_text('by nobody')
    seen = []
    summary = import_sequence(source, tmp_path / 'bag', progress=lambda *k: seen.append(k))
    topics, messages = contents(tmp_path / 'bag')
    assert topics == {'/image/compressed': make.COMPRESSED, '/ground_truth': make.POSE}
    images = [message for topic, _, message in messages if topic == '/image/compressed']
    assert [bytes(m.data) for m in images] == [
        encoded(picture(k), suffix) for k in range(4)]
    assert {m.format for m in images} == {{'.jpg': 'jpeg', '.png': 'png'}[suffix]}
    assert seen == [(k, 4) for k in (1, 2, 3, 4)]
    assert (summary.name, summary.frames, summary.poses) == ('tum', 4, 4)
    log = [log_ns for _, log_ns, _ in messages]
    assert log == sorted(log) == sorted(stamps() * 2)
    assert (tmp_path / 'bag' / 'CREDITS.txt').read_text() == 'by nobody'


def test_an_imported_bag_is_the_same_sequence(tmp_path):
    original = open_sequence(make.tum_folder(tmp_path / 'tum'))
    import_sequence(tmp_path / 'tum', tmp_path / 'bag')
    again = open_sequence(tmp_path / 'bag')
    assert list(again.frames()) == list(original.frames())
    np.testing.assert_array_equal(again.trajectory.position, original.trajectory.position)
    assert again.trajectory.frame_id == original.trajectory.frame_id
    import_sequence(tmp_path / 'bag', tmp_path / 'copy' / 'bag')
    assert storage(tmp_path / 'copy' / 'bag').read_bytes() == storage(
        tmp_path / 'bag').read_bytes()


def test_import_of_raw_images_without_ground_truth(tmp_path):
    bag = make.write_ros2(tmp_path / 'raw', make.raw_rows())
    assert import_sequence(bag, tmp_path / 'bag').poses == 0
    again = open_sequence(tmp_path / 'bag')
    assert again.trajectory is None
    for k, frame in enumerate(again.frames()):
        assert frame.encoding == 'jpeg'
        assert np.abs(frame.image().astype(int) - picture(k)).mean() < 4


def test_raw_images_as_png_lose_nothing(tmp_path):
    bag = make.write_ros2(tmp_path / 'raw', make.raw_rows())
    import_sequence(bag, tmp_path / 'bag', raw_as='png')
    for k, frame in enumerate(open_sequence(tmp_path / 'bag').frames()):
        assert frame.encoding == 'png'
        np.testing.assert_array_equal(frame.image(), picture(k))
    with pytest.raises(SequenceError, match=r"raw images as 'webp'"):
        import_sequence(bag, tmp_path / 'other', raw_as='webp')


def test_import_keeps_ground_truth_of_the_frames_only(tmp_path):
    source = make.tum_folder(tmp_path / 'tum')
    times = [make.START_NS + k * 50_000_000 for k in range(-10, 20)]
    (source / 'groundtruth.txt').write_text('\n'.join(make.pose_line(t) for t in times))
    import_sequence(source, tmp_path / 'bag')
    kept = open_sequence(tmp_path / 'bag').trajectory.stamp_ns
    assert kept[0] == make.START_NS - 100_000_000
    assert stamps()[-1] < kept[-1] <= stamps()[-1] + 100_000_000


def test_failed_import_leaves_nothing(tmp_path):
    source = make.tum_folder(tmp_path / 'tum')
    last = sorted((source / 'rgb').iterdir())[-1]
    last.write_bytes(last.read_bytes()[:-20])
    for overwrite in (False, True):
        with pytest.raises(SequenceError, match=r'truncated JPEG'):
            import_sequence(source, tmp_path / 'bag', overwrite=overwrite)
        assert [path.name for path in tmp_path.iterdir()] == ['tum']


def test_nothing_is_there_before_an_import_is_complete(tmp_path):
    source = make.tum_folder(tmp_path / 'tum')

    def stop(done, total):
        assert not (tmp_path / 'bag').exists()
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        import_sequence(source, tmp_path / 'bag', progress=stop)
    assert [path.name for path in tmp_path.iterdir()] == ['tum']


def test_existing_destinations_are_kept(tmp_path):
    source = make.tum_folder(tmp_path / 'tum')
    import_sequence(source, tmp_path / 'bag')
    before = storage(tmp_path / 'bag').read_bytes()
    with pytest.raises(SequenceError, match=r'exists already'):
        import_sequence(source, tmp_path / 'bag')
    other = make.tum_folder(tmp_path / 'other', count=2)
    sorted((other / 'rgb').iterdir())[1].unlink()
    with pytest.raises(SequenceError, match=r'there is no image'):
        import_sequence(other, tmp_path / 'bag', overwrite=True)
    assert storage(tmp_path / 'bag').read_bytes() == before
    with pytest.raises(SequenceError, match=r'is no bag'):
        import_sequence(source, other, overwrite=True)
    import_sequence(make.tum_folder(tmp_path / 'third', count=3), tmp_path / 'bag',
                    overwrite=True)
    assert open_sequence(tmp_path / 'bag').frame_count == 3


def test_a_bag_is_kept_where_its_successor_cannot_take_its_place(tmp_path, monkeypatch):
    bag = make.write_ros2(tmp_path / 'bag', make.jpeg_rows())
    rename = Path.rename

    def refuse(path, target):
        if path.parent.name.endswith('.partial'):
            raise OSError('no')
        return rename(path, target)

    writer = BagWriter(bag, overwrite=True)
    monkeypatch.setattr(Path, 'rename', refuse)
    with pytest.raises(SequenceError, match=r'bag .* cannot be written: no'):
        writer.close()
    assert [path.name for path in tmp_path.iterdir()] == ['bag']
    assert open_sequence(bag).frame_count == 4


def test_a_bag_that_came_into_being_meanwhile_is_kept(tmp_path):
    writer = BagWriter(tmp_path / 'bag')
    make.write_ros2(tmp_path / 'bag', make.jpeg_rows())
    with pytest.raises(SequenceError, match=r'exists already'):
        writer.close()
    assert [path.name for path in tmp_path.iterdir()] == ['bag']
    assert open_sequence(tmp_path / 'bag').frame_count == 4


def test_places_that_cannot_be_written_are_named(tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(SequenceError, match=r'file/bag cannot be written'):
        BagWriter(tmp_path / 'file' / 'bag')


def test_a_frame_of_another_size_stops_an_import(tmp_path):
    rows = make.jpeg_rows()
    rows[3][3].data = np.frombuffer(encoded(picture(0, 32, 32)), np.uint8)
    bag = make.write_ros2(tmp_path / 'source', rows)
    with pytest.raises(SequenceError, match=r'32 x 32 pixels, the frames before it 64 x 48'):
        import_sequence(bag, tmp_path / 'bag')
    raw = make.raw_rows()
    raw[3] = (*raw[3][:3], ROS2.image(raw[3][2], picture(0, 32, 32)))
    bag = make.write_ros2(tmp_path / 'raw', raw)
    with pytest.raises(SequenceError, match=r'frame 3 on .* is 32 x 32 pixels'):
        import_sequence(bag, tmp_path / 'bag')


# real sequences ------------------------------------------------------------------------------

def test_freiburg1_rpy_through_a_ros1_bag(shared_data, tmp_path):
    folder = open_sequence(shared_data('rgbd_dataset_freiburg1_rpy'))
    count = 20
    frames = [frame for _, frame in zip(range(count), folder.frames(), strict=False)]
    near = folder.trajectory.between(frames[0].stamp_ns - 50_000_000,
                                     frames[-1].stamp_ns + 50_000_000)
    # What the markers must have seen for the optical frame to be where the ground truth says.
    mount = np.eye(4)
    for _, _, place, quaternion in make.TUM_MOUNT:
        mount = mount @ matrix(place, Rotation.from_quat(quaternion))
    markers = [matrix(place, Rotation.from_quat(turn)) @ np.linalg.inv(mount)
               for place, turn in zip(near.position, near.quaternion, strict=True)]
    make.tum_bag(tmp_path / 'fr1_rpy.bag', [frame.image() for frame in frames],
                 folder.stamps_ns[:count].tolist(), near.stamp_ns.tolist(),
                 [pose[:3, 3] for pose in markers],
                 [Rotation.from_matrix(pose[:3, :3]).as_quat() for pose in markers])
    summary = import_sequence(tmp_path / 'fr1_rpy.bag', tmp_path / 'fr1_rpy')
    assert (summary.frames, summary.image_size) == (count, (640, 480))
    sequence = open_sequence(tmp_path / 'fr1_rpy')
    assert sequence.stamps_ns.tolist() == folder.stamps_ns[:count].tolist()
    np.testing.assert_allclose(sequence.trajectory.position, near.position, atol=1e-9)
    turned = (Rotation.from_quat(sequence.trajectory.quaternion).inv()
              * Rotation.from_quat(near.quaternion))
    # groundtruth.txt has unit quaternions to four digits.
    assert turned.magnitude().max() < 1e-3
    for frame, original in zip(sequence.frames(), frames, strict=True):
        assert np.abs(frame.image().astype(int) - original.image()).mean() < 3


def test_gardens_point_keeps_its_index(shared_data, tmp_path):
    for walk in ('day_left', 'day_right'):
        (tmp_path / 'walks' / walk).mkdir(parents=True)
        for image in sorted((shared_data('gardenspoint_walking') / walk).iterdir())[:3]:
            (tmp_path / 'walks' / walk / image.name).symlink_to(image)
    import_sequence(tmp_path / 'walks', tmp_path / 'bag')
    truth = open_sequence(tmp_path / 'bag').trajectory
    assert truth.frame_id == PLACE_INDEX
    assert truth.position[:, 0].tolist() == [0, 1, 2, 0, 1, 2]


def test_the_embedded_tour_is_whole(shared_data):
    tour = open_sequence(TOUR)
    assert (tour.name, tour.frame_count, tour.image_size) == ('flat_tour', 360, (640, 480))
    np.testing.assert_array_equal(tour.trajectory.stamp_ns, tour.stamps_ns)
    assert (TOUR / 'CREDITS.txt').stat().st_size > 3000
    source = open_sequence(shared_data('flat_tour'))
    assert all(a == b for a, b in zip(tour.frames(), source.frames(), strict=True))
    np.testing.assert_array_equal(tour.trajectory.quaternion, source.trajectory.quaternion)
