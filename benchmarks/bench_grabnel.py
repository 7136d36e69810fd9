# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""GRABNEL (Wan et al., 2021) beside the paper's search and ours: same target, same queries."""

import time

import numpy as np
import pytest

from adversarial_lcd_ros.attack.attacker import Attacker
from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.messages.types import LcdQuery

# Features, and how many graphs; each attack has its 40 queries an edit.
SIZES = {100: 10, 300: 6}


class Asked:
    """The detector, and how long it took."""

    def __init__(self, detector):
        self.detector, self.seconds = detector, 0.0

    def __call__(self, graph):
        began_s = time.perf_counter()
        answer = self.detector.answer(LcdQuery(0, graph))
        self.seconds += time.perf_counter() - began_s
        return answer


def by(attacker, graph, ask):
    result = attacker.attack(graph, ask)
    return result.loss_after - result.loss_before, result.status == 'success'


def cost_and_gain(detector, graphs, attack):
    """Return seconds of the attacker's own, a graph, mean loss gained, decisions changed."""
    ask = Asked(detector)
    began_s = time.perf_counter()
    outcomes = [attack(graph, ask) for graph in graphs]
    own_s = time.perf_counter() - began_s - ask.seconds
    gained, changed = zip(*outcomes, strict=True)
    return own_s / len(graphs), float(np.mean(gained)), sum(changed)


@pytest.mark.parametrize('features', SIZES)
@pytest.mark.parametrize('search', ['stepwise', 'recall'])
def test_beside_grabnel(measured, tour_graphs, features, search, grabnel_costs):
    count = SIZES[features]
    graphs = tour_graphs(features)
    detector = LoopClosureDetector(LcdConfig())
    attacker, rival = (Attacker(AttackConfig(search=name)) for name in (search, 'grabnel'))
    for graph in graphs[:30]:
        detector.detect(graph)
        attacker.observe(graph)
    attacked = graphs[30:30 + count]
    by(attacker, attacked[0], Asked(detector))  # compiles
    ours_s, gain, changed = cost_and_gain(
        detector, attacked, lambda graph, ask: by(attacker, graph, ask))
    if features not in grabnel_costs:
        grabnel_costs[features] = cost_and_gain(
            detector, attacked, lambda graph, ask: by(rival, graph, ask))
    rival_s, rival_gain, rival_changed = grabnel_costs[features]
    measured('grabnel',
             f'n = {attacked[0].node_count}, 40 queries an edit, {search}: loss gained '
             f'{gain:.3f} beside {rival_gain:.3f}, decisions changed {changed} beside '
             f'{rival_changed} of {count}', ours_s,
             'GRABNEL, seconds a graph beside the queries', rival_s)


@pytest.fixture(scope='module')
def grabnel_costs():
    """Return what GRABNEL has cost by size: it is measured once."""
    return {}
