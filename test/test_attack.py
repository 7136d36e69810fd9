# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The attack: budgets enforced, nothing else changed, same seed same bytes."""

from dataclasses import replace
import math
import time
from types import SimpleNamespace

from graph_factory import flips_of, graphs, make_graph
from hypothesis import given, settings
from hypothesis import strategies as st
import networkx as nx
import numpy as np
import pytest

from adversarial_lcd_ros.attack.attacker import Attacker
from adversarial_lcd_ros.attack.oracle import (
    Oracle,
    OracleSilentError,
    answer_logit,
    as_answer,
    edit_budget,
)
from adversarial_lcd_ros.attack.perturbations import PERTURBATIONS, Allowed, make_perturbation
from adversarial_lcd_ros.attack.perturbations.eigencentrality import eigencentrality
from adversarial_lcd_ros.attack.surrogate_data import SurrogateData
from adversarial_lcd_ros.attack.surrogates import make_surrogate
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.errors import AdversarialLcdError, BudgetError, ConfigError, ModelError
from adversarial_lcd_ros.lcd.decision import probability
from adversarial_lcd_ros.messages.types import LcdAnswer
from adversarial_lcd_ros.weisfeiler_lehman.continuous import (
    flip_features,
    iterate,
    node_features,
    pooled_features,
)

RING = [(k, (k + 1) % 60) for k in range(60)]
GRAPH = make_graph(60, [*RING, *((0, k) for k in range(2, 30)), (1, 40), (1, 50)], objects=2)
SECRET = {(3, 4), (10, 40), (20, 21)}


class SecretDetector:
    """Says loop until enough secret pairs are flipped; counts and keeps what it was asked."""

    def __init__(self, clean, start=0.5, step=1.0, secret=SECRET, soft=True):
        self.clean, self.start, self.step = clean, start, step
        self.secret, self.soft, self.asked = secret, soft, []

    def __call__(self, graph):
        self.asked.append(graph)
        flipped = {tuple(pair) for pair in self.clean.flips_to(graph).tolist()}
        logit = self.start - self.step * len(flipped & self.secret)
        chance = probability(logit)
        return LcdAnswer(len(self.asked), logit >= 0, self.soft,
                         chance if self.soft else float(logit >= 0))


@pytest.mark.parametrize(('nodes', 'ratio', 'edits'), [
    (99, 1e-4, 0), (100, 1e-4, 1), (141, 1e-4, 1), (142, 1e-4, 2), (57, 3e-4, 0), (58, 3e-4, 1),
    (82, 3e-4, 2), (100, 3e-4, 3), (130, 3e-4, 5), (71, 2e-4, 1), (300, 3e-4, 27), (0, 1, 0),
])
def test_edit_budget_is_the_floor_of_r_n_squared(nodes, ratio, edits):
    assert edit_budget(nodes, ratio) == edits


def test_the_oracle_counts_and_stops():
    oracle = Oracle(SecretDetector(GRAPH), budget=2)
    oracle(GRAPH)
    oracle(GRAPH)
    assert (oracle.used, oracle.exhausted) == (2, 'query budget spent')
    with pytest.raises(BudgetError, match='query 3 of 2'):
        oracle(GRAPH)
    late = Oracle(SecretDetector(GRAPH), budget=2, deadline_s=time.monotonic())
    with pytest.raises(BudgetError, match='deadline'):
        late(GRAPH)


def test_logit_of_answers():
    assert answer_logit(LcdAnswer(0, True, True, probability(3.25))) == pytest.approx(3.25)
    assert answer_logit(LcdAnswer(0, False, True, 0.0)) == -700
    assert answer_logit(LcdAnswer(0, True, True, 1.0, log_odds=50.25)) == 50.25
    assert answer_logit(LcdAnswer(0, True, False, 1.0)) == 1
    assert answer_logit(LcdAnswer(0, False, False, 0.0)) == -1


