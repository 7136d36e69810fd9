# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Operating points: how many of the loops met in training a decision keeps."""

from dataclasses import replace

from graph_factory import make_graph
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.errors import ConfigError, ModelError
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE, UNSCORED, unlabelled
from adversarial_lcd_ros.lcd.decision import KEPT_PERCENT, Decision
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.training.operating_points import (
    met_loops,
    operating_points,
    with_operating_points,
)

SHARES = np.array(KEPT_PERCENT) / 100


def at(points, share):
    return points[KEPT_PERCENT.index(round(100 * share))]


def test_points_by_hand():
    points = operating_points([np.arange(100.0)])
    assert (at(points, 1.0), at(points, 0.95), at(points, 0.5)) == (0, 5, 50)


def test_sequences_weigh_the_same():
    # All of the long one and half of the short one are three quarters.
    points = operating_points([np.full(1000, 9.0), np.array([1.0, 5.0])])
    assert (at(points, 0.5), at(points, 0.51), at(points, 0.75), at(points, 0.76)) == (9, 5, 5, 1)


def test_a_sequence_without_loops_is_left_out():
    assert operating_points([np.zeros(0), np.arange(3.0)]) == operating_points([np.arange(3.0)])
    with pytest.raises(ModelError, match='no frame of the training sequences'):
        operating_points([np.zeros(0)])


ODDS = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=40).map(np.array)


@given(st.lists(ODDS, min_size=1, max_size=3))
def test_each_point_keeps_its_share_and_no_higher_one_would(loops):
    points = np.array(operating_points(loops))
    assert (np.diff(points) <= 0).all()
    for share, point in zip(SHARES, points, strict=True):
        kept = np.mean([(odds >= point).mean() for odds in loops])
        fewer = np.mean([(odds > point).mean() for odds in loops])
        assert fewer - 1e-6 < share <= kept + 1e-6


@pytest.mark.parametrize('share', [0.5, 0.9, 0.95, 0.99, 1.0])
def test_a_decision_moves_to_its_point_and_no_further(share):
    loops = [np.linspace(-3, 40, 87)]
    fitted = with_operating_points(Decision('vbow', ('words',), (10.0,), -4.0), loops, 3.0)
    moved = fitted.keeping(share)
    assert moved.bias == pytest.approx(-4 - max(at(fitted.operating_points, share), 0))
    assert moved.weights == fitted.weights
    assert moved.keeping(share).bias == pytest.approx(moved.bias)
    told = fitted.card['operating_points']
    assert told['loops'] == [87]
    assert told['min_gap_s'] == 3
    assert told['log_odds']['0.95'] == at(fitted.operating_points, 0.95)


def test_the_line_is_never_lowered():
    # 99 % of these loops lie above -20, where everything passes.
    weak = with_operating_points(Decision('vbow', ('words',), (10.0,), -4.0),
                                 [np.linspace(-20, 5, 100)], 3.0)
    assert at(weak.operating_points, 0.99) < -4
    assert weak.keeping(0.99).bias == -4
    assert weak.keeping(0.99).logit([0.0]) < 0
    assert weak.keeping(0.5).keeping(0.99).bias == weak.keeping(0.5).bias


def test_a_detector_is_at_the_point_of_its_settings(tmp_path):
    fitted = with_operating_points(Decision('vbow', ('words',), (10.0,), -4.0),
                                   [np.linspace(-3, 40, 87)], 3.0)
    fitted.save(tmp_path / 'model.json')
    for share in (0.6, 0.95, 1.0):
        detector = LoopClosureDetector(LcdConfig(
            target='vbow', model=str(tmp_path / 'model.json'), kept_loops=share))
        assert detector.decision == fitted.keeping(share)
    with pytest.raises(ConfigError, match='kept_loops'):
        LcdConfig(kept_loops=0.4)


def test_loops_are_met_live_and_only_right_ones_count(tmp_path):
    Decision('vbow', ('words',), (10.0,), -4.0).save(tmp_path / 'model.json')
    lcd = LcdConfig(target='vbow', model=str(tmp_path / 'model.json'), min_gap_s=2.0, map_window=0)
    places = [0, 1, 2, 0, 1, 2]
    graphs = [replace(make_graph(30, seed=place), stamp_ns=second * 10**9)
              for second, place in enumerate(places)]
    labels = unlabelled([graph.stamp_ns for graph in graphs])
    possible = np.zeros((6, 6), bool)
    possible[3, 0] = possible[5, 2] = True
    # Frame 3 is met; 4 has a wrong match, by what the labels say; 5 is not scored.
    kind = np.array([UNSCORED, UNSCORED, NEGATIVE, POSITIVE, POSITIVE, UNSCORED], np.int8)
    labels = replace(labels, kind=kind, possible=possible,
                     candidates=np.array([0, 0, 1, 2, 3, 4]))
    detector = LoopClosureDetector(lcd)
    for graph in graphs[:3]:
        detector.detect(graph)
    assert met_loops(graphs, labels, lcd).tolist() == [detector.judge(graphs[3]).log_odds]
