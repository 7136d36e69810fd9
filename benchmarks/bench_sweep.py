# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The recipe of the paper on one sequence: where its time goes, and how it grows."""

from dataclasses import replace
import os
import time

import pytest

from adversarial_lcd_ros.config import BuilderConfig, LabelConfig, LcdConfig
from adversarial_lcd_ros.evaluation.frames.recipe import load_cells
from adversarial_lcd_ros.evaluation.frames.run import plan_experiment, run_experiment
from adversarial_lcd_ros.evaluation.store import open_store
from adversarial_lcd_ros.evaluation.streams import open_streams
from adversarial_lcd_ros.evaluation.workers import local_workers

SIZES, RATIOS = (100, 300), (1e-4, 2e-4, 3e-4)
FRAMES = 1
SEARCHES = {'eigencentrality': {'search': 'stepwise', 'perturbation': 'eigencentrality',
                                'surrogate': 'svm_rbf'},
            'recall': {'search': 'recall'}, 'optimum': {'search': 'optimum'}}
JOBS = len(os.sched_getaffinity(0))


def run(experiment, folder, jobs):
    """Return the rows of an experiment, and its time by the clock."""
    started = time.perf_counter()
    with open_store(folder) as store, local_workers(jobs) as workers:
        rows = run_experiment(experiment, store, workers, lambda cells, share: None)
    return rows, time.perf_counter() - started


@pytest.fixture(scope='module')
def experiment(tour, tmp_path_factory):
    # Of 1000 features a frame takes half a minute: those are left to the whole recipe.
    cells = [replace(cell, seeds=1, frames=FRAMES) for cell in load_cells('paper', {})
             if cell.nodes in SIZES]
    streams = open_streams([str(tour.source)], SIZES, BuilderConfig(), LabelConfig(),
                           tmp_path_factory.mktemp('graphs'), lambda *_: None)
    return plan_experiment(streams, cells, LcdConfig())


def spent_s(rows, parts=('query_s', 'search_s', 'judge_s'), **settings):
    """Return the processor time a frame of cells with some settings."""
    here = [row for row in rows if row['mode'] == 'query' and row['oracle'] == 'soft'
            and all(row[name] == value for name, value in settings.items())]
    return sum(row[part] for row in here for part in parts) / sum(row['frames'] for row in here)


def test_recipe(measured, experiment, tmp_path):
    rows, alone_s = run(experiment, tmp_path / 'alone', 1)
    again, together_s = run(experiment, tmp_path / 'together', JOBS)
    assert len(again) == len(rows) == len(experiment.keys)
    measured('sweep', f'paper recipe without n = 1000, one sequence, {FRAMES} + {FRAMES} frames, '
             f'{len(rows)} cells, {JOBS} processes, a cell', together_s / len(rows),
             'one process', alone_s / len(rows))
    usual = {'target': 'wl', 'asked_target': 'wl', 'queries_per_edit': 40}
    for search, settings in SEARCHES.items():
        kind = {**usual, **settings}
        for ratio in RATIOS:
            measured('sweep', f'{search}, n = 305, r = {ratio:g}, a frame',
                     spent_s(rows, nodes=300, ratio=ratio, **kind), 'r = 3e-4',
                     spent_s(rows, nodes=300, ratio=3e-4, **kind))
        measured('sweep', f'{search}, n = 105, r = 3e-4, a frame',
                 spent_s(rows, nodes=100, ratio=3e-4, **kind), 'n = 305',
                 spent_s(rows, nodes=300, ratio=3e-4, **kind))
    kind = {**usual, 'perturbation': 'eigencentrality', 'surrogate': 'svm_rbf', 'nodes': 300,
            'ratio': 3e-4}
    for part, text in (('query_s', 'answers to queries'), ('search_s', 'proposals and surrogate'),
                       ('judge_s', 'judging the outcome')):
        measured('sweep', f'eigencentrality, n = 305, r = 3e-4, a frame: {text}',
                 spent_s(rows, (part,), **kind), 'all of it', spent_s(rows, **kind))
