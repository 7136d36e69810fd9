# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Attacks on single frames: what is drawn, what the map is, and that cells do not meet."""

from dataclasses import replace
from types import SimpleNamespace

from graph_factory import flips_of, make_graph
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.attack.attacker import Attacker
from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.frames import attacked as frames
from adversarial_lcd_ros.evaluation.frames.attacked import attack_frames
from adversarial_lcd_ros.evaluation.frames.cells import Cell
from adversarial_lcd_ros.evaluation.frames.samples import FrameSample, sample_frames
from adversarial_lcd_ros.evaluation.frames.sealed import SealedWire
from adversarial_lcd_ros.lcd.defences.rederive import RederiveCheck
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.messages.types import LcdQuery

RING = [(k, k + 1) for k in range(2, 29)] + [(k % 2, k) for k in range(4, 30)]
ATTACK = AttackConfig(surrogate='none', ratio=0.01, queries_per_edit=3)
CELLS = [Cell('stepwise', replace(ATTACK, perturbation='random_flip'), 'wl', 'wl', 'soft', 30,
              2, 1),
         Cell('recall', replace(ATTACK, search='recall'), 'wl', 'wl', 'hard', 30, 2, 1),
         Cell('optimum', ATTACK, 'wl', 'wl', 'soft', 30, 2, 1)]


def labels_of(kind):
    kind = np.array(kind, np.int8)
    return SimpleNamespace(kind=kind, told_by='audit', judge=lambda query, match: np.where(
        match < query - 1, 'right', 'untold'))


def stream(count=8, changed=3):
    """Return views of four places, seen twice with a few edges changed."""
    rng = np.random.default_rng(5)
    places = [make_graph(30, RING, seed=seed) for seed in range(4)]
    return [replace(places[k % 4].flip(flips_of(places[k % 4], rng, changed)), stamp_ns=k * 10**9,
                    sequence=k) for k in range(count)]


@pytest.fixture
def lcd(lcd_model):
    return LcdConfig(model=lcd_model, min_gap_s=2.0, map_window=0)


SAMPLE = FrameSample(np.array([3, 5, 6]), np.array([-1, 1, 1], np.int8),
                     np.where(np.eye(8)[[3, 1, 2]] > 0, 'right', 'elsewhere'))


@given(st.lists(st.sampled_from([-1, 0, 1]), min_size=1, max_size=80), st.integers(1, 6),
       st.integers(0, 1000))
def test_each_kind_gives_its_frames_once(kind, per_kind, seed):
    sample = sample_frames(labels_of(kind), per_kind, seed)
    assert (np.diff(sample.frame) > 0).all()
    assert (sample.kind == np.array(kind)[sample.frame]).all()
    for value in (-1, 1):
        assert (sample.kind == value).sum() == min(per_kind, kind.count(value))
    assert sample.match_is.shape == (len(sample.frame), len(kind))


@given(st.integers(1, 5), st.integers(1, 8), st.integers(0, 50))
def test_seeds_draw_other_frames_until_all_are_used(per_kind, seeds, first):
    labels = labels_of([1] * per_kind * seeds + [0] * 5)
    drawn = [sample_frames(labels, per_kind, seed).frame for seed in range(first, first + seeds)]
    assert sorted(np.concatenate(drawn)) == list(range(per_kind * seeds))
    again = sample_frames(labels, per_kind, first + seeds).frame
    assert (again == drawn[0]).all()


def test_a_sample_knows_the_right_matches():
    sample = sample_frames(labels_of([0, 0, 0, 1, -1]), 1, 0)
    assert (sample.match_is == 'right').sum(axis=1).tolist() == [2, 3]
    assert sample.told_by == 'audit'


def test_frames_are_judged_against_the_clean_graphs_before_them(lcd):
    graphs = stream()
    results, = attack_frames(graphs, SAMPLE, CELLS[:1], lcd, seed=7)
    assert [result.kind for result in results] == [-1, 1, 1]
    for frame, result in zip(SAMPLE.frame, results, strict=True):
        detector = LoopClosureDetector(lcd)
        for graph in graphs[:frame]:
            detector.remember(graph)
        assert result.clean == detector.judge(graphs[frame])
        assert result.attacked == detector.judge(result.result.perturbed)
        alone = Attacker(replace(CELLS[0].attack, seed=7)).attack(
            graphs[frame], lambda graph, lcd=detector: lcd.answer(LcdQuery(0, graph)))
        assert result.result == alone
    assert results[1].clean.match_stamp_ns == graphs[1].stamp_ns
    assert [result.clean_is for result in results[:2]] == ['elsewhere', 'right']


def test_cells_do_not_see_each_other(lcd):
    graphs = stream()
    together = attack_frames(graphs, SAMPLE, CELLS, lcd, seed=7)
    for cell, results in zip(CELLS, together, strict=True):
        alone, = attack_frames(graphs, SAMPLE, [cell], lcd, seed=7)
        assert [result.result for result in alone] == [result.result for result in results]
        assert [result.attacked for result in alone] == [result.attacked for result in results]
    assert any(result.result.queries for result in together[0])
    assert not any(result.result.queries for result in together[2])


def test_the_threshold_is_the_cells(lcd):
    strict = [replace(cell, threshold=1.0) for cell in CELLS[:1]]
    usual, = attack_frames(stream(), SAMPLE, CELLS[:1], lcd, seed=7)
    strictly, = attack_frames(stream(), SAMPLE, strict, lcd, seed=7)
    assert any(result.clean.is_loop for result in usual)
    for before, after in zip(usual, strictly, strict=True):
        assert not after.clean.is_loop or after.clean.probability == 1
        assert before.clean.probability == after.clean.probability


