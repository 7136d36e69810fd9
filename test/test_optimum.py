# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The exhaustive greedy optimum, against trying every flip."""

from dataclasses import replace

from graph_factory import make_graph
import numpy as np
import pytest

from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.evaluation.frames.optimum import Optimum
from adversarial_lcd_ros.lcd.decision import Decision
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.targets import TARGETS

GRAPH = make_graph(24, [(k % 2, k) for k in range(4, 24)] + [(k, k + 1) for k in range(2, 20)],
                   stamp_ns=60 * 10**9)
OTHER = make_graph(24, [(k, k + 2) for k in range(2, 20)], seed=7, stamp_ns=60 * 10**9)


@pytest.fixture
def lcd(tmp_path):
    """Return settings of a detector that a few flips can fool either way."""
    path = tmp_path / 'model.json'
    Decision('wl', TARGETS['wl'].channels, (20.0, 2.0, 1.0), -10.5).save(path)
    return LcdConfig(model=str(path), min_gap_s=1.0, map_window=0)


def taught(lcd, *keyframes):
    detector = LoopClosureDetector(lcd)
    for second, keyframe in enumerate(keyframes):
        detector.detect(replace(keyframe, stamp_ns=second * 10**9))
    return detector


@pytest.mark.parametrize('edits', ['both', 'add', 'delete'])
def test_each_step_is_the_best_flip_there_is(lcd, edits):
    detector = taught(lcd, GRAPH)
    path = Optimum(detector, AttackConfig(edits=edits)).path(GRAPH)
    pairs = np.stack(np.triu_indices(24, 1), axis=1)
    if edits != 'both':
        pairs = pairs[GRAPH.has_edges(pairs) == (edits == 'delete')]
    before = GRAPH
    for _ in range(2):
        flipped, loss = next(path)
        done = GRAPH.flips_to(before).tolist()
        losses = [-detector.log_odds(before.flip(pair)).max()
                  for pair in pairs if pair.tolist() not in done]
        assert loss == pytest.approx(max(losses), abs=1e-9)
        assert loss == pytest.approx(-detector.log_odds(flipped).max(), abs=1e-9)
        before = flipped


def test_it_stops_when_the_decision_changes(lcd):
    detector = taught(lcd, GRAPH)
    assert detector.judge(GRAPH).is_loop
    result = Optimum(detector, AttackConfig(ratio=0.05)).process(GRAPH)
    assert (result.status, result.reason) == ('success', 'decision changed')
    assert 0 < len(result.flips) == len(result.trace) <= result.edit_budget == 28
    assert not detector.judge(result.perturbed).is_loop
    assert result.loss_before < 0 < result.loss_after
    assert (result.queries, result.query_budget) == (0, 0)


def test_it_stops_at_the_edit_budget(lcd):
    result = Optimum(taught(lcd, GRAPH), AttackConfig(ratio=0.004)).process(GRAPH)
    assert (result.status, result.reason) == ('failure', 'edit budget spent')
    assert len(result.flips) == result.edit_budget == 2


def test_it_invents_loops_too(lcd):
    looks_alike = replace(OTHER, descriptor=GRAPH.descriptor)
    detector = taught(lcd, looks_alike)
    assert not detector.judge(GRAPH).is_loop
    result = Optimum(detector, AttackConfig(ratio=0.1)).process(GRAPH)
    assert result.status == 'success'
    assert detector.judge(result.perturbed).is_loop


def test_what_cannot_be_attacked_is_said(lcd):
    assert Optimum(taught(lcd), AttackConfig(ratio=0.1)).process(GRAPH).reason == (
        'nothing to compare with')
    assert Optimum(taught(lcd), AttackConfig()).process(GRAPH).reason == 'edit budget below one'
