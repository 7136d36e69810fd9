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


@pytest.mark.parametrize(('perturbation', 'surrogate', 'mode'), [
    ('eigencentrality', 'svm_rbf', 'query'), ('eigencentrality', 'svm_rbf', 'surrogate'),
    ('random_walk', 'ard', 'query'), ('recall', 'none', 'query'), ('recall', 'none', 'surrogate'),
    ('eigencentrality', 'none', 'pass')])
def test_a_graph_is_attacked(monkeypatch, perturbation, surrogate, mode):
    results = []
    process = Attacker.process
    monkeypatch.setattr(Attacker, 'process', lambda self, graph, ask: results.append(
        process(self, graph, ask)) or results[-1])
    compiled.load_for_attacker(AttackConfig(perturbation=perturbation, surrogate=surrogate,
                                            mode=mode, deadline_ms=1.0))
    last = results[-1]
    assert last.edit_budget == 1
    assert last.reason == {'pass': 'mode is pass', 'surrogate': 'nobody asked'}.get(
        mode, last.reason)
    assert (last.queries > 1) == (mode == 'query')