def test_transfer_asks_one_target_and_is_judged_by_another():
    lcd = LcdConfig(min_gap_s=2.0, map_window=0)
    graphs = stream(changed=60)
    cell = Cell('stepwise', CELLS[0].attack, 'descriptors', 'wl', 'soft', 30, 2, 1)
    results, = attack_frames(graphs, SAMPLE, [cell], lcd, seed=0)
    judging, asked = (LoopClosureDetector(replace(lcd, target=name))
                      for name in ('descriptors', 'wl'))
    for graph in graphs[:3]:
        judging.remember(graph)
        asked.remember(graph)
    assert results[0].clean == judging.judge(graphs[3])
    assert results[0].result.loss_before == pytest.approx(asked.log_odds(graphs[3]).max())
    assert results[0].result.loss_before != pytest.approx(judging.log_odds(graphs[3]).max())
    # Flips of edges are no matter to the one that judges.
    assert results[0].result.flips.size
    assert results[0].attacked == results[0].clean


@pytest.mark.parametrize('overspent', [
    {'edit_budget': 0}, {'query_budget': 1}, {'queries': 1}])
def test_an_attack_over_budget_fails_the_experiment(lcd, monkeypatch, overspent):
    attack = Attacker.attack
    monkeypatch.setattr(frames.Attacker, 'attack', lambda self, *given: replace(
        attack(self, *given), **overspent))
    with pytest.raises(EvaluationError, match='does not keep to its budgets'):
        attack_frames(stream(), SAMPLE, CELLS[:1], lcd, seed=0)


def test_edges_are_counted_where_a_defence_counts_them(lcd):
    graphs = stream()
    cells = [replace(CELLS[0], detector=(('defences', name),), aware=False)
             for name in ('rederive_check', 'length_check')]
    counted, not_counted = attack_frames(graphs, SAMPLE, cells, lcd, 42)
    check = RederiveCheck(lcd)
    for result in counted:
        assert result.unexplained_clean == check.unexplained(result.result.clean)
        assert result.unexplained == check.unexplained(result.result.perturbed)
    assert any(result.result.flips.size for result in counted)
    assert {(result.unexplained_clean, result.unexplained) for result in not_counted} == {
        (None, None)}


def sealed(search, aware):
    attack = replace(ATTACK, search=search, perturbation='random_flip')
    return Cell(search, attack, 'wl', 'wl', 'soft', 30, 2, 1, sealed=True, aware=aware)


def test_who_knows_of_the_seal_sends_graphs_as_they_are_and_they_are_taken(lcd):
    results, open_wire = attack_frames(stream(), SAMPLE, [sealed('recall', True), CELLS[0]],
                                       lcd, 42)
    assert [result.attacked for result in results] == [result.clean for result in results]
    assert [result.clean for result in results] == [result.clean for result in open_wire]
    assert any(result.attacked.is_loop for result in results)
    assert {(result.refused, result.result.queries) for result in results} == {('', 0)}


@pytest.mark.parametrize(('search', 'causes'), [
    ('stepwise', {'seal'}), ('replay', {'replayed'})])
def test_who_does_not_is_refused_and_the_loop_is_lost_in_plain_sight(lcd, search, causes):
    cell = sealed(search, False)
    results, open_wire = attack_frames(stream(changed=8), SAMPLE, [
        cell, replace(cell, sealed=False)], lcd, 42)
    assert [result.result for result in results] == [result.result for result in open_wire]
    changed = [result for result in results if result.result.clean != result.result.perturbed]
    assert changed
    assert {result.refused for result in changed} == causes
    assert not any(result.attacked.is_loop or result.attacked_is for result in changed)
    assert all(result.refused == '' and result.attacked == result.clean
               for result in results if result not in changed)


def test_a_wire_refuses_what_is_not_the_builders():
    graphs = [replace(graph, stamp_ns=5 * graph.stamp_ns) for graph in stream()]
    wire = SealedWire(max_age_s=10.0)
    for graph in graphs[:6]:
        wire.carry(graph)
    now = graphs[6]
    assert wire.arrives(now, now) == (now, '')
    assert wire.arrives(now, now.flip([(3, 9)])) == (None, 'seal')
    # Graphs of 10 and of 15 s ago, under the present stamp: whoever has no key brings them back.
    past = [replace(graph, stamp_ns=now.stamp_ns, sequence=now.sequence) for graph in graphs[3:5]]
    assert wire.arrives(now, past[1]) == (None, 'replayed')
    assert wire.arrives(now, past[0]) == (None, 'age')
    # None of these left a trace.
    wire.carry(now)
    with pytest.raises(EvaluationError, match=r'clean graph 6 .* is refused \(replayed'):
        wire.carry(now)
    wire.carry(replace(graphs[7], session=3, sequence=0))


def test_who_does_not_know_of_a_defence_asks_a_detector_without(lcd):
    graphs = stream()
    ask = replace(ATTACK, search='move_nodes', nodes_moved=20)
    strict = (('geometric_check', True), ('geometric_inliers', 100_000))
    known, unknown, none = attack_frames(graphs, SAMPLE, [
        Cell('move_nodes', ask, 'wl', 'wl', 'soft', 30, 2, 1, detector=strict),
        Cell('move_nodes', ask, 'wl', 'wl', 'soft', 30, 2, 1, detector=strict, aware=False),
        Cell('move_nodes', ask, 'wl', 'wl', 'soft', 30, 2, 1)], lcd, 42)
    assert not any(each.clean.is_loop or each.attacked.is_loop for each in (*known, *unknown))
    assert [each.result.trace for each in unknown] == [each.result.trace for each in none]
    assert [each.result.loss_before for each in known] != [
        each.result.loss_before for each in none]
