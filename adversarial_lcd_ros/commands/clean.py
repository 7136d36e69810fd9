# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd clean: what broken evaluations have left."""

from __future__ import annotations

from argparse import Namespace
import os
from pathlib import Path
import shutil
import sys

from adversarial_lcd_ros.commands.common import Commands, add_command, tell
from adversarial_lcd_ros.errors import ConfigError, EvaluationError


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(
        commands, 'clean', 'Remove the folders of evaluations that were broken off '
        '(<time>.partial); those that are being written are left alone.', _clean)
    parser.add_argument('folder', type=Path, nargs='?', default=Path('results'),
                        help='where the results folders are (default: %(default)s)')
    parser.add_argument('--yes', action='store_true', help='do not ask')


def _clean(options: Namespace) -> None:
    from adversarial_lcd_ros.evaluation.replay.unfinished import hold, unfinished_folders

    if not options.folder.is_dir():
        raise ConfigError(f'{options.folder} is no folder: expected the one that --output named')
    locks = {path: hold(path) for path in unfinished_folders(options.folder)}
    try:
        free = [path for path, lock in locks.items() if lock is not None]
        for path in free:
            print(f'{path}: {_size_bytes(path) / 1e6:.1f} MB')
        for path in locks.keys() - set(free):
            tell(f'{path} is being written: left alone')
        if not free:
            print(f'nothing to remove in {options.folder}')
        elif options.yes or _agreed(len(free)):
            _remove(free)
    finally:
        for lock in locks.values():
            if lock is not None:
                os.close(lock)


def _agreed(count: int) -> bool:
    if not sys.stdin.isatty():
        raise ConfigError('there is nobody to ask: give --yes to remove what is listed')
    answer = input(f'remove {"it" if count == 1 else f"these {count} folders"}? [y/N] ')
    return answer.strip().lower() in ('y', 'yes')


def _remove(paths: list[Path]) -> None:
    for path in paths:
        try:
            shutil.rmtree(path)
        except OSError as error:
            raise EvaluationError(f'{path} cannot be removed: {error}') from error
    print(f'{len(paths)} removed')


def _size_bytes(folder: Path) -> int:
    return sum(path.lstat().st_size for path in folder.rglob('*'))
