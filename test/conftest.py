"""Fixtures shared by all tests."""

from pathlib import Path

from hypothesis import settings
import pytest
from ros_fixtures import lcd_model, ros, vocabulary  # noqa: F401

# The first call of a compiled function compiles it, whichever example that is.
settings.register_profile('compiling', deadline=None)
settings.load_profile('compiling')

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
