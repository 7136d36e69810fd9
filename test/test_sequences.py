# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sequences from folders: what is read, and what is refused with a reason."""

import os

import bag_factory as make
import cv2
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.sequences import PLACE_INDEX, Frame, open_sequence
from adversarial_lcd_ros.sequences.sequence import Coverage


@pytest.fixture
def tum(tmp_path):
    return make.tum_folder(tmp_path / 'tum')


def images(folder, count=3, suffix='.png', size=(make.WIDTH, make.HEIGHT)):
    folder.mkdir(parents=True)
    for k in range(count):
        (folder / f'Image{k}{suffix}').write_bytes(make.encoded(make.picture(k, *size), suffix))
    return folder


def test_tum_folder(tum):
    sequence = open_sequence(tum)
    frames = list(sequence.frames())
    assert (sequence.name, sequence.frame_count) == ('tum', 4)
    assert sequence.image_size == (make.WIDTH, make.HEIGHT)
    # Stamps have more digits than a float64 holds.
    assert sequence.stamps_ns.tolist() == make.stamps()
    assert sequence.trajectory.position[:, 0].tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(frames[2].image(), make.picture(2), atol=25)
    assert frames[2].data == make.encoded(make.picture(2))


@settings(max_examples=40, deadline=None)
@given(start=st.integers(0, 9), stop=st.none() | st.integers(0, 9), stride=st.integers(1, 9))
@pytest.mark.parametrize('kind', ['folder', 'bag'])
def test_a_part_of_the_frames_is_that_slice_of_all(tmp_path_factory, kind, start, stop, stride):
    path = tmp_path_factory.getbasetemp() / f'slices_{kind}'
    if not path.exists():
        (make.tum_folder(path, 7) if kind == 'folder'
         else make.write_ros2(path, make.jpeg_rows(7)))
    sequence = open_sequence(path)
    assert [frame.stamp_ns for frame in sequence.frames(start, stop, stride)] == make.stamps(7)[
        start:stop:stride]


@pytest.mark.parametrize('part', [(-1,), (0, -1), (0, None, 0)])
def test_no_slice_from_behind(tum, part):
    with pytest.raises(SequenceError, match=r'start and a stop of 0 or more'):
        list(open_sequence(tum).frames(*part))


def test_frames_left_out_are_not_read(tum):
    sequence = open_sequence(tum)
    sorted((tum / 'rgb').iterdir())[1].unlink()
    assert len(list(sequence.frames(stride=2))) == 2
    with pytest.raises(SequenceError, match=r'image .* cannot be read'):
        list(sequence.frames())


def test_ground_truth_may_be_absent_or_refused(tmp_path, tum):
    assert open_sequence(make.tum_folder(tmp_path / 'bare', truth=False)).trajectory is None
    assert open_sequence(tum, ground_truth='none').trajectory is None


def test_images_are_sorted_by_number(tmp_path):
    sequence = open_sequence(images(tmp_path / 'walk', count=12), rate_hz=10.0)
    assert np.diff(sequence.stamps_ns).tolist() == [100_000_000] * 11
    last = list(sequence.frames())[-1]
    np.testing.assert_array_equal(last.image(), make.picture(11))


def test_image_folder_with_a_pose_per_image(tmp_path):
    truth = tmp_path / 'truth.txt'
    truth.write_text('\n'.join(make.pose_line(stamp) for stamp in make.stamps(3)))
    folder = images(tmp_path / 'walk')
    assert open_sequence(folder, ground_truth=truth).stamps_ns.tolist() == make.stamps(3)
    with pytest.raises(SequenceError, match=r'per image, over 0\.06\d* s.*leave the rate'):
        open_sequence(folder, ground_truth=truth, rate_hz=1.0)
    truth.write_text(make.pose_line(0))
    with pytest.raises(SequenceError, match=r'3 images.*1 poses'):
        open_sequence(folder, ground_truth=truth)


