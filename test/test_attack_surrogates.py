# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Surrogates: each learns which flips gain, by soft answers and by hard ones."""

from dataclasses import replace

from graph_factory import flips_of, graphs, make_graph
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from sklearn.svm import SVC

from adversarial_lcd_ros.attack.attacker import Attacker
from adversarial_lcd_ros.attack.surrogate_data import SurrogateData
from adversarial_lcd_ros.attack.surrogates import SURROGATES, Kernel, make_surrogate
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.lcd.decision import probability
from adversarial_lcd_ros.messages.types import LcdAnswer
from adversarial_lcd_ros.weisfeiler_lehman.continuous import (
    concatenated_features,
    flip_features,
    node_features,
)

GRAPH = make_graph(60, [*((k, (k + 1) % 60) for k in range(60)), *((0, k) for k in range(2, 30))])

LEARNERS = [name for name in SURROGATES if name != 'none']


def blobs(seed=0, rows=80, hard=False):
    """Return features of flips that gain and that do not; hard answers gain 2 or nothing."""
    rng = np.random.default_rng(seed)
    gains = rng.random(rows) < 0.4
    features = rng.normal(size=(rows, 4)) + 2 * gains[:, None]
    return features, np.where(gains, 2.0, 0.0) if hard else np.where(gains, 1e-3, -1e-4)


def test_every_choice_has_a_surrogate():
    assert make_surrogate('none') is None
    with pytest.raises(ConfigError, match='no surrogate'):
        make_surrogate('forest')


@pytest.mark.parametrize('hard', [False, True])
@pytest.mark.parametrize('name', LEARNERS)
def test_a_surrogate_ranks_flips_that_gain_first(name, hard):
    features, gain = blobs(seed=1, hard=hard)
    surrogate, again = make_surrogate(name), make_surrogate(name)
    assert surrogate.fit(*blobs(hard=hard))
    assert again.fit(*blobs(hard=hard))
    score = surrogate.predict(features)
    assert score.tolist() == again.predict(features).tolist()
    gaining = gain > 0
    assert np.mean(gaining[np.argsort(-score)[:gaining.sum()]]) > 0.9
    assert len(np.unique(score)) == len(score)


@pytest.mark.parametrize('name', LEARNERS)
def test_a_surrogate_declines_data_that_do_not_suffice(name):
    features, gain = blobs()
    assert not make_surrogate(name).fit(features[:9], gain[:9])
    assert not make_surrogate(name).fit(features, np.zeros_like(gain))


def test_gamma_of_the_paper_and_of_scikit_learn_are_told_apart():
    scaled = np.random.default_rng(0).normal(size=(500, 6))
    scaled = (scaled - scaled.mean(axis=0)) / scaled.std(axis=0)
    assert Kernel('paper').gamma(scaled) == pytest.approx(1 / 12)
    assert Kernel('paper', sigma=0.5).gamma(scaled) == pytest.approx(2)
    sklearn = SVC(gamma='scale').fit(scaled, scaled[:, 0] > 0)._gamma
    assert Kernel('scale').gamma(scaled) == pytest.approx(sklearn)
    assert Kernel('scale', sigma=0.5).gamma(scaled) == pytest.approx(1 / 6)


@pytest.mark.parametrize('name', ['svm_rbf', 'svm_poly', 'svr'])
def test_the_width_of_the_kernel_reaches_the_model(name):
    def predictions(kernel):
        surrogate = make_surrogate(name, kernel)
        surrogate.fit(*blobs())
        return surrogate.predict(blobs(seed=1)[0])
    assert not np.allclose(predictions(Kernel('paper')), predictions(Kernel('scale')))
    assert not np.allclose(predictions(Kernel('paper')), predictions(Kernel('paper', 9.0)))


@given(graphs(), st.integers(0, 2**16), st.integers(1, 3))
@settings(max_examples=30)
def test_node_by_node_features_are_the_difference_that_a_flip_makes(graph, seed, iterations):
    x = node_features(graph)
    pairs = flips_of(graph, np.random.default_rng(seed), 5)
    found = flip_features(graph, x, pairs, iterations, pooled=False)
    clean = concatenated_features(graph, x, iterations)
    assert found.shape == (len(pairs), len(clean))
    for pair, row in zip(pairs, found, strict=True):
        change = concatenated_features(graph.flip(pair), x, iterations) - clean
        assert row == pytest.approx(change, abs=1e-9)


class Judge:
    """Answers softly or hardly; every edge that joins node 0 counts for a loop."""

    def __init__(self, soft, start):
        self.soft, self.start, self.asked = soft, start, []

    def __call__(self, graph):
        self.asked.append(graph)
        logit = 0.3 * np.count_nonzero(graph.edge == 0) - self.start
        return LcdAnswer(0, logit >= 0, self.soft,
                         probability(logit) if self.soft else float(logit >= 0))


@pytest.mark.parametrize('soft', [True, False])
@pytest.mark.parametrize('name', list(SURROGATES))
def test_each_surrogate_attacks_softly_and_hardly_within_its_budgets(name, soft):
    config = AttackConfig(perturbation='random_flip', surrogate=name, ratio=1e-3,
                          queries_per_edit=25, edits='delete')
    results = []
    for _ in range(2):
        judge = Judge(soft, start=0.3 * (28.5 if soft else 29.5))
        results.append(Attacker(config).process(GRAPH, judge))
        assert results[-1].queries == len(judge.asked) <= 75
        assert len(results[-1].flips) <= 3
    assert results[0].perturbed == results[1].perturbed
    assert results[0].trace == results[1].trace
    assert results[0].status == 'success'


def test_a_surrogate_spends_fewer_queries_than_none():
    # Of 88 edges the 30 at node 0 count: 20 queries teach which, then each edit needs one.
    def gain(surrogate):
        config = AttackConfig(perturbation='random_flip', surrogate=surrogate, ratio=4e-3,
                              queries_per_edit=3, edits='delete')
        result = Attacker(config).process(GRAPH, Judge(True, start=0.0))
        return result.loss_after - result.loss_before
    assert gain('svm_linear') >= gain('none')


def test_node_by_node_features_attack_too_but_not_without_queries(tmp_path):
    config = AttackConfig(perturbation='random_flip', wl_features='per_graph', ratio=1e-3,
                          queries_per_edit=25, edits='delete')
    assert Attacker(config).process(GRAPH, Judge(True, start=8.5)).status == 'success'
    rows = np.random.default_rng(0).normal(size=(40, 24))
    SurrogateData(rows, rows[:, 0], rows[:, 1] > 0, np.r_[.1, .2], np.array([False, True])).save(
        tmp_path / 'rows.npz')
    without = replace(config, mode='surrogate', surrogate_data=str(tmp_path / 'rows.npz'))
    with pytest.raises(ConfigError, match='pooled'):
        Attacker(without)
    assert Attacker(replace(without, wl_features='pooled')).process(
        GRAPH, Judge(True, start=8.5)).queries == 0


def test_the_svm_ranks_by_the_distance_that_scikit_learn_gives():
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(80, 6))
    surrogate = make_surrogate('svm_rbf', Kernel())
    assert surrogate.fit(rows, rows[:, 0] + rng.normal(size=80))
    new = np.repeat(rng.normal(size=(20, 6)), 2, axis=0)
    scaled = surrogate._scaler.transform(new)
    found = surrogate.predict(new)
    assert found == pytest.approx(surrogate._model.decision_function(scaled), abs=1e-8)
    assert (found[::2] == found[1::2]).all()