@pytest.mark.parametrize('name', list(PERTURBATIONS))
@given(graphs(min_nodes=1), st.integers(0, 2**16), st.sampled_from(['both', 'add', 'delete']),
       st.integers(1, 20))
@settings(max_examples=40)
def test_proposals_are_allowed_distinct_and_repeatable(name, graph, seed, edits, count):
    allowed = Allowed(edits)
    pairs = make_perturbation(name).propose(graph, count, allowed, np.random.default_rng(seed))
    again = make_perturbation(name).propose(graph, count, allowed, np.random.default_rng(seed))
    assert pairs.tolist() == again.tolist()
    assert len(pairs) <= count
    assert len({tuple(pair) for pair in pairs.tolist()}) == len(pairs)
    if len(pairs):
        assert (pairs[:, 0] < pairs[:, 1]).all()
        is_edge = graph.has_edges(pairs)
        assert edits == 'both' or (is_edge == (edits == 'delete')).all()
        allowed.mark(graph, pairs)
        more = make_perturbation(name).propose(graph, count, allowed, np.random.default_rng(seed))
        assert not {tuple(p) for p in more.tolist()} & {tuple(p) for p in pairs.tolist()}


def test_eigencentrality_agrees_with_networkx():
    found = eigencentrality(GRAPH)
    expected = nx.eigenvector_centrality_numpy(nx.from_scipy_sparse_array(GRAPH.adjacency))
    assert found == pytest.approx([abs(expected[node]) for node in range(60)], abs=1e-6)


def test_eigencentrality_of_a_star_by_hand():
    star = make_graph(5, [(0, k) for k in range(1, 5)])
    assert eigencentrality(star) == pytest.approx([2 ** -0.5, *4 * [8 ** -0.5]])


def test_eigencentrality_of_a_disconnected_graph_stays_on_the_larger_component():
    graph = make_graph(7, [(0, 1), (0, 2), (1, 2), (0, 3), (4, 5)])
    found = eigencentrality(graph)
    assert found[:4].min() > 0.1
    assert found[4:] == pytest.approx(0, abs=1e-6)


def test_eigencentrality_proposes_the_hub_first_and_breaks_ties_by_index():
    star = make_graph(6, [(0, k) for k in range(1, 6)])
    pairs = make_perturbation('eigencentrality').propose(
        star, 7, Allowed(), np.random.default_rng(0))
    assert pairs.tolist() == [[0, 1], [0, 2], [0, 3], [0, 4], [0, 5], [1, 2], [1, 3]]


@given(graphs(min_nodes=2), st.integers(1, 60))
def test_eigencentrality_proposes_by_falling_product(graph, count):
    pairs = make_perturbation('eigencentrality').propose(
        graph, count, Allowed(), np.random.default_rng(0))
    x = eigencentrality(graph)
    everything = np.sort(np.outer(x, x)[np.triu_indices(graph.node_count, 1)])[::-1]
    assert len(pairs) == min(count, len(everything))
    assert x[pairs[:, 0]] * x[pairs[:, 1]] == pytest.approx(everything[:len(pairs)], abs=1e-8)


@given(graphs(min_nodes=1, max_nodes=20))
def test_eigencentrality_is_an_eigenvector_of_the_largest_eigenvalue(graph):
    x = eigencentrality(graph)
    largest = np.linalg.eigvalsh(graph.adjacency.toarray())[-1]
    assert graph.adjacency @ x == pytest.approx(largest * x, abs=1e-6)
    assert np.linalg.norm(x) == pytest.approx(1)


@pytest.mark.parametrize('nodes', [100, 150, 400])
def test_eigencentrality_of_larger_graphs_agrees_with_a_dense_solver(nodes):
    rng = np.random.default_rng(nodes)
    graph = make_graph(nodes).flip(flips_of(make_graph(nodes), rng, 3 * nodes))
    near = eigencentrality(graph)
    flipped = graph.flip(flips_of(graph, rng, 3))
    for found, asked in ((near, graph), (eigencentrality(flipped), flipped),
                         (eigencentrality(flipped, near), flipped)):
        expected = np.abs(np.linalg.eigh(asked.adjacency.toarray())[1][:, -1])
        assert found == pytest.approx(expected, abs=1e-10)