def test_ground_truth_in_an_image_folder_is_used(tmp_path):
    folder = images(tmp_path / 'walk')
    (folder / 'groundtruth.txt').write_text(
        '\n'.join(make.pose_line(stamp) for stamp in make.stamps(3)))
    assert open_sequence(folder).trajectory.stamp_ns.tolist() == make.stamps(3)
    assert open_sequence(folder, ground_truth='none').trajectory is None


def test_walks_have_ground_truth_by_index(tmp_path):
    images(tmp_path / 'walks' / 'a')
    images(tmp_path / 'walks' / 'b')
    sequence = open_sequence(tmp_path / 'walks', rate_hz=10.0)
    assert sequence.trajectory.frame_id == PLACE_INDEX
    assert sequence.trajectory.position[:, 0].tolist() == [0, 1, 2, 0, 1, 2]
    assert sequence.stamps_ns[3] - sequence.stamps_ns[2] == 60_000_000_000
    (tmp_path / 'walks' / 'b' / 'Image0.png').unlink()
    with pytest.raises(SequenceError, match=r'3 \(a\), 2 \(b\)'):
        open_sequence(tmp_path / 'walks')


def test_seven_scenes(tmp_path):
    turn = cv2.Rodrigues(np.array([0.0, 0.0, np.pi / 2]))[0]
    for k in range(2):
        stem = f'frame-{k:06d}'
        (tmp_path / f'{stem}.color.png').write_bytes(make.encoded(make.picture(k), '.png'))
        (tmp_path / f'{stem}.depth.png').write_bytes(b'')
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turn, (k, 2.0, 3.0)
        np.savetxt(tmp_path / f'{stem}.pose.txt', pose)
    sequence = open_sequence(tmp_path)
    assert sequence.frame_count == 2
    assert sequence.trajectory.position.tolist() == [[0, 2, 3], [1, 2, 3]]
    np.testing.assert_allclose(np.abs(sequence.trajectory.quaternion),
                               [[0, 0, 2**-0.5, 2**-0.5]] * 2, atol=1e-12)
    (tmp_path / 'frame-000001.pose.txt').write_text('1 0 0 0\n0 1 0 0\n')
    with pytest.raises(SequenceError, match=r'frame-000001\.pose\.txt.*4 rows'):
        open_sequence(tmp_path)


@pytest.mark.parametrize(('file', 'line', 'text', 'message'), [
    ('rgb.txt', 3, '12.0', r'rgb\.txt, line 4: 1 fields; expected 2'),
    ('rgb.txt', 3, 'soon rgb/x.jpg', r"rgb\.txt, line 4: 'soon' is no number"),
    ('rgb.txt', 3, 'nan rgb/x.jpg', r"rgb\.txt, line 4: 'nan' is no time stamp"),
    ('rgb.txt', 3, '1305031229.6 rgb/gone.jpg', r'line 4: there is no image .*gone\.jpg'),
    ('groundtruth.txt', 2, '1305031229.5 1 2 3', r'truth\.txt, line 3: 4 fields; expected 8'),
    ('groundtruth.txt', 2, '1305031229.6 1 2 three 0 0 0 1', r'line 3: .*three'),
    ('groundtruth.txt', 2, '1305031229.6 1 nan 3 0 0 0 1', r'line 3: the pose holds NaN'),
    ('groundtruth.txt', 2, '1305031229.6 1 2 3 0 0 0 inf', r'line 3: the pose holds NaN or inf'),
    ('groundtruth.txt', 2, '1305031229.6 1 2 3 0 0 0 9', r'line 3: quaternion of norm 9'),
    ('groundtruth.txt', 2, '12.5 1 2 3 0 0 0 1', r'line 3: 12\.5 s is earlier'),
])
def test_malformed_text_is_named_by_line(tum, file, line, text, message):
    lines = (tum / file).read_text().splitlines()
    lines[line] = text
    (tum / file).write_text('\n'.join(lines))
    with pytest.raises(SequenceError, match=message):
        open_sequence(tum)


def test_frames_out_of_order_are_refused(tum):
    lines = (tum / 'rgb.txt').read_text().splitlines()
    (tum / 'rgb.txt').write_text('\n'.join(lines[:2] + lines[:1:-1]))
    with pytest.raises(SequenceError, match=r'frame 1, at .* does not follow'):
        open_sequence(tum)


