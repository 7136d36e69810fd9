"""The short form of "make soak": every fault a few times."""

from collections import Counter
from pathlib import Path
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
from soak import nodes, offline, processes  # noqa: E402
from soak.__main__ import main, pictures, row  # noqa: E402
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
    kept(offline.fuzz_codec(4000), 'decoded', 'refused')


def test_damaged_files(work):
    kept(offline.fuzz_files(320, work), 'read', 'refused')


def test_any_settings():
    kept(offline.fuzz_config(1000), 'taken', 'refused')


def test_damaged_recordings(work, source):
    kept(offline.fuzz_imports(10, source, work), 'refused')


def test_full_disk(work, source):
    kept(processes.full_disk(2, source, work))


def test_killed_and_run_again(work, source):
    kept(processes.killed(1, source, work), 'done')


def test_two_at_once(work, source):
    kept(processes.two_at_once(1, source, work), 'one bag, the other refused')


@pytest.mark.parametrize('node', ['lcd', 'attacker'])
def test_damaged_messages_to_a_living_node(node):
    pytest.importorskip('rclpy', reason='rclpy is not installed: pip install ".[ros]"')
    kept(nodes.flood(node, 80), 'valid graph answered')


def test_graphs_at_a_rate():
    pytest.importorskip('rclpy', reason='rclpy is not installed: pip install ".[ros]"')
    kept(nodes.stream(300, 30.0, 2.0), 'answered')


def test_broken_promise_is_seen_and_told(tmp_path, monkeypatch):
    broken = Outcome('fault', 'promise', Counter({'kept': 2, 'BROKEN so': 3}), 'note')
    assert row(broken) == '| fault | promise | 5 | BROKEN so: 3; kept: 2 | 3 | note |'
    monkeypatch.setattr('soak.__main__.faults', lambda work, scale: iter([lambda: broken]))
    page = tmp_path / 'page.md'
    assert main(['--output', str(page)]) == 1
    assert row(broken) in page.read_text()


def test_slope_of_memory_has_an_interval_around_the_truth():
    slope = Slope()
    for number in range(60):
        slope.add(number * 100, 50 + number * 0.25 + (-1) ** number * 0.01)  # 2.5 MB per 1000
    text = slope.text(1000, 'per 1000')
    low, high = (float(part) for part in text.split('[')[1].split(']')[0].split(','))
    assert low < 2560 < high
    assert high - low < 20
