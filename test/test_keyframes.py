# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Retrieval of keyframes: exactly what scoring all of them and sorting gives."""

from dataclasses import replace

from graph_factory import make_graph
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.keyframes import blocks
from adversarial_lcd_ros.keyframes import database as keyframes
from adversarial_lcd_ros.keyframes.database import Database

PLAIN = make_graph()


def with_words(words):
    """Return a graph with a vBoW vector from a mapping of words to weights."""
    word = np.array(sorted(words), np.uint32)
    weight = np.array([words[int(key)] for key in word], np.float32)
    return replace(PLAIN, word=word, word_weight=weight)


# Multiples of 2^-20: their sums are the same in any order. Few words and few weights, so that
# scores tie; words of any size, more of them than columns, also with weights beyond the levels.
FEW = st.dictionaries(st.integers(0, 6), st.sampled_from([0.0, 2.0 ** -13, 0.25, 2.0 ** -20]),
                      max_size=6)
ANY = st.dictionaries(st.integers(0, 2**32 - 1) | st.integers(0, 40),
                      (st.integers(0, 2**21) | st.integers(0, 2**8)).map(lambda k: k * 2.0 ** -20),
                      max_size=40)
VECTORS = (st.lists(words.map(with_words), min_size=1, max_size=12) for words in (FEW, ANY))


def score_of(a, b):
    """Return the sum of the smaller weights."""
    weight = dict(zip(a.word.tolist(), a.word_weight.tolist(), strict=True))
    return sum((min(value, weight.get(word, 0.0)) for word, value in
                zip(b.word.tolist(), b.word_weight.tolist(), strict=True)), 0.0)


def by_sorting(stored, query, admissible, count, window):
    """Return what retrieval shall give, by scoring every keyframe and sorting."""
    score = np.array([score_of(query, graph) for graph in stored])
    free, chosen = admissible.copy(), []
    for index in np.argsort(-score, kind='stable'):
        if free[index] and len(chosen) < count:
            chosen.append(int(index))
            free[max(0, index - window):index + window + 1] = False
    return chosen, score[chosen].tolist()


def test_a_column_in_common_is_no_word_in_common(monkeypatch):
    monkeypatch.setattr(blocks, 'COLUMNS', 2)
    database = Database()
    for words in ({0: 0.5}, {1: 0.5}, {2: 0.5, 3: 0.5}):
        database.add(with_words(words))
    # Words 1 and 3 share a column; of two keyframes with score 0 the older one comes first.
    assert database.retrieve(with_words({3: 0.5}), np.array([True, True, False]), 1) == (
        [0], [0.0])


@given(st.one_of(*VECTORS), st.integers(1, 4), st.integers(0, 2), st.integers(1, 4),
       st.sampled_from([5, 4096]), st.randoms())
@settings(deadline=None, max_examples=60)
def test_retrieval_is_what_sorting_all_scores_gives(
        graphs, count, window, least, columns, random):
    *stored, query = graphs
    admissible = np.array([random.random() < 0.7 for _ in stored], bool)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(blocks, 'COLUMNS', columns)
        for module in (blocks, keyframes):
            patch.setattr(module, 'KEYFRAMES', 3)
        patch.setattr(keyframes, 'LEAST_SCORED', least)
        database = Database()
        for graph in stored:
            database.add(graph)
        assert database.retrieve(query, admissible, count, window) == by_sorting(
            stored, query, admissible, count, window)
        assert database.scores(query).tolist() == [score_of(query, graph) for graph in stored]


def test_an_empty_database_gives_nothing():
    assert Database().retrieve(PLAIN, np.zeros(0, bool), 5) == ([], [])


def test_what_a_keyframe_takes_does_not_grow_with_their_number():
    database = Database()
    for _ in range(2):
        database.add(PLAIN)
    empty = database.nbytes
    for _ in range(1000):
        database.add(PLAIN)
    assert database.nbytes - empty <= 1000 * 2 * 8 * len(PLAIN.word)
