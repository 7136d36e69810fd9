# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ORB features: what is found, how it is spread, that it repeats, what is refused."""

import cv2
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.errors import GraphError
from adversarial_lcd_ros.vision.features import (
    GRID_COLUMNS,
    GRID_ROWS,
    FeatureExtractor,
    Features,
    spread,
    to_grey,
)


def texture(height=240, width=320, seed=0):
    coarse = np.random.default_rng(seed).integers(0, 256, (height // 8, width // 8))
    return cv2.resize(coarse.astype(np.uint8), (width, height), interpolation=cv2.INTER_CUBIC)


def features_at(position):
    """Return features at the given places, strongest first."""
    position = np.array(position, np.float32).reshape(-1, 2)
    count = len(position)
    return Features(position, np.full(count, 31, np.float32),
                    np.arange(count, 0, -1, dtype=np.float32),
                    np.zeros((count, 32), np.uint8))


def cells_of(features, width, height):
    column, row = (np.floor(features.position / (width, height) * (GRID_COLUMNS, GRID_ROWS))
                   .astype(int).T)
    return row * GRID_COLUMNS + column


def test_features_come_strongest_first_with_their_descriptors():
    grey = texture()
    found = FeatureExtractor(200, 10).extract(grey)
    assert 100 < len(found) <= 200
    assert np.all(np.diff(found.score) <= 0)
    assert (found.position.dtype, found.size.dtype, found.score.dtype, found.descriptor.dtype
            ) == (np.float32, np.float32, np.float32, np.uint8)
    orb = cv2.ORB.create(nfeatures=200, fastThreshold=10)
    keypoints, descriptors = orb.detectAndCompute(grey, None)
    by_place = {(*point.pt, point.size): row.tolist()
                for point, row in zip(keypoints, descriptors, strict=True)}
    for place, size, row in zip(found.position.tolist(), found.size.tolist(), found.descriptor,
                                strict=True):
        assert by_place[(*place, size)] == row.tolist()


def test_the_same_image_gives_the_same_bytes():
    one, other = (FeatureExtractor(500, 10).extract(texture()) for _ in range(2))
    for name in ('position', 'size', 'score', 'descriptor'):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()


@pytest.mark.parametrize('shape', [(1, 1), (1, 500), (31, 31), (62, 300), (480, 640)])
def test_images_too_small_or_without_texture_have_no_features(shape):
    found = FeatureExtractor(100, 10).extract(np.full(shape, 128, np.uint8))
    assert (len(found), found.position.shape, found.descriptor.shape) == (0, (0, 2), (0, 32))


def test_cells_take_turns():
    # Three in the first cell, stronger than the one in the last cell.
    features = features_at([(1, 1), (2, 2), (3, 3), (639, 479)])
    assert spread(features, 3, 640, 480).tolist() == [0, 3, 1]


@settings(max_examples=50)
@given(st.lists(st.tuples(st.floats(0, 640, width=32), st.floats(0, 480, width=32)), max_size=80),
       st.integers(1, 60))
def test_spreading_is_fair_and_keeps_the_strongest_of_a_cell(places, count):
    features = features_at([(min(x, 639.9), min(y, 479.9)) for x, y in places])
    chosen = spread(features, count, 640, 480)
    assert len(chosen) == len(set(chosen.tolist())) == min(count, len(places))
    cells = cells_of(features, 640, 480)
    taken = {cell: np.sort(chosen[cells[chosen] == cell]) for cell in set(cells.tolist())}
    for cell, kept in taken.items():
        here = np.flatnonzero(cells == cell)
        assert kept.tolist() == here[:len(kept)].tolist()
        if len(kept) < len(here):
            assert all(len(kept) >= len(other) - 1 for other in taken.values())


def test_a_feature_on_the_far_border_belongs_to_the_last_cell():
    assert spread(features_at([(640, 480)]), 5, 640, 480).tolist() == [0]


def test_real_frames_are_covered_by_the_chosen_features(shared_data):
    image = cv2.imread(str(sorted(shared_data('flat_tour').glob('rgb/*.jpg'))[100]))
    features = FeatureExtractor(1500, 10).extract(to_grey(image))
    chosen = features[spread(features, 300, 640, 480)]
    strongest = features[np.arange(300)]
    assert len(chosen) == 300
    assert (len(np.unique(cells_of(chosen, 640, 480)))
            == len(np.unique(cells_of(features, 640, 480)))
            > len(np.unique(cells_of(strongest, 640, 480))))


def test_grey_stays_and_colour_becomes_grey():
    grey = texture()
    assert to_grey(grey) is grey
    np.testing.assert_array_equal(to_grey(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)), grey)


@pytest.mark.parametrize('image', [
    np.zeros((0, 5), np.uint8), np.zeros((5, 0, 3), np.uint8), np.zeros((5, 5), np.float32),
    np.zeros((5, 5, 3), np.uint16), np.zeros((5, 5, 4), np.uint8), np.zeros((5, 5, 1), np.uint8),
    np.zeros(5, np.uint8), np.zeros((2, 5, 5, 3), np.uint8)])
def test_what_is_no_image_is_refused(image):
    with pytest.raises(GraphError, match='expected uint8'):
        to_grey(image)
