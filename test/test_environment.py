# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a figure was made with."""

import shutil
import subprocess

from hypothesis import given
from hypothesis import strategies as st
import pytest

from adversarial_lcd_ros import __version__, environment
from adversarial_lcd_ros.environment import code_digest, code_version


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Return a package of two rooms and a module, whose code is looked at."""
    here = tmp_path / 'checkout' / 'package'
    for name, text in {'room/a.py': 'a = 1', 'room/deep/b.py': 'b = 1', 'other/c.py': 'c = 1',
                       'graph.py': 'g = 1'}.items():
        (here / name).parent.mkdir(parents=True, exist_ok=True)
        (here / name).write_text(text)
    monkeypatch.setattr(environment, '_HERE', here)
    for cached in (code_digest, code_version):
        cached.cache_clear()
        monkeypatch.setattr(environment, cached.__name__, cached.__wrapped__)
    yield here
    code_digest.cache_clear()
    code_version.cache_clear()


@pytest.mark.parametrize('changed', ['room/a.py', 'room/deep/b.py', 'graph.py', 'room/new.py'])
def test_a_digest_knows_every_source_below_its_places(package, changed):
    before = environment.code_digest('room', 'graph')
    assert environment.code_digest('room', 'graph') == before
    (package / changed).write_text('changed = 2')
    assert environment.code_digest('room', 'graph') != before


def test_a_digest_knows_nothing_else(package):
    before = environment.code_digest('room', 'graph')
    (package / 'other/c.py').write_text('changed = 2')
    (package / 'room/notes.md').write_text('no source')
    assert environment.code_digest('room', 'graph') == before


def test_a_place_that_is_not_there_is_an_error(package):
    with pytest.raises(ValueError, match='nowhere is neither'):
        environment.code_digest('room', 'nowhere')


@given(st.text('ab', min_size=1, max_size=3), st.text('ab', max_size=3))
def test_what_moves_from_one_file_to_another_counts(tmp_path_factory, first, second):
    digests = set()
    for texts in ((first, second), (second, first), (first + second, '')):
        here = tmp_path_factory.mktemp('package')
        for name, text in zip('xy', texts, strict=True):
            (here / f'{name}.py').write_text(text)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(environment, '_HERE', here)
            digests.add(code_digest.__wrapped__('x', 'y'))
    assert len(digests) == len({(first, second), (second, first), (first + second, '')})


@pytest.mark.skipif(shutil.which('git') is None, reason='needs git')
def test_the_version_tells_the_commit_of_a_checkout(package):
    checkout = package.parent
    assert environment.code_version() == __version__
    (checkout / 'package.xml').write_text('<package/>')
    assert environment.code_version() == __version__  # installed, not checked out
    git = ('git', '-C', str(checkout), '-c', 'user.name=t', '-c', 'user.email=t@example.org')
    for command in (('init', '-q'), ('add', '.'), ('commit', '-qm', 'all')):
        subprocess.run([*git, *command], check=True)
    clean = environment.code_version()
    assert clean.startswith(f'{__version__}, commit ')
    (package / 'graph.py').write_text('g = 2')
    assert environment.code_version() == f'{clean}-dirty'