def test_a_stamp_written_twice_keeps_its_first_pose(tum):
    truth = tum / 'groundtruth.txt'
    lines = truth.read_text().splitlines()
    truth.write_text('\n'.join([*lines, make.pose_line(make.stamps()[-1], 99.0)]))
    assert open_sequence(tum).trajectory.position[-1, 0] == 3.0


def test_ground_truth_of_another_sequence_is_refused(tum):
    (tum / 'groundtruth.txt').write_text(make.pose_line(17))
    with pytest.raises(SequenceError, match=r'is it the ground truth of this sequence'):
        open_sequence(tum)


@pytest.mark.parametrize('suffix', ['.jpg', '.png'])
def test_truncated_image_is_refused(tmp_path, suffix):
    folder = make.tum_folder(tmp_path / 'tum', suffix=suffix)
    last = sorted((folder / 'rgb').iterdir())[-1]
    last.write_bytes(last.read_bytes()[:-40])
    with pytest.raises(SequenceError, match=rf'{last.name} is a truncated (JPEG|PNG)'):
        list(open_sequence(folder).frames())


@pytest.mark.parametrize('data', [b'', b'no image', b'\xff\xd8\xff\xff\xd9'])
def test_what_is_no_image_is_refused(tum, data):
    sorted((tum / 'rgb').iterdir())[0].write_bytes(data)
    with pytest.raises(SequenceError, match=r'image .*(neither a JPEG nor|cannot be decoded)'):
        open_sequence(tum)


@pytest.mark.parametrize('suffix', ['.jpg', '.png'])
@pytest.mark.parametrize('tail', [b'\0' * 300, b'data of the camera maker'])
def test_what_a_camera_puts_behind_an_image_does_not_matter(tum, suffix, tail):
    data = make.encoded(make.picture(), suffix) + tail
    sorted((tum / 'rgb').iterdir())[0].write_bytes(data)
    first = next(open_sequence(tum).frames())
    assert (first.data, first.image().shape) == (data, (48, 64, 3))


def test_the_end_of_a_thumbnail_is_not_that_of_the_image():
    data, thumbnail = make.encoded(make.picture()), make.encoded(make.picture(1, 16, 16))
    segment = b'\xff\xe1' + (2 + len(thumbnail)).to_bytes(2, 'big') + thumbnail
    whole = data[:2] + segment + data[2:]
    assert Frame(0, whole, 'jpeg', make.WIDTH, make.HEIGHT).image().shape == (48, 64, 3)
    with pytest.raises(SequenceError, match=r'truncated JPEG'):
        Frame(0, whole[:-40], 'jpeg', make.WIDTH, make.HEIGHT).image()


def test_changing_image_size_is_refused(tum):
    sorted((tum / 'rgb').iterdir())[2].write_bytes(make.encoded(make.picture(0, 32, 32)))
    with pytest.raises(SequenceError, match=r'32 x 32 pixels, the frames before it 64 x 48'):
        [frame.image() for frame in open_sequence(tum).frames()]


def test_raw_frames_become_bgr():
    image = make.picture()
    grey = np.ascontiguousarray(image[:, :, 1])
    for encoding, data, expected in (('bgr8', image, image),
                                     ('mono8', grey, np.stack([grey] * 3, axis=2))):
        frame = Frame(0, data.tobytes(), encoding, make.WIDTH, make.HEIGHT)
        np.testing.assert_array_equal(frame.image(), expected)
        assert np.abs(frame.compressed().image().astype(int) - expected).mean() < 4
        np.testing.assert_array_equal(frame.compressed('png').image(), expected)
    with pytest.raises(SequenceError, match=r'3072 bytes: expected 9216'):
        Frame(0, grey.tobytes(), 'bgr8', make.WIDTH, make.HEIGHT).image()