def test_a_start_near_another_component_finds_the_one_that_leads_now():
    small = [(a, b) for a in range(4) for b in range(a)]
    large = [(a, b) for a in range(10, 15) for b in range(10, a)]
    graph = make_graph(120, [*small, *large])
    flipped = graph.flip([(10, b) for b in range(11, 15)] + [(3, b) for b in range(4, 9)])
    found = eigencentrality(flipped, eigencentrality(graph))
    assert found[:9].min() > 0.1
    assert found[9:] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize('graph', [
    make_graph(150, [(k, k + 1) for k in range(149)]),
    make_graph(101, [(0, 1)]),
])
def test_eigencentrality_of_a_long_path_and_of_a_single_edge(graph):
    expected = np.abs(np.linalg.eigh(graph.adjacency.toarray())[1][:, -1])
    assert eigencentrality(graph) == pytest.approx(expected, abs=1e-7)


def test_eigencentrality_of_a_large_ring_is_even_and_repeatable():
    ring = make_graph(200, [(k, (k + 1) % 200) for k in range(200)])
    assert eigencentrality(ring) == pytest.approx(200 ** -0.5, abs=1e-6)
    assert eigencentrality(ring).tolist() == eigencentrality(ring).tolist()


def test_shortest_path_cuts_or_joins():
    path = make_graph(4, [(0, 1), (1, 2), (2, 3)])
    pairs = make_perturbation('shortest_path').propose(
        path, 50, Allowed(), np.random.default_rng(0))
    assert {tuple(p) for p in pairs.tolist()} <= {
        (0, 1), (1, 2), (2, 3), (0, 2), (1, 3), (0, 3)}


@pytest.mark.parametrize('settings', [
    *({'perturbation': name, 'surrogate': surrogate} for name in PERTURBATIONS
      for surrogate in ('svm_rbf', 'none')),
    {'search': 'recall'}, {'search': 'grabnel'}], ids=str)
def test_an_attack_keeps_to_its_budgets(settings):
    config = AttackConfig(**settings, ratio=1e-3, queries_per_edit=12)
    detector = SecretDetector(GRAPH, start=50.0)
    before = GRAPH.edge.copy()
    result = Attacker(config).process(GRAPH, detector)
    assert result.status == 'failure'
    assert result.edit_budget == 3
    assert result.queries == len(detector.asked) <= result.query_budget == 36
    assert len(result.flips) <= 3
    assert all(len(GRAPH.flips_to(asked)) <= 3 for asked in detector.asked)
    assert (GRAPH.edge == before).all()
    assert result.perturbed.node_digest == GRAPH.node_digest
    for kept in ('stamp_ns', 'frame_id', 'sequence'):
        assert getattr(result.perturbed, kept) == getattr(GRAPH, kept)
    assert result.loss_after >= result.loss_before
    assert list(result.trace) == sorted(result.trace)


def test_same_seed_same_bytes_and_another_seed_another_search():
    def queries(seed):
        detector = SecretDetector(GRAPH, start=50.0)
        config = AttackConfig(perturbation='random_flip', ratio=1e-3, queries_per_edit=5,
                              seed=seed)
        result = Attacker(config).process(GRAPH, detector)
        return result.perturbed, detector.asked
    assert queries(1) == queries(1)
    assert queries(1)[1] != queries(2)[1]


@pytest.mark.parametrize('soft', [True, False])
def test_an_attack_that_finds_the_weak_edge_succeeds(soft):
    secret = {tuple(pair) for pair in GRAPH.edge.tolist()}
    detector = SecretDetector(GRAPH, start=1.5, secret=secret, soft=soft)
    config = AttackConfig(perturbation='random_flip', edits='delete', ratio=1e-3)
    result = Attacker(config).process(GRAPH, detector)
    assert result.status == 'success'
    assert len(result.flips) == 2
    assert not detector(result.perturbed).is_loop
    assert result.loss_before < 0 < result.loss_after


