# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The vocabulary tree: distances, words, weights, training that repeats, damaged files."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.paths import model_path
from adversarial_lcd_ros.vision import vocabulary as module
from adversarial_lcd_ros.vision.vocabulary import Vocabulary, train_vocabulary


def random_descriptors(count, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (count, 32)).astype(np.uint8)


def around(centre, count, flipped, seed):
    """Return descriptors that differ from a centre in a few bits."""
    rng = np.random.default_rng(seed)
    bits = np.repeat(np.unpackbits(centre)[None], count, axis=0)
    for row in bits:
        row[rng.choice(256, flipped, replace=False)] ^= 1
    return np.packbits(bits, axis=1)


@pytest.fixture(scope='module')
def frames():
    """Ten frames that see eight well separated things, twenty times each."""
    centre = random_descriptors(8, seed=1)
    return [np.concatenate([around(c, 20, 6, 100 * frame + i) for i, c in enumerate(centre)])
            for frame in range(10)]


@pytest.fixture(scope='module')
def shipped():
    return Vocabulary.load(model_path('vocabulary.npz'))


def test_a_word_is_the_nearest_leaf_below_the_nearest_branch():
    zero, ones = np.zeros(32, np.uint8), np.full(32, 255, np.uint8)
    low, high = zero.copy(), ones.copy()
    low[:8], high[:8] = 255, 0
    tree = Vocabulary(np.stack([zero, ones, zero, low, ones, high]), np.ones(4, np.float32), 2, 2)
    assert tree.words(np.stack([zero, low, ones, high])).tolist() == [0, 1, 2, 3]


def test_of_equally_near_children_the_first_is_taken():
    same = np.repeat(random_descriptors(1), 4, axis=0)
    assert Vocabulary(same, np.ones(4, np.float32), 4, 1).words(same).tolist() == [0] * 4


def test_no_descriptors_have_no_words(shipped):
    words = shipped.words(np.zeros((0, 32), np.uint8))
    assert (words.dtype, words.shape) == (np.uint32, (0,))
    assert [len(part) for part in shipped.vector(words)] == [0, 0]


@settings(max_examples=30)
@given(st.lists(st.integers(0, 4095), min_size=1, max_size=60))
def test_weights_are_tf_idf_and_sum_to_one(shipped, words):
    words = np.array(words, np.uint32)
    word, weight = shipped.vector(words)
    assert (word.dtype, weight.dtype) == (np.uint32, np.float32)
    assert np.all(np.diff(word.astype(int)) > 0)
    expected = np.array([(words == w).sum() for w in word]) * shipped.idf[word]
    np.testing.assert_allclose(weight, expected / max(expected.sum(), 1e-9), rtol=1e-5)


def test_words_without_weight_are_left_out():
    idf = np.array([0, 2, 1], np.float32)
    word, weight = Vocabulary(random_descriptors(3), idf, 3, 1).vector(
        np.array([0, 2, 1, 2, 0], np.uint32))
    assert word.tolist() == [1, 2]
    assert weight.tolist() == [0.5, 0.5]


def test_training_gives_each_thing_a_word_of_its_own(frames):
    tree = train_vocabulary(frames, branching=8, depth=1)
    words = tree.words(frames[0]).reshape(8, 20)
    assert (words == words[:, :1]).all()
    assert len(set(words[:, 0])) == 8


def test_training_weighs_words_by_the_frames_that_have_them(frames):
    half = [frame[:80] if number % 2 else frame for number, frame in enumerate(frames)]
    tree = train_vocabulary(half, branching=8, depth=1)
    words = tree.words(frames[0])
    np.testing.assert_allclose(tree.idf[words[:80]], 0, atol=1e-6)
    np.testing.assert_allclose(tree.idf[words[80:]], np.log(2), rtol=1e-6)


def test_training_repeats_and_hangs_on_its_seed(frames, tmp_path):
    saved = []
    for name, seed in (('a', 3), ('b', 3), ('c', 4)):
        train_vocabulary(frames, 4, 2, seed).save(tmp_path / f'{name}.npz')
        saved.append((tmp_path / f'{name}.npz').read_bytes())
    assert saved[0] == saved[1] != saved[2]


