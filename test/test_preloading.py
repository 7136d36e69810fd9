# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compiled code is loaded by what a node does before its first message, for every setting."""

import pytest

from adversarial_lcd_ros.attack.attacker import Attacker
from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector

compiled = pytest.importorskip('adversarial_lcd_ros.preloading')


@pytest.mark.parametrize('target', ['wl', 'anchored', 'objects', 'vbow'])
def test_a_graph_is_compared(monkeypatch, target):
    judged = []
    judge = LoopClosureDetector.judge
    monkeypatch.setattr(LoopClosureDetector, 'judge', lambda self, graph: judged.append(
        judge(self, graph)) or judged[-1])
    compiled.load_for_detector(LcdConfig(target=target))
    assert len(judged) == 3
    assert all(decision.probability > 0 for decision in judged)


@pytest.mark.parametrize(('attack', 'mode'), [
    ({'surrogate': 'svm_rbf'}, 'query'), ({'surrogate': 'svm_rbf'}, 'surrogate'),
    ({'perturbation': 'random_walk', 'surrogate': 'ard'}, 'query'),
    ({'search': 'recall'}, 'query'), ({'search': 'recall'}, 'surrogate'),
    ({'surrogate': 'none'}, 'pass')])
def test_a_graph_is_attacked(monkeypatch, attack, mode):
    results = []
    process = Attacker.process
    monkeypatch.setattr(Attacker, 'process', lambda self, graph, ask: results.append(
        process(self, graph, ask)) or results[-1])
    compiled.load_for_attacker(AttackConfig(mode=mode, deadline_ms=1.0, **attack))
    last = results[-1]
    assert last.edit_budget == 1
    assert last.reason == {'pass': 'mode is pass', 'surrogate': 'nobody asked'}.get(
        mode, last.reason)
    assert (last.queries > 1) == (mode == 'query')
