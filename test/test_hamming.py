# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compiled Hamming distances, against unpacked bits."""

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
import numpy as np

from adversarial_lcd_ros.compiled.hamming import lanes, mutual, nearest


def descriptors(least):
    # Few distinct bytes: equal distances are common, and ties have a rule.
    return hnp.arrays(np.uint8, st.tuples(st.integers(least, 12), st.just(32)),
                      elements=st.sampled_from([0, 1, 3, 128, 255]))


def distances(a, b):
    return np.unpackbits(a[:, None] ^ b[None], axis=2).sum(axis=2)


@given(descriptors(0), descriptors(1))
def test_the_nearest_is_the_first_with_fewest_differing_bits(a, b):
    index, distance = nearest(lanes(a), lanes(b))
    expected = distances(a, b)
    assert index.tolist() == expected.argmin(axis=1).tolist()
    assert distance.tolist() == expected.min(axis=1).tolist()


@given(descriptors(1), descriptors(1), st.integers(0, 256))
def test_mutual_pairs_are_nearest_both_ways_and_near_enough(a, b, farthest):
    first, second, distance = mutual(lanes(a), lanes(b), farthest)
    between = distances(a, b)
    forward, backward = between.argmin(axis=1), between.argmin(axis=0)
    expected = [(i, int(forward[i])) for i in range(len(a))
                if backward[forward[i]] == i and between[i, forward[i]] <= farthest]
    assert list(zip(first.tolist(), second.tolist(), strict=True)) == expected
    assert distance.tolist() == between[first, second].tolist()


def test_opposite_descriptors_differ_in_every_bit():
    zero, one = np.zeros((1, 32), np.uint8), np.full((1, 32), 255, np.uint8)
    assert nearest(lanes(zero), lanes(one))[1].tolist() == [256]
    assert [len(part) for part in mutual(lanes(zero), lanes(one), 256)] == [1, 1, 1]


def test_nothing_has_no_partner():
    some, none = np.zeros((2, 32), np.uint8), np.zeros((0, 32), np.uint8)
    for a, b in ((some, none), (none, some), (none, none)):
        assert [len(part) for part in mutual(lanes(a), lanes(b), 256)] == [0, 0, 0]