def test_an_invented_loop_is_a_success_too():
    secret = {tuple(pair) for pair in GRAPH.edge.tolist()}
    detector = SecretDetector(GRAPH, start=-0.5, step=-1.0, secret=secret)
    config = AttackConfig(perturbation='random_flip', edits='delete', ratio=1e-3)
    result = Attacker(config).process(GRAPH, detector)
    assert result.status == 'success'
    assert detector(result.perturbed).is_loop


@pytest.mark.parametrize(('config', 'reason'), [
    (AttackConfig(mode='pass', ratio=1e-3), 'pass'),
    (AttackConfig(ratio=1e-5), 'below one'),
    (AttackConfig(ratio=1e-3, queries_per_edit=0), 'query budget'),
])
def test_what_cannot_be_attacked_passes_through(config, reason):
    detector = SecretDetector(GRAPH)
    result = Attacker(config).process(GRAPH, detector)
    assert result.perturbed is GRAPH
    assert (result.status, detector.asked) == ('skipped', [])
    assert reason in result.reason


def test_a_detector_without_candidates_costs_one_query():
    detector = SecretDetector(GRAPH)
    result = Attacker(AttackConfig(ratio=1e-3)).process(
        GRAPH, lambda graph: replace(detector(graph), is_loop=False, probability=0.0,
                                     log_odds=-math.inf))
    assert (result.status, result.queries) == ('failure', 1)
    assert result.perturbed == GRAPH


@pytest.mark.parametrize('answers', [0, 1, 7])
def test_a_detector_that_falls_silent_gets_the_best_so_far(answers):
    detector = SecretDetector(GRAPH, start=50.0)

    def silent(graph):
        if len(detector.asked) == answers:
            raise OracleSilentError('no answer')
        return detector(graph)

    result = Attacker(AttackConfig(ratio=1e-3)).process(GRAPH, silent)
    assert result.reason == 'no answer'
    assert result.status == ('failure' if answers else 'skipped')
    assert len(result.flips) <= result.edit_budget


def test_the_deadline_ends_the_search(monkeypatch):
    detector, asked = SecretDetector(GRAPH, start=50.0), []

    def ask(graph):
        asked.append(graph)
        return detector(graph)

    # Each answer takes two seconds.
    clock = SimpleNamespace(monotonic=lambda: 2.0 * len(asked))
    for module in ('attacker', 'deadline', 'oracle'):
        monkeypatch.setattr(f'adversarial_lcd_ros.attack.{module}.time', clock)
    result = Attacker(AttackConfig(ratio=1.0, queries_per_edit=10_000, deadline_ms=19_000.0)
                      ).process(GRAPH, ask)
    assert result.reason == 'deadline'
    assert result.queries == len(asked) == 10


@given(graphs(), st.integers(0, 2**16))
def test_wl_features_do_not_depend_on_the_order_of_nodes(graph, seed):
    x = np.random.default_rng(seed).normal(size=(graph.node_count, 3))
    order = np.random.default_rng(seed + 1).permutation(graph.node_count)
    weight = graph.weighted_adjacency()
    for level, moved in zip(iterate(x, weight, 3),
                            iterate(x[order], weight[order][:, order], 3), strict=True):
        assert moved == pytest.approx(level[order])


def test_one_wl_iteration_by_hand():
    path = make_graph(3, [(0, 1), (1, 2)])
    level, = iterate(np.array([[1.0], [2.0], [6.0]]), path.adjacency, 1)
    assert level.ravel() == pytest.approx([1.5, (2 + 3.5) / 2, 4.0])


