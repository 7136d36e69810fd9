# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Renew the lock files beside this script, and say what changed.

A lock holds every distribution that an installation takes, direct or not, with its version and
the digests of its files, for all Pythons at once. ``python requirements/lock.py`` keeps what
still fits setup.cfg; ``--upgrade`` takes the newest releases. Needs uv (requirements/uv.txt).
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
import re
import subprocess
import sys

HERE = Path(__file__).resolve().parent
OLDEST_PYTHON = '3.10'
# Lock file to the extras of setup.cfg in it. What is in the first has the same releases in all.
LOCKS: Mapping[str, tuple[str, ...]] = {
    'test.txt': ('test', 'dev', 'slam'),
    'ros.txt': ('test', 'dev', 'slam', 'ros'),
    'bench.txt': ('test', 'dev', 'slam', 'bench')}
_HEAD = """\
# Made by "make lock": every distribution of setup.cfg[{extras}], with digests. Not to be edited.
"""
_PIN = re.compile(r'^([A-Za-z0-9._-]+)==(\S+)(?:\s*;\s*([^\\]*?))?\s*\\?$')

# Name and marker of a distribution -> its version and digests.
Lock = dict[tuple[str, str], tuple[str, frozenset[str]]]


def parse(text: str) -> Lock:
    """Return what a lock file says; raises ValueError for a line that is none of it."""
    found: Lock = {}
    key = ('', '')
    for line in text.splitlines():
        line = line.strip()
        if not line or line.startswith('#'):
            continue
        if line.startswith('--hash=sha256:'):
            version, digests = found[key]
            found[key] = version, digests | {line.removeprefix('--hash=').rstrip(' \\')}
            continue
        pin = _PIN.match(line)
        if pin is None:
            raise ValueError(f'{line!r}: expected NAME==VERSION or --hash=sha256:DIGEST')
        key = pin[1], (pin[3] or '').strip()
        found[key] = pin[2], frozenset()
    return found


def changes(before: Lock, after: Lock) -> list[str]:
    """Return a line for each distribution that came, went, or changed."""
    lines = []
    for key in sorted(before.keys() | after.keys()):
        name = f'{key[0]} ({key[1]})' if key[1] else key[0]
        old, new = before.get(key), after.get(key)
        if old is None and new is not None:
            lines.append(f'new: {name} {new[0]}')
        elif new is None and old is not None:
            lines.append(f'gone: {name} {old[0]}')
        elif old is not None and new is not None and old[0] != new[0]:
            lines.append(f'{name}: {old[0]} -> {new[0]}')
        elif old is not None and new is not None and old[1] - new[1]:
            lines.append(f'{name} {old[0]}: FILES WERE REPLACED under the same version, find out '
                         'why before you use this lock')
        elif old != new:
            lines.append(f'{name} {old[0] if old else ""}: more files of the same version')
    return lines


def compile_lock(name: str, extras: tuple[str, ...], constraint: Path | None,
                 upgrade: bool) -> str:
    """Return the text of a lock file, as uv resolves it."""
    path = HERE / name
    command = ['uv', 'pip', 'compile', 'setup.py', '--universal', '--python-version',
               OLDEST_PYTHON, '--generate-hashes', '--no-annotate', '--no-header',
               '--no-emit-index-url', '--no-emit-find-links', '--quiet']
    command += [part for extra in extras for part in ('--extra', extra)]
    command += ['--constraint', str(constraint)] if constraint is not None else []
    # uv reads what the output file holds, and keeps it where it can.
    command += ['--output-file', str(path), *(['--upgrade'] if upgrade else [])]
    done = subprocess.run(command, cwd=HERE.parent, check=False, stdout=subprocess.DEVNULL)
    if done.returncode:
        sys.exit(f'error: uv could not resolve {name}')
    return _HEAD.format(extras=','.join(extras)) + path.read_text(encoding='utf-8')


def main() -> None:
    """Renew all lock files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--upgrade', action='store_true', help='take the newest releases')
    upgrade = parser.parse_args().upgrade
    base = HERE / next(iter(LOCKS))
    for name, extras in LOCKS.items():
        path = HERE / name
        before = path.read_text(encoding='utf-8') if path.is_file() else ''
        text = compile_lock(name, extras, None if path == base else base, upgrade)
        path.write_text(text, encoding='utf-8')
        lines = changes(parse(before), parse(text))
        print(f'{name}: {len(lines)} changes')
        for line in lines:
            print(f'  {line}')


if __name__ == '__main__':
    main()
