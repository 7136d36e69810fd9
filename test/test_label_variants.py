# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Labels with other thresholds: the same decisions, judged anew."""

from dataclasses import asdict
import json

import numpy as np
import pytest
from test_labels import path

from adversarial_lcd_ros.config import LabelConfig
from adversarial_lcd_ros.evaluation.replay.label_variants import (
    label_variants,
    sweep_labels,
    write_sweep,
)
from adversarial_lcd_ros.evaluation.replay.records import AttackRun, make_records
from adversarial_lcd_ros.ground_truth.labels import label_frames
from adversarial_lcd_ros.messages.types import AttackReport, LoopClosure

SIZE = (640, 480)
BASE = LabelConfig(rule='overlap', min_gap_s=5.0)
# A look around, and the same once more; then elsewhere.
YAW = [*range(0, 360, 30), *range(0, 180, 30)]


def by_poses(trajectory):
    return lambda config: label_frames(trajectory, trajectory.stamp_ns, SIZE, config)


@pytest.fixture
def trajectory():
    return path(YAW)


@pytest.fixture
def records(trajectory):
    """Decisions that find every loop, and an attack that loses the first and invents one."""
    labels = label_frames(trajectory, trajectory.stamp_ns, SIZE, BASE)

    def decision(frame, is_loop):
        match = frame - 12 if frame >= 12 else max(frame - 6, 0)
        return LoopClosure(int(labels.stamp_ns[frame]), 'camera', frame, is_loop, float(is_loop),
                           int(labels.stamp_ns[match]), match)

    truth = labels.kind > 0
    attacked = truth.copy()
    attacked[np.flatnonzero(truth)[0]] = False
    attacked[np.flatnonzero(labels.kind < 0)[-1]] = True
    runs = [[decision(frame, bool(is_loop)) for frame, is_loop in enumerate(run)]
            for run in (truth, attacked)]
    reports = [AttackReport(int(stamp), 'camera', frame, 'failure', '', 1, 0, 0, 0, 0.0, 0.0, 0.0)
               for frame, stamp in enumerate(labels.stamp_ns)]
    return make_records(labels, runs[0], {'attack': AttackRun(runs[1], reports)})


def test_the_labels_as_set_come_first_and_give_the_decline(records, trajectory):
    clean, attack = sweep_labels(records, by_poses(trajectory), BASE)[:2]
    assert (clean['labels'], clean['run'], attack['run']) == ('as set', 'clean', 'attack')
    assert clean['balanced_accuracy'] == 1
    assert clean['decline_pp'] == 0
    assert (attack['suppressed'], attack['invented']) == (1, 1)
    expected = 50 / attack['positives'] + 50 / attack['negatives']
    assert attack['decline_pp'] == pytest.approx(expected)
    assert asdict(BASE).items() <= attack.items()


def test_thresholds_change_what_is_counted(records, trajectory):
    rows = [row for row in sweep_labels(records, by_poses(trajectory), BASE)
            if row['run'] == 'clean']
    assert len({row['labels'] for row in rows}) == len(rows)
    assert len({(row['positives'], row['negatives']) for row in rows}) > 1
    late = next(row for row in rows if row['labels'] == 'min_gap_s = 16')
    assert late['positives'] < rows[0]['positives']


def test_variants_differ_from_the_base_in_one_setting_and_are_possible():
    base = asdict(BASE)
    for title, config in list(label_variants(BASE))[1:]:
        changed = {name for name, value in asdict(config).items() if value != base[name]}
        assert changed == {title.split(' = ')[0]}


def test_it_is_written_as_csv_and_fits_into_json(records, trajectory, tmp_path):
    rows = sweep_labels(records, by_poses(trajectory), BASE)
    write_sweep(tmp_path / 'sweep.csv', rows)
    assert len((tmp_path / 'sweep.csv').read_text().splitlines()) == len(rows) + 1
    assert json.loads(json.dumps(rows)) == rows