@given(graphs(), st.integers(0, 2**16), st.integers(1, 3))
def test_flip_features_are_the_difference_that_a_flip_makes(graph, seed, iterations):
    x = node_features(graph)
    pairs = flips_of(graph, np.random.default_rng(seed), 5)
    found = flip_features(graph, x, pairs, iterations)
    clean = pooled_features(graph, x, iterations)
    for pair, row in zip(pairs, found, strict=True):
        change = pooled_features(graph.flip(pair), x, iterations) - clean
        assert row == pytest.approx(graph.node_count * change, abs=1e-6)


@pytest.mark.parametrize('spokes', [5, 40])
def test_flips_at_hubs_have_the_features_that_all_others_have(spokes):
    # Two hubs that share half of their neighbours: sums over these are made once for a graph.
    leaves = range(2, 2 + spokes)
    graph = make_graph(2 + spokes, [*((0, leaf) for leaf in leaves),
                                    *((1, leaf) for leaf in leaves if leaf % 2),
                                    *((leaf, leaf + 1) for leaf in list(leaves)[:-1:3])])
    x = node_features(graph)
    pairs = np.array([(a, b) for a in (0, 1, 2, 3) for b in range(a + 1, graph.node_count)])
    found = flip_features(graph, x, pairs, 2)
    before = pooled_features(graph, x, 2)
    for row, pair in zip(found, pairs, strict=True):
        made = graph.node_count * (pooled_features(graph.flip([pair]), x, 2) - before)
        np.testing.assert_allclose(row, made, atol=1e-10)


def blobs(seed=0, rows=80):
    rng = np.random.default_rng(seed)
    gain = np.where(rng.random(rows) < 0.5, 1.0, -1.0)
    return rng.normal(size=(rows, 4)) + 2 * gain[:, None], gain


def test_the_svm_learns_which_flips_gain():
    svm = make_surrogate('svm_rbf')
    assert svm.fit(*blobs())
    features, gain = blobs(seed=1)
    assert np.mean((svm.predict(features) > 0) == (gain > 0)) > 0.95


def test_the_svm_declines_data_that_do_not_suffice():
    features, gain = blobs()
    assert not make_surrogate('svm_rbf').fit(features, np.abs(gain))
    assert not make_surrogate('svm_rbf').fit(features[:5], gain[:5])


@pytest.fixture
def surrogate_data(tmp_path):
    rng = np.random.default_rng(0)
    x = node_features(GRAPH)
    pairs = flips_of(GRAPH, rng, 120)
    features = flip_features(GRAPH, x, pairs, 2)
    is_loop = np.arange(120) % 2 == 0
    data = SurrogateData(features, np.where(features[:, 0] > np.median(features[:, 0]), 1.0, -1.0),
                         is_loop, np.r_[.1, .2, .3, .7, .8], np.arange(5) >= 2)
    path = tmp_path / 'surrogate.npz'
    data.save(path)
    return path


def test_surrogate_mode_spends_edits_and_no_queries(surrogate_data):
    config = AttackConfig(mode='surrogate', surrogate_data=str(surrogate_data), ratio=1e-3)
    detector = SecretDetector(GRAPH)
    result = Attacker(config).process(GRAPH, detector)
    assert len(result.flips) == result.edit_budget == 3
    assert (result.queries, detector.asked) == (0, [])


def test_surrogate_data_round_trip_and_bound(surrogate_data):
    data = SurrogateData.load(surrogate_data)
    assert data.loop_bound() == pytest.approx(.3)
    assert set(data.fit(lambda: make_surrogate('svm_rbf'))) == {False, True}


def test_damaged_surrogate_data_is_refused(tmp_path, surrogate_data):
    surrogate_data.write_bytes(surrogate_data.read_bytes()[:200])
    with pytest.raises(ModelError, match='surrogate'):
        SurrogateData.load(surrogate_data)
    with pytest.raises(ModelError):
        Attacker(AttackConfig(mode='surrogate', surrogate_data=str(tmp_path / 'none.npz')))


def test_surrogate_mode_without_a_surrogate_is_refused():
    with pytest.raises(ConfigError, match='needs a surrogate'):
        Attacker(AttackConfig(mode='surrogate', surrogate='none'))


