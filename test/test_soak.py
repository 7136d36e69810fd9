# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The short form of "make soak": every fault a few times."""

from collections import Counter
from pathlib import Path
import sys
import time

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
from soak import forgery, nodes, offline, processes  # noqa: E402
from soak.__main__ import keep, main, pictures, row  # noqa: E402
from soak.outcome import Outcome, Slope  # noqa: E402


@pytest.fixture
def source(tmp_path):
    return pictures(tmp_path / 'pictures', 3)


@pytest.fixture
def work(tmp_path):
    folder = tmp_path / 'work'
    folder.mkdir()
    return folder


def kept(outcome, *expected):
    """Check that a promise was kept, and that each of some outcomes was seen."""
    assert outcome.broken == 0, row(outcome)
    for name in expected:
        assert outcome.outcomes[name] > 0, row(outcome)


def test_damaged_payloads():
    kept(offline.fuzz_codec(1500), 'decoded', 'refused')


def test_forged_graphs():
    kept(forgery.forge(3000), 'forged: refused', 'changed: refused', 'cut: refused',
         'replayed: refused', 'reordered: refused', 'stripped: refused', 'spliced: refused')


def test_of_an_earlier_run_none_comes_back(monkeypatch):
    monkeypatch.setattr(forgery, '_RUN', 20)
    kept(forgery.forge(1500), 'of an earlier run: refused')


def test_damaged_files(work):
    kept(offline.fuzz_files(160, work), 'read', 'refused')


def test_any_settings():
    kept(offline.fuzz_config(1000), 'taken', 'refused')


def test_damaged_recordings(work, source):
    kept(offline.fuzz_imports(10, source, work), 'refused')


@pytest.mark.parametrize('fault', ['full_disk', 'killed', 'two_at_once'])
def test_a_command(work, source, fault):
    command = processes.commands(source, work)['import']
    kept(getattr(processes, fault)('import', command, 1, work))


def test_an_evaluation_killed_and_run_again(work, source):
    pytest.importorskip('rclpy', reason='rclpy is not installed: pip install ".[ros]"')
    command = processes.commands(source, work)['evaluate, nodes']
    out = work / 'out'
    process = command.start(out, 'killed')
    try:
        while not any(out.glob('*.partial/recordings/1')):  # nodes are started
            assert process.poll() is None
            time.sleep(0.02)
        assert len(processes.processes_with('killed')) > 0
    finally:
        process.kill()
        process.communicate()
    assert processes._left_after(command, 'killed', out) == ''


def test_half_a_result_is_seen(work, source):
    several = processes.commands(source, work)
    out = work / 'out'
    out.mkdir()
    assert not several['import'].is_honest(out)
    (out / 'cells.jsonl').write_text('{"key": "a"}\n{"ke')
    assert several['targets'].is_honest(out)
    assert not several['targets'].is_whole(out)
    (out / 'summary.json').write_text('{"rows": ')
    assert not several['targets'].is_honest(out)


@pytest.mark.parametrize('node', nodes.NODES)
def test_damaged_messages_to_a_living_node(node):
    pytest.importorskip('rclpy', reason='rclpy is not installed: pip install ".[ros]"')
    kept(nodes.flood(node, 80), 'valid message answered')


def test_graphs_at_a_rate():
    pytest.importorskip('rclpy', reason='rclpy is not installed: pip install ".[ros]"')
    kept(nodes.stream(300, 30.0, 2.0), 'decided')


def test_what_a_node_does_not_count_is_seen():
    class Told:
        heard = [1, 2, 2]

        def count(self, name):
            return {'received graphs': 3, 'published loop closures': 3, 'graphs: missing': 4}[name]

    outcome = Outcome('fault', 'promise')
    nodes._compare(Told(), 8, outcome)
    assert outcome.outcomes['BROKEN neither received nor counted as missing'] == 1
    assert outcome.outcomes['BROKEN decided twice'] == 1


def test_an_earlier_row_of_the_same_fault_is_replaced(tmp_path):
    page = tmp_path / 'page.md'
    for fault, note in (('one', 'a'), ('two', 'b'), ('one', 'c')):
        keep(page, row(Outcome(fault, 'promise', Counter({'kept': 1}), note), 'today'))
    rows = [line for line in page.read_text().splitlines() if line.startswith('| ')]
    assert rows == ['| fault | promise | tried | outcome | broken | note | run |',
                    '| one | promise | 1 | kept: 1 | none | c | today |',
                    '| two | promise | 1 | kept: 1 | none | b | today |']


def test_broken_promise_is_seen_and_told(tmp_path, monkeypatch):
    broken = Outcome('fault', 'promise', Counter({'kept': 2, 'BROKEN so': 3}), 'note')
    assert row(broken) == '| fault | promise | 5 | BROKEN so: 3; kept: 2 | 3 | note |  |'
    monkeypatch.setattr('soak.__main__.faults', lambda work, scales: iter([lambda: broken]))
    page = tmp_path / 'page.md'
    assert main(['--output', str(page)]) == 1
    assert row(broken)[:-2] in page.read_text()


def test_slope_of_memory_has_an_interval_around_the_truth():
    slope = Slope()
    for number in range(60):
        slope.add(number * 100, 50 + number * 0.25 + (-1) ** number * 0.01)  # 2.5 MB per 1000
    text = slope.text(1000, 'per 1000')
    low, high = (float(part) for part in text.split('[')[1].split(']')[0].split(','))
    assert low < 2560 < high
    assert high - low < 20
