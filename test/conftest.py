# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fixtures shared by all tests."""

from pathlib import Path
import signal

from hypothesis import settings
import pytest
from ros_fixtures import lcd_model, ros, vocabulary  # noqa: F401

# The first call of a compiled function compiles it, whichever example that is.
settings.register_profile('compiling', deadline=None)
settings.load_profile('compiling')

# A shell that runs the tests in the background has Ctrl-C ignored, and some tests press it.
signal.signal(signal.SIGINT, signal.default_int_handler)

SHARED_DATA = Path(__file__).resolve().parents[2] / 'shared' / 'data'


@pytest.fixture
def shared_data():
    """Return the folder of a real sequence by name; skip, saying so, where it is absent."""
    def folder(name):
        path = SHARED_DATA / name
        if not path.is_dir():
            pytest.skip(f'{path} is not on this machine')
        return path
    return folder


@pytest.fixture
def shared_cases():
    """Return the folder of odd inputs; skip, saying so, where it is absent."""
    path = SHARED_DATA.parent / 'cases'
    if not path.is_dir():
        pytest.skip(f'{path} is not on this machine')
    return path


@pytest.fixture
def kept_runs(monkeypatch):
    """Return the recordings of replays by name of the run: those of the test, once they ran."""
    from adversarial_lcd_ros.evaluation.replay.replays import Replays
    runs, replay = {}, Replays.run

    def replay_and_keep(self):
        made, earlier_s = replay(self)
        runs.update(made)
        return made, earlier_s

    monkeypatch.setattr(Replays, 'run', replay_and_keep)
    return runs