def later(graph, seconds):
    return replace(graph, stamp_ns=graph.stamp_ns + round(seconds * 1e9))


def test_recall_keeps_to_its_budgets_and_changes_nothing_else():
    attacker = Attacker(AttackConfig(search='recall', ratio=1e-3))
    attacker.process(GRAPH, SecretDetector(GRAPH))
    for start in (50.0, -50.0):
        now = later(GRAPH, 20)
        detector = SecretDetector(now, start=start, step=0.0)
        result = attacker.process(now, detector)
        assert result.queries == len(detector.asked) <= result.query_budget
        assert all(len(now.flips_to(asked)) <= 3 for asked in detector.asked)
        assert result.perturbed == now


def test_recall_deletes_edges_that_recur():
    attacker = Attacker(AttackConfig(search='recall', ratio=1e-3))
    attacker.process(GRAPH, SecretDetector(GRAPH))
    now = later(GRAPH, 20)
    edges = {tuple(pair) for pair in now.edge.tolist()}
    result = attacker.process(now, SecretDetector(now, start=2.5, secret=edges))
    assert result.status == 'success'
    assert {tuple(pair) for pair in result.flips.tolist()} <= edges
    assert (result.flips >= 2).all()


def test_recall_adds_edges_that_like_looking_features_had():
    attacker = Attacker(AttackConfig(search='recall', ratio=1e-3))
    attacker.process(GRAPH, SecretDetector(GRAPH))
    gone = later(GRAPH.flip([(10, 11), (30, 31), (40, 41)]), 20)
    detector = SecretDetector(gone, start=-2.5, step=-1.0,
                              secret={(10, 11), (30, 31), (40, 41)})
    result = attacker.process(gone, detector)
    assert result.status == 'success'
    assert result.flips.tolist() == [[10, 11], [30, 31], [40, 41]]
    assert result.queries == 2


def test_recall_knows_nothing_of_the_last_eight_seconds():
    attacker = Attacker(AttackConfig(search='recall', ratio=1e-3))
    attacker.process(GRAPH, SecretDetector(GRAPH))
    result = attacker.process(later(GRAPH, 7), SecretDetector(later(GRAPH, 7)))
    assert (result.status, result.reason) == ('failure', 'no graph left to recall')


def test_recall_without_queries_adds_what_is_missing():
    attacker = Attacker(AttackConfig(search='recall', mode='surrogate', ratio=1e-3))
    attacker.process(GRAPH, SecretDetector(GRAPH))
    missing = [[10, 11], [30, 31], [40, 41]]
    now = later(GRAPH.flip(missing), 20)
    detector = SecretDetector(now)
    result = attacker.process(now, detector)
    assert (result.flips.tolist(), result.queries, detector.asked) == (missing, 0, [])


@pytest.mark.parametrize(('said', 'is_loop', 'is_soft'), [
    (True, True, False), (np.bool_(False), False, False), (0.7, True, True),
    (np.float32(0.25), False, True), (1, True, True)])
def test_any_callable_may_answer(said, is_loop, is_soft):
    answer = as_answer(said)
    assert (answer.is_loop, answer.is_soft) == (is_loop, is_soft)
    assert answer.probability == float(said)


@pytest.mark.parametrize('said', [None, 'yes', -0.1, 1.5, float('nan')])
def test_what_is_no_answer_is_an_error(said):
    with pytest.raises(AdversarialLcdError, match='expected a probability'):
        as_answer(said)


@pytest.mark.filterwarnings('error')
def test_features_of_any_scores_are_numbers():
    """The schema bounds scores of features from below alone."""
    score = np.linspace(0, 3e38, GRAPH.node_count).astype(np.float32)
    score[:GRAPH.object_count] = 0.5
    x = node_features(replace(GRAPH, score=score))
    assert np.isfinite(x).all()
    assert np.ptp(x[GRAPH.object_count:, 4]) > 1
