# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Attacks by pairs: what is drawn, what a frame is held against, and that scores are the same."""

from dataclasses import replace
from types import SimpleNamespace

from graph_factory import flips_of
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from test_frames_attacked import CELLS, stream
import yaml

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.frames.attacked import attack_frames
from adversarial_lcd_ros.evaluation.frames.cells import Cell, cell_key
from adversarial_lcd_ros.evaluation.frames.pairs import PairDetector, draw_pairs
from adversarial_lcd_ros.evaluation.frames.recipe import load_cells
from adversarial_lcd_ros.evaluation.frames.samples import sample_pairs
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.flips import flip_logits
from adversarial_lcd_ros.messages.types import LcdQuery
from adversarial_lcd_ros.training.pair_scores import PairScorer

PAIR_CELLS = [replace(cell, judged='pairs') for cell in CELLS]


@pytest.fixture
def lcd(lcd_model):
    return LcdConfig(model=lcd_model, min_gap_s=2.0, map_window=0)


@st.composite
def relations(draw):
    """Draw symmetric relations of some frames."""
    count = draw(st.integers(1, 25))
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    below = np.tril(rng.choice([-1, 0, 1], (count, count), p=draw(st.sampled_from(
        [(.3, .4, .3), (.05, .9, .05), (.5, .5, 0.)]))), -1).astype(np.int8)
    return below + below.T


@given(relations(), st.integers(1, 6), st.integers(0, 200))
def test_pairs_are_what_they_are_called_and_no_frame_is_a_query_twice(relation, per_kind, seed):
    query, kind, reference = draw_pairs(relation, per_kind, seed)
    assert (np.diff(query) > 0).all()
    assert (reference < query).all()
    assert (relation[query, reference] == kind).all()
    earlier = np.tril(relation, -1)
    loops = (earlier == 1).any(axis=1).sum()
    assert (kind == 1).sum() == min(per_kind, loops)
    assert (kind == -1).sum() <= per_kind
    for again, value in zip(draw_pairs(relation, per_kind, seed), (query, kind, reference),
                            strict=True):
        assert again.tolist() == value.tolist()


def test_pairs_are_spread_over_time_and_seeds_draw_others():
    relation = np.tril(np.ones((40, 40), np.int8), -1)
    relation[20:] *= -1
    draws = [draw_pairs(relation, 4, seed) for seed in range(4)]
    for query, kind, _ in draws:
        assert kind.tolist() == 4 * [1] + 4 * [-1]
        assert ((query // 5)[kind == -1]).tolist() == [4, 5, 6, 7]
    assert len({tuple(query) for query, _, _ in draws}) == 4


@pytest.mark.parametrize('window', [0, 1])
@pytest.mark.parametrize('reference', [0, 2, 5])
def test_a_pair_is_scored_as_in_training_and_flips_are_too(lcd, window, reference):
    graphs = stream()
    detector = PairDetector(replace(lcd, map_window=window))
    for graph in graphs[:6]:
        detector.remember(graph)
    detector.reference = reference
    scoring = detector.judging.scoring
    scorer = PairScorer(scoring, graphs[:6], window)
    query = graphs[6]
    expected = detector.decision.logit(scorer.scores(scoring.view(query), reference))
    decision = detector.judge(query)
    assert decision.log_odds == pytest.approx(float(expected), rel=1e-9)
    assert (decision.match_sequence, decision.candidates) == (reference, 1)
    pairs = flips_of(query, np.random.default_rng(1), 5)
    after = flip_logits(detector, query, pairs)
    for pair, logit in zip(pairs, after, strict=True):
        answer = detector.answer(LcdQuery(0, query.flip([pair])))
        assert answer.log_odds == pytest.approx(logit, abs=1e-6)


def test_another_reference_is_another_answer(lcd):
    graphs = stream()
    detector = PairDetector(lcd)
    for graph in graphs[:6]:
        detector.remember(graph)
    found = []
    for detector.reference in (2, 3, 2):
        found.append(detector.judge(graphs[6]).log_odds)
    assert found[0] == found[2] > found[1]  # frame 6 shows the place of frame 2
    detector.reference = 6
    with pytest.raises(EvaluationError, match='keyframe 6 of 6'):
        detector.judge(graphs[6])


def test_a_map_of_one_keyframe_is_a_pair(lcd):
    graphs = stream()
    live, pair = LoopClosureDetector(lcd), PairDetector(lcd)
    for detector in (live, pair):
        detector.remember(graphs[2])
    assert pair.judge(graphs[6]) == live.judge(graphs[6])


def test_attacks_by_pairs_keep_to_the_reference(lcd):
    graphs = stream()
    relation = np.zeros((8, 8), np.int8)
    relation[6, 2] = relation[5, 1] = 1
    relation[7, 2] = relation[4, 1] = -1
    labels = SimpleNamespace(relation=relation, kind=np.zeros(8, np.int8), told_by='')
    sample = sample_pairs(labels, 2, 0)
    assert sample.frame.tolist() == [4, 5, 6, 7]
    assert (sample.match_is == 'right').sum(axis=1).tolist() == [0, 1, 1, 0]
    together = attack_frames(graphs, sample, PAIR_CELLS, lcd, 0)
    alone = [attack_frames(graphs, sample, [cell], lcd, 0)[0] for cell in PAIR_CELLS]
    for results, again in zip(together, alone, strict=True):
        assert [result.kind for result in results] == [-1, 1, 1, -1]
        for result, reference, other in zip(results, (1, 1, 2, 2), again, strict=True):
            assert result.clean.match_sequence == result.attacked.match_sequence == reference
            said = 'right' if result.kind == 1 else 'elsewhere'
            assert result.clean_is == result.attacked_is == said
            assert result.result.perturbed == other.result.perturbed
            assert len(result.result.flips) <= result.result.edit_budget
    optimum, random = together[2], together[0]
    for best, found in zip(optimum, random, strict=True):
        assert best.result.loss_after >= found.result.loss_after - 1e-9 or (
            best.result.status == 'success')


def test_recipes_say_how_frames_are_judged(tmp_path):
    recipe = tmp_path / 'mine.yaml'
    recipe.write_text(yaml.safe_dump({'protocol': 'frames', 'attacks': [
        {'judged': ['frames', 'pairs'], 'search': ['stepwise', 'optimum']}]}))
    cells = load_cells(str(recipe), {})
    assert [cell.judged for cell in cells] == ['frames', 'frames', 'pairs', 'pairs']
    one: Cell = cells[0]
    assert cell_key(one, 42, 'a', LcdConfig()) != cell_key(
        replace(one, judged='pairs'), 42, 'a', LcdConfig())
