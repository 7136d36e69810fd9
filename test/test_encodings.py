# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pixels of camera messages: every encoding of cv_bridge, padding, byte order, and refusals."""

from types import SimpleNamespace

import bag_factory as make
import cv2
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.config import ReplayConfig
from adversarial_lcd_ros.errors import CodecError, SequenceError
from adversarial_lcd_ros.sequences import import_sequence, open_sequence
from adversarial_lcd_ros.sequences.encodings import KNOWN, message_pixels
from adversarial_lcd_ros.sequences.replay import Replay

# Mild colours: cameras halve the colour and not the brightness.
COLOUR = make.picture(3) // 3 + 80
GREY = cv2.cvtColor(COLOUR, cv2.COLOR_BGR2GRAY)
BAYER = {'rggb': ('RG', 'GB'), 'bggr': ('BG', 'GR'), 'gbrg': ('GB', 'RG'), 'grbg': ('GR', 'BG')}


def yuv(image):
    """Return brightness (h, w) and colour (h, w, 2) of a picture, 0 to 255, BT.601."""
    planes = cv2.cvtColor(image, cv2.COLOR_BGR2YUV_I420)
    height, width = image.shape[:2]
    quarter = planes[height:].reshape(2, height // 2, width // 2)
    return planes[:height], np.dstack([cv2.resize(plane, (width, height)) for plane in quarter])


def packed(name):
    """Return the rows of the picture in an encoding, and what they show."""
    base = name.removesuffix('16').removesuffix('8')
    if base in ('yuv422', 'uyvy', 'yuv422_yuy2', 'yuyv'):
        bright, colour = yuv(COLOUR)
        rows = np.empty((*GREY.shape, 2), np.uint8)
        first = int(base in ('yuv422', 'uyvy'))
        rows[:, :, first] = bright
        rows[:, 0::2, 1 - first] = colour[:, 0::2, 0]
        rows[:, 1::2, 1 - first] = colour[:, 0::2, 1]
        return rows.reshape(len(rows), -1), COLOUR
    if base.startswith('nv'):
        bright, colour = yuv(COLOUR)
        colour = colour if base == 'nv24' else colour[::2, ::2]
        colour = colour[:, :, ::-1] if base == 'nv21' else colour
        return np.vstack([bright, colour.reshape(-1, bright.shape[1])]), COLOUR
    if base.startswith('bayer'):
        rows = np.empty_like(GREY)
        for row, letters in enumerate(BAYER[base[-4:]]):
            for column, letter in enumerate(letters):
                rows[row::2, column::2] = COLOUR[row::2, column::2, 'BGR'.index(letter)]
    else:
        rows = {'mono': GREY, '8UC1': GREY, 'rgb': COLOUR[:, :, ::-1],
                'rgba': np.dstack([COLOUR[:, :, ::-1], GREY]),
                'bgra': np.dstack([COLOUR, GREY]), '8UC4': np.dstack([COLOUR, GREY]),
                '16UC4': np.dstack([COLOUR, GREY])}.get(base, COLOUR)
    shown = GREY if rows is GREY and not base.startswith('bayer') else COLOUR
    return rows.reshape(len(rows), -1), shown


def message(name, padding=0, is_bigendian=False):
    rows, shown = packed(name)
    if name.endswith('16') or name.startswith('16'):
        rows = (rows.astype('>u2' if is_bigendian else '<u2') * 257).astype(
            '>u2' if is_bigendian else '<u2')
    wire = np.pad(np.ascontiguousarray(rows).view(np.uint8), ((0, 0), (0, padding)),
                  constant_values=77)
    return SimpleNamespace(width=make.WIDTH, height=make.HEIGHT, encoding=name,
                           step=wire.shape[1], is_bigendian=int(is_bigendian),
                           data=wire.ravel()), shown


@settings(max_examples=15, deadline=None)
@given(padding=st.integers(0, 40), is_bigendian=st.booleans())
@pytest.mark.parametrize('name', KNOWN)
def test_every_encoding_shows_the_same_picture(name, padding, is_bigendian):
    sent, shown = message(name, padding, is_bigendian)
    pixels = message_pixels(sent)
    assert (pixels.shape, pixels.dtype) == (shown.shape, np.uint8)
    # Colour at half the width, or one colour a pixel, costs detail; another order of channels or
    # bytes would cost far more.
    exact = not name.startswith(('bayer', 'yuv', 'uyvy', 'yuyv', 'nv'))
    error = np.abs(pixels.astype(int) - shown).mean()
    assert error < (1e-9 if exact else 4)
    # The last row may lack its padding.
    sent.data = sent.data[:len(sent.data) - padding]
    np.testing.assert_array_equal(message_pixels(sent), pixels)
    sent.data = sent.data[:-1]
    with pytest.raises(CodecError, match=r'is truncated'):
        message_pixels(sent)


@pytest.mark.parametrize(('name', 'text'), [
    ('16UC1', r"'16UC1' is depth"), ('32FC1', r'is depth'), ('8UC2', r"'8UC2': expected one of"),
    ('rgb24', r"'rgb24': expected one of mono8, bgr8"), ('', r"'': expected one of")])
def test_other_encodings_are_refused_by_name(name, text):
    with pytest.raises(CodecError, match=text):
        message_pixels(SimpleNamespace(width=2, height=2, encoding=name, step=9, data=b'', ))


@pytest.mark.parametrize('size', [(0, 5), (2**20, 2**20)])
def test_sizes_that_no_camera_has_are_refused(size):
    with pytest.raises(CodecError, match=r'expected 1 to'):
        message_pixels(SimpleNamespace(width=size[0], height=size[1], encoding='mono8', step=1,
                                       data=b''))


def test_odd_sizes_of_halved_colour_are_refused():
    with pytest.raises(CodecError, match=r'nv12 image of 3 x 3 pixels'):
        message_pixels(SimpleNamespace(width=3, height=3, encoding='nv12', step=3,
                                       is_bigendian=0, data=bytes(15)))


@pytest.mark.parametrize('name', ['bgra8', 'mono16', 'bayer_rggb8', 'yuv422_yuy2', '8UC3'])
def test_a_bag_in_any_encoding_is_read(tmp_path, name):
    rows = make.raw_rows()
    sent, shown = message(name, padding=5)
    for _, _, _, image in rows:
        image.encoding, image.step, image.data = name, sent.step, sent.data
    frame = next(open_sequence(make.write_ros2(tmp_path / 'bag', rows)).frames())
    assert np.abs(frame.image().astype(int) - (shown if shown.ndim == 3 else shown[..., None])
                  ).mean() < 4


DEPTH_PNG = make.encoded(np.full((make.HEIGHT, make.WIDTH), 1500, np.uint16), '.png')


def depth_rows(topic='/depth/compressed', text='16UC1; png compressed '):
    return [(topic, make.COMPRESSED, stamp, make.ROS2.compressed(stamp, DEPTH_PNG, text))
            for stamp in make.stamps()]


@pytest.mark.parametrize('text', ['16UC1; png compressed ', '16UC1; compressedDepth png',
                                  '32FC1; compressedDepth png', 'png', ''])
def test_compressed_depth_is_no_camera(tmp_path, text):
    depth = depth_rows(text=text)
    with pytest.raises(SequenceError, match=r'no camera images .*/depth/compressed'):
        open_sequence(make.write_ros2(tmp_path / 'depth', depth))
    both = make.write_ros2(tmp_path / 'both', depth + make.raw_rows())
    assert open_sequence(both).frame_count == 4
    assert Replay(both, ReplayConfig()).frame_topics == ('/camera/image_raw',)
    with pytest.raises(SequenceError, match=r'neither images of a camera .*/depth/compressed'):
        Replay(tmp_path / 'depth', ReplayConfig())
    with pytest.raises(SequenceError, match=r'depth'):
        open_sequence(both, topic='/depth/compressed')


def test_sixteen_bits_of_grey_are_a_camera_where_they_say_so(tmp_path):
    bag = make.write_ros2(tmp_path / 'bag', depth_rows(text='mono16; png compressed '))
    assert open_sequence(bag).frame_count == 4


def test_a_mosaic_compressed_as_it_is_is_refused(tmp_path):
    rows = make.jpeg_rows()
    for _, _, _, message in rows:
        message.format = 'bayer_rggb8; png compressed '
    with pytest.raises(SequenceError, match=r'is a mosaic'):
        open_sequence(make.write_ros2(tmp_path / 'bag', rows), topic='/image/compressed')
    for _, _, _, message in rows:
        message.format = 'bayer_rggb8; jpeg compressed bgr8'
    assert open_sequence(make.write_ros2(tmp_path / 'colour', rows)).frame_count == 4


def test_webp_stays_what_it_is(tmp_path):
    data = make.encoded(COLOUR, '.webp')
    rows = [('/image', make.COMPRESSED, stamp, make.ROS2.compressed(stamp, data, 'webp'))
            for stamp in make.stamps()]
    frame = next(open_sequence(make.write_ros2(tmp_path / 'bag', rows)).frames())
    assert (frame.encoding, frame.data) == ('webp', data)
    assert np.abs(frame.image().astype(int) - COLOUR).mean() < 8
    rows[0] = (*rows[0][:3], make.ROS2.compressed(rows[0][2], data[:-20], 'webp'))
    with pytest.raises(SequenceError, match=r'truncated WEBP'):
        open_sequence(make.write_ros2(tmp_path / 'cut', rows))


def test_a_video_stream_is_named(tmp_path):
    rows = [('/image', make.COMPRESSED, stamp, make.ROS2.compressed(stamp, b'\0\0\0\1g', 'h264'))
            for stamp in make.stamps()]
    with pytest.raises(SequenceError, match=r"format 'h264'.* neither a JPEG"):
        open_sequence(make.write_ros2(tmp_path / 'bag', rows))


def test_sixteen_bits_of_grey_are_a_camera_in_the_imported_bag_too(tmp_path):
    """There is no room for mono16 in its format: as 16 bits they would be taken for depth."""
    grey = (cv2.cvtColor(make.picture(1), cv2.COLOR_BGR2GRAY) * np.uint16(257))
    rows = [('/ir', make.COMPRESSED, stamp, make.ROS2.compressed(
        stamp, make.encoded(grey, '.png'), 'mono16; png compressed ')) for stamp in make.stamps()]
    import_sequence(make.write_ros2(tmp_path / 'bag', rows), tmp_path / 'imported', raw_as='png')
    frame = next(open_sequence(tmp_path / 'imported').frames())
    assert np.abs(frame.image()[:, :, 0].astype(int) - grey // 257).max() <= 1
