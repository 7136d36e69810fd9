# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What benchmarks share: real graphs, and a record of each against its rival."""

from datetime import datetime, timezone
from functools import cache
import json
import os
from pathlib import Path
import platform
import statistics
import time

import numpy as np
import pytest

from adversarial_lcd_ros.config import BuilderConfig
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.vision.builder import GraphBuilder

ROOT = Path(__file__).parents[1]
RESULTS = Path(__file__).with_name('results.json')
MACHINE = Path(__file__).with_name('machine.json')
SECONDS_EACH = 1.0
LEAST_ROUNDS, MOST_ROUNDS = 3, 50
_rows = []


def _rounds(function):
    """Warm up, and return how often a function fits into the time it gets."""
    function()
    started = time.perf_counter()
    function()
    once = time.perf_counter() - started
    return round(min(max(SECONDS_EACH / max(once, 1e-9), LEAST_ROUNDS), MOST_ROUNDS))


def _median_s(function):
    times = []
    for _ in range(_rounds(function)):
        started = time.perf_counter()
        function()
        times.append(time.perf_counter() - started)
    return statistics.median(times)


@pytest.fixture
def record(benchmark):
    """
    Return a function that times ours and a rival in one run and keeps the row.

    Its parameters: ``name`` and ``size`` of the row; ``ours`` and ``rival_fn``, both called
    without arguments; ``rival``, who that is; ``mark``, how many times faster than the rival ours
    shall be, or with ``higher_is_better=False`` the most seconds that ours shall take;
    ``ours_units`` and ``rival_units``, how many things a call does: times are for one of them.
    """
    def run(name, size, ours, rival, rival_fn, mark=None, *, higher_is_better=True,
            ours_units=1, rival_units=1):
        if benchmark.stats is None:  # once a test: its table shows ours
            benchmark.pedantic(ours, rounds=_rounds(ours))
            ours_s = benchmark.stats.stats.median / ours_units
        else:
            ours_s = _median_s(ours) / ours_units
        rival_s = _median_s(rival_fn) / rival_units
        return _keep(name, size, ours_s, rival, rival_s, mark, higher_is_better)
    return run


@pytest.fixture
def measured():
    """
    Return a function that keeps a row of times measured otherwise: across processes, or by stage.

    Its parameters: ``name``, ``size``, ``ours_s``, ``rival``, ``rival_s`` (None without a rival)
    and ``mark``, the most seconds that ours shall take; of a rate, those of one thing.
    """
    def keep(name, size, ours_s, rival=None, rival_s=None, mark=None):
        return _keep(name, size, ours_s, rival, rival_s, mark, higher_is_better=False)
    return keep


def _keep(name, size, ours_s, rival, rival_s, mark, higher_is_better):
    ratio = None if rival_s is None else rival_s / ours_s
    met = None
    if mark is not None:
        met = bool(ratio >= mark if higher_is_better else ours_s <= mark)
    _rows.append({'name': name, 'size': size, 'ours_s': float(ours_s), 'rival': rival,
                  'rival_s': rival_s, 'ratio': ratio, 'mark': mark, 'met': met,
                  'mark_is_ratio': higher_is_better})
    return _rows[-1]


def _machine():
    model = next((line.split(':', 1)[1].strip()
                  for line in Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines()
                  if line.startswith('model name')), platform.processor())
    return {'processor': model, 'cores': len(os.sched_getaffinity(0)),
            'system': platform.platform(), 'python': platform.python_version(),
            'numpy': np.__version__,
            'time': datetime.now(timezone.utc).isoformat(timespec='seconds')}


def pytest_sessionfinish(session):
    """Write the rows of a whole run; those of a part of it in place of the earlier ones."""
    if not _rows:
        return
    whole = session.config.args == ['benchmarks'] and not session.config.option.keyword
    kept = (json.loads(RESULTS.read_text(encoding='utf-8'))
            if RESULTS.is_file() and not whole else [])
    fresh = {(row['name'], row['size'], row['rival']) for row in _rows}
    rows = [row for row in kept if (row['name'], row['size'], row['rival']) not in fresh] + _rows
    for path, content in ((RESULTS, rows), (MACHINE, _machine())):
        path.write_text(json.dumps(content, indent=2) + '\n', encoding='utf-8')


@pytest.fixture(scope='session')
def tour():
    """Return the sequence of the embedded tour."""
    return open_sequence(str(ROOT / 'bags' / 'flat_tour'))


@pytest.fixture(scope='session')
def tour_graphs(tour):
    """Return a function: graphs of every 9th frame of the embedded tour, by features a graph."""
    @cache
    def build(features):
        builder = GraphBuilder(BuilderConfig(features=features))
        try:
            return [builder.build(frame.image(), frame.stamp_ns, tour.name, number)
                    for number, frame in enumerate(tour.frames(stride=9))]
        finally:
            builder.close()
    return build