@pytest.mark.parametrize(('options', 'message'), [
    ({'topic': '/image'}, 'topic given'), ({'rate_hz': 5.0}, 'rate_hz given'),
    ({'ground_truth': 'gone.txt'}, 'gone.txt cannot be read'), ({'rate_hz': 0.0}, 'rate of 0')])
def test_options_that_do_not_apply_are_refused(tum, options, message):
    with pytest.raises(SequenceError, match=message):
        open_sequence(tum, **options)


def test_what_a_tum_folder_lacks_is_named(tum):
    (tum / 'rgb.txt').unlink()
    with pytest.raises(SequenceError, match=r'has a groundtruth\.txt but no rgb\.txt'):
        open_sequence(tum)
    assert open_sequence(tum / 'rgb').frame_count == 4


def test_what_is_no_sequence_is_refused(tmp_path):
    (tmp_path / 'empty').mkdir()
    (tmp_path / 'set.tgz').write_bytes(b'x')
    for name, message in (('gone', 'there is no sequence'), ('empty', 'holds no sequence'),
                          ('set.tgz', 'unpack an archive first')):
        with pytest.raises(SequenceError, match=message):
            open_sequence(tmp_path / name)
    (tmp_path / 'empty' / 'rgb.txt').write_text('# color images\n')
    with pytest.raises(SequenceError, match=r'no camera frame'):
        open_sequence(tmp_path / 'empty')


@pytest.mark.parametrize(('name', 'frames', 'size', 'poses'), [
    ('rgbd_dataset_freiburg1_rpy', 723, (640, 480), 2742),
    ('7scenes_redkitchen', 1000, (640, 480), 1000), ('flat_tour', 360, (640, 480), 360),
    ('gardenspoint_walking', 400, (960, 540), 400)])
def test_real_sequences(shared_data, name, frames, size, poses):
    sequence = open_sequence(shared_data(name))
    assert (sequence.frame_count, sequence.image_size) == (frames, size)
    assert len(sequence.trajectory) == poses
    assert {frame.image().shape for frame in sequence.frames(stride=frames // 4)} == {
        (size[1], size[0], 3)}
    assert sequence.trajectory.is_near(sequence.stamps_ns).mean() > 0.9


def test_names_in_a_list_may_hold_blanks(tum):
    for path in (tum / 'rgb').iterdir():
        path.rename(path.with_name(f'my # picture {path.name}'))
    rows = (tum / 'rgb.txt').read_text().replace(' rgb/', ' \t rgb/my picture ')
    (tum / 'rgb.txt').write_text(rows)
    with pytest.raises(SequenceError, match=r'line 3: there is no image .*/my picture 13'):
        open_sequence(tum)
    for path in (tum / 'rgb').iterdir():
        path.rename(path.with_name(path.name.replace('# ', '')))
    assert open_sequence(tum).frame_count == 4


def test_pictures_of_other_kinds_are_named(tmp_path):
    """Nobody shall believe that they were taken."""
    folder = images(tmp_path / 'pictures')
    for name in ('Image3.tif', 'Image4.TIF', 'Image5.bmp', '._Image6.bmp', 'archive.zip'):
        (folder / name).write_bytes(b'')
    sequence = open_sequence(folder)
    assert sequence.frame_count == 3
    assert sequence.notes == (f'{folder}: 1 .bmp, 2 .tif are not taken: convert them to PNG',)
    for path in folder.glob('*.png'):
        path.unlink()
    with pytest.raises(SequenceError, match=r'no sequence but 1 \.bmp, 2 \.tif, 1 \.zip \(conv'):
        open_sequence(folder)


def test_a_pipe_among_pictures_is_refused_at_once(tmp_path):
    folder = images(tmp_path / 'pictures')
    os.mkfifo(folder / 'Image9.png')
    with pytest.raises(SequenceError, match=r'Image9\.png is no regular file'):
        list(open_sequence(folder).frames())


def test_names_from_an_input_do_not_move_the_terminal():
    assert str(Coverage(3, 0, 0.0, 0.0, 'frame \x1b[2J of\n1')) == (
        'no ground truth: frame \\x1b[2J of\\n1')
