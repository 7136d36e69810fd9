# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The lock: complete, with digests, of this setup.cfg; and the scripts that keep it."""

from configparser import ConfigParser
import importlib.util
from pathlib import Path
import re
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / 'requirements'


def script(name):
    """Import a script of the folder, as its user runs it."""
    spec = importlib.util.spec_from_file_location(f'requirements_{name}', FOLDER / f'{name}.py')
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(FOLDER))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(FOLDER))
    return module


lock, part = script('lock'), script('part')
LOCKS = {name: (FOLDER / name).read_text() for name in (*lock.LOCKS, 'uv.txt')}


def plain(name):
    return re.sub(r'[-_.]+', '-', name).lower()


def wanted(extras):
    """Return the names of the distributions that setup.cfg asks for itself."""
    setup = ConfigParser()
    setup.read(ROOT / 'setup.cfg')
    lines = setup['options']['install_requires'].splitlines()
    for extra in extras:
        lines += setup['options.extras_require'][extra].splitlines()
    return {plain(re.match(r'[\w.-]+', line)[0]) for line in map(str.strip, lines)
            if line and not line.startswith('#')}


@pytest.mark.parametrize('name', LOCKS)
def test_everything_has_a_version_and_digests_and_no_index_is_named(name):
    pins = lock.parse(LOCKS[name])
    assert pins
    assert all(digests for _, digests in pins.values())
    assert '://' not in LOCKS[name]
    assert '--index' not in LOCKS[name]
    assert '--find-links' not in LOCKS[name]


@pytest.mark.parametrize('name', lock.LOCKS)
def test_lock_holds_what_setup_cfg_asks_for(name):
    locked = {plain(entry) for entry, _ in lock.parse(LOCKS[name])}
    assert wanted(lock.LOCKS[name]) <= locked


def test_locks_agree_where_they_overlap():
    base = lock.parse(LOCKS['test.txt'])
    for name in lock.LOCKS:
        other = {(entry, version) for (entry, _), (version, _) in lock.parse(LOCKS[name]).items()}
        assert {(entry, version) for (entry, _), (version, _) in base.items()} <= other


BEFORE = """\
a==1.0 \\
    --hash=sha256:11 \\
    --hash=sha256:12
b==2 ; python_version < '3.11' \\
    --hash=sha256:21
c==3 \\
    --hash=sha256:31
d==4 \\
    --hash=sha256:41
"""
AFTER = """\
a==1.1 \\
    --hash=sha256:13
c==3 \\
    --hash=sha256:32
d==4 \\
    --hash=sha256:41 \\
    --hash=sha256:42
e==5 \\
    --hash=sha256:51
"""


def test_what_changed_is_told_and_replaced_files_above_all():
    assert lock.changes(lock.parse(BEFORE), lock.parse(AFTER)) == [
        'a: 1.0 -> 1.1', "gone: b (python_version < '3.11') 2",
        'c 3: FILES WERE REPLACED under the same version, find out why before you use this lock',
        'd 4: more files of the same version', 'new: e 5']
    assert lock.changes(lock.parse(AFTER), lock.parse(AFTER)) == []


def test_line_that_is_no_pin_is_refused():
    with pytest.raises(ValueError, match='expected NAME==VERSION'):
        lock.parse('a>=1\n')


def test_part_is_what_is_asked_for_with_its_digests():
    assert list(part.part(BEFORE, ['c'])) == ['c==3 \\', '    --hash=sha256:31']
    assert list(part.part(f'# head\n{BEFORE}', [])) == []


def test_makefile_installs_by_digest_alone():
    installs = [line for line in (ROOT / 'Makefile').read_text().splitlines()
                if re.search(r'(PIP\)|-m pip) .*install', line)]
    assert installs
    for line in installs:
        assert '--require-hashes' in line or line.endswith('--no-build-isolation -e .'), line