def test_training_does_not_hang_on_how_much_is_compared_at_a_time(frames, monkeypatch):
    whole = train_vocabulary(frames, 4, 2)
    monkeypatch.setattr(module, '_CHUNK', 7)
    np.testing.assert_array_equal(train_vocabulary(frames, 4, 2).centre, whole.centre)


def test_words_of_training_descriptors_are_those_they_were_clustered_to(frames):
    tree = train_vocabulary(frames, 4, 2)
    having = np.zeros(16)
    for frame in frames:
        having[np.unique(tree.words(frame))] += 1
    expected = np.where(having > 0, np.log(10 / np.maximum(having, 1)), 0)
    np.testing.assert_allclose(tree.idf, expected, rtol=1e-6)


def test_centres_are_the_majority_of_their_members():
    frames = [np.concatenate([around(np.zeros(32, np.uint8), 200, 20, 0),
                              around(np.full(32, 255, np.uint8), 200, 20, 1)])]
    tree = train_vocabulary(frames, branching=2, depth=1)
    assert sorted(tree.centre.sum(axis=1).tolist()) == [0, 32 * 255]


def test_too_few_different_descriptors_leave_words_unused():
    few = np.repeat(random_descriptors(3), 10, axis=0)
    tree = train_vocabulary([few, few[:10]], branching=4, depth=2)
    assert len(np.unique(tree.words(few))) == 3
    assert np.count_nonzero(tree.idf) == 2


@pytest.mark.parametrize('frames', [[], [np.zeros((0, 32), np.uint8)], [random_descriptors(63)]])
def test_training_needs_a_descriptor_for_every_word(frames):
    with pytest.raises(ModelError, match='descriptors for 64 words'):
        train_vocabulary(frames, branching=8, depth=2)


def test_a_saved_vocabulary_loads_as_it_was(frames, tmp_path):
    tree = train_vocabulary(frames, 4, 2)
    tree.save(tmp_path / 'v.npz')
    again = Vocabulary.load(tmp_path / 'v.npz')
    assert (again.branching, again.depth) == (4, 2)
    np.testing.assert_array_equal(again.centre, tree.centre)
    np.testing.assert_array_equal(again.idf, tree.idf)


@pytest.mark.parametrize('damage', ['missing', 'empty', 'text', 'cut', 'another array', 'pickle'])
def test_a_file_that_is_no_vocabulary_is_refused(damage, tmp_path):
    path = tmp_path / 'v.npz'
    if damage in ('empty', 'text'):
        path.write_bytes(b'' if damage == 'empty' else b'words words words')
    elif damage == 'cut':
        path.write_bytes(model_path('vocabulary.npz').read_bytes()[:5000])
    elif damage == 'another array':
        np.savez(path, centre=np.zeros((2, 32), np.uint8))
    elif damage == 'pickle':
        np.savez(path, centre=np.array([{}], object), idf=np.zeros(2), shape=np.array([2, 1]))
    with pytest.raises(ModelError, match='adversarial-lcd train'):
        Vocabulary.load(path)


@pytest.mark.parametrize(('centre', 'idf'), [
    (np.zeros((5, 32), np.uint8), np.zeros(4, np.float32)),
    (np.zeros((6, 32), np.int64), np.zeros(4, np.float32)),
    (np.zeros((6, 32), np.uint8), np.zeros(3, np.float32)),
    (np.zeros((6, 32), np.uint8), np.array([0, 1, np.nan, 0], np.float32)),
    (np.zeros((6, 32), np.uint8), np.array([0, 1, -1, 0], np.float32))])
def test_arrays_that_make_no_tree_are_refused(centre, idf):
    with pytest.raises(ModelError, match='vocabulary of'):
        Vocabulary(centre, idf, 2, 2)


def test_the_shipped_vocabulary_is_a_small_file_of_4096_weighted_words(shipped):
    assert model_path('vocabulary.npz').stat().st_size < 1_000_000
    assert (shipped.branching, shipped.depth) == (16, 3)
    assert np.count_nonzero(shipped.idf) > 4000
