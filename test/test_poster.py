# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The poster: textures, where it lies, what it leaves alone, and the same over ROS."""

import cv2
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.attack.images.poster import (
    Poster,
    frontal_corners,
    make_texture,
    paste,
    swayed,
)
from adversarial_lcd_ros.attack.images.posting import Posting, spans_in
from adversarial_lcd_ros.config import POSTERS, ReplayConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.messages.codec import typestore
from adversarial_lcd_ros.sequences.bagfile import COMPRESSED_IMAGE, IMAGE
from adversarial_lcd_ros.sequences.encodings import message_pixels
from adversarial_lcd_ros.sequences.frame import decode

KINDS = POSTERS[1:]
GREY = np.full((120, 160, 3), 128, np.uint8)
SECOND = 10**9


@pytest.mark.parametrize('kind', KINDS)
def test_a_texture_is_repeatable_and_has_contrast(kind):
    texture = make_texture(kind, 1)
    np.testing.assert_array_equal(texture, make_texture(kind, 1))
    assert texture.std() > 50
    assert (kind == 'chessboard') == np.array_equal(texture, make_texture(kind, 2))


def test_none_has_no_texture():
    with pytest.raises(ConfigError, match='has no texture'):
        make_texture('none', 1)


@given(st.integers(40, 900), st.integers(40, 900), st.floats(0.001, 1.0), st.integers(0, 99))
def test_a_frontal_poster_is_in_the_frame_and_of_its_size(width, height, share, seed):
    corners = frontal_corners(width, height, share, np.random.default_rng(seed))
    assert (corners >= -1e-6).all()
    assert (corners <= np.array([width, height]) + 1e-6).all()
    area = cv2.contourArea(corners.astype(np.float32))
    most = min(share * width * height, (min(width, height) / 1.2) ** 2)
    assert 0.5 * most <= area <= 1.5 * most


@settings(max_examples=20)
@given(st.floats(0.01, 0.5), st.integers(0, 99))
def test_nothing_beside_the_poster_changes(share, seed):
    rng = np.random.default_rng(seed)
    corners = frontal_corners(160, 120, share, rng)
    pasted = paste(GREY, make_texture('cells', seed), corners, rng)
    changed = (pasted != GREY).any(axis=2)
    outside = np.ones_like(changed, np.uint8)
    cv2.fillConvexPoly(outside, np.rint(corners).astype(np.int32), 0)
    inside = cv2.erode(1 - outside, np.ones((5, 5), np.uint8)).astype(bool)
    far = cv2.erode(outside, np.ones((5, 5), np.uint8)).astype(bool)
    assert not changed[far].any()
    assert not inside.any() or changed[inside].mean() > 0.9


def test_grey_frames_stay_grey_and_corners_may_lie_outside():
    rng = np.random.default_rng(1)
    corners = np.array([(-50, -50), (60, -20), (80, 90), (-40, 70)], float)
    assert paste(GREY[:, :, 0], make_texture('noise', 1), corners, rng).shape == (120, 160)
    assert np.abs(swayed(corners, rng) - corners).max() < 5


@pytest.mark.parametrize('text', ['5', '5:', '7:5', 'a:b', '1:2:3', '-1:2', '0:inf'])
def test_spans_that_are_none_are_refused(text):
    with pytest.raises(ConfigError, match='FROM:TO'):
        spans_in(text)


def test_a_poster_needs_a_time():
    assert spans_in('1:2, 3.5:4,') == [(1.0, 2.0), (3.5, 4.0)]
    with pytest.raises(ConfigError, match='poster_spans'):
        Posting(ReplayConfig(poster='cells'), 0)


def message(kind, stamp_ns):
    types = typestore().types
    header = types['std_msgs/msg/Header'](
        types['builtin_interfaces/msg/Time'](*divmod(stamp_ns, SECOND)), 'camera')
    made = (types[COMPRESSED_IMAGE](header, 'jpeg', cv2.imencode('.jpg', GREY)[1].ravel())
            if kind == COMPRESSED_IMAGE else
            types[IMAGE](header, 120, 160, 'bgr8', 0, 480, GREY.ravel()))
    return bytes(typestore().serialize_cdr(made, kind))


def pixels_of(kind, wire):
    made = typestore().deserialize_cdr(wire, kind)
    return (message_pixels(made) if kind == IMAGE else decode(made.data.tobytes(), 'frame'))


@pytest.mark.parametrize('kind', [IMAGE, COMPRESSED_IMAGE])
def test_messages_of_the_spans_hold_what_is_pasted_and_others_stay(kind):
    posting = Posting(ReplayConfig(poster='cells', poster_spans='1:2, 5:6'), 100 * SECOND)
    for offset, seen in ((0, False), (1, True), (2, False), (5, True), (6, False)):
        stamp_ns = (100 + offset) * SECOND
        before = message(kind, stamp_ns)
        after = posting.on_message(kind, stamp_ns, before)
        assert (after != before) == seen
        np.testing.assert_array_equal(
            pixels_of(kind, after), posting.on_pixels(pixels_of(kind, before), stamp_ns))


def test_two_sheets_cover_the_share_together_and_hang_apart():
    one, two = (Posting(ReplayConfig(poster='cells', poster_share=0.1, poster_sheets=sheets,
                                     poster_spans='0:9'), 0).on_pixels(
        np.full((480, 640, 3), 128, np.uint8), SECOND) for sheets in (1, 2))
    for pixels, pieces in ((one, 1), (two, 2)):
        changed = (pixels != 128).any(axis=2).astype(np.uint8)
        assert 0.07 < changed.mean() < 0.13
        _, _, found, _ = cv2.connectedComponentsWithStats(cv2.morphologyEx(
            changed, cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8)))
        assert (found[1:, cv2.CC_STAT_AREA] > 0.02 * changed.size).sum() == pieces
    with pytest.raises(ConfigError, match=r'overlap: expected a share of at most 0\.25'):
        Poster('cells', 0.26, 1, sheets=2)


def test_without_a_poster_every_message_stays():
    posting = Posting(ReplayConfig(poster_spans='0:9'), 0)
    wire = message(IMAGE, SECOND)
    assert posting.on_message(IMAGE, SECOND, wire) is wire
