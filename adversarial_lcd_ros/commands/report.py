# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd report: the report of a results folder, or of an archived one, anew."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from adversarial_lcd_ros.commands.common import Commands, add_command, tell
from adversarial_lcd_ros.commands.compare import compare_folders
from adversarial_lcd_ros.errors import ConfigError


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(commands, 'report', 'Write the report of a results folder anew.', _report)
    parser.add_argument('folder', type=Path, nargs='?', default=Path('results/latest'),
                        help='results folder, or a file that --archive wrote (default: '
                        '%(default)s)')
    parser.add_argument('--archive', type=Path, metavar='FILE',
                        help='write the results, and the cells that they are made of, into one '
                        'file (.jsonl.xz)')
    parser.add_argument('--compare', type=Path, nargs='+', metavar='RESULTS',
                        help='also tell what differs in these results folders, as "compare" does')
    parser.add_argument('--output', type=Path, metavar='FOLDER',
                        help='new folder for an archived run (default: results/ and the name of '
                        'the file)')


def _report(options: Namespace) -> None:
    from adversarial_lcd_ros.evaluation.kinds import open_results

    folder: Path = options.folder
    if folder.is_file():
        if options.archive:
            raise ConfigError(f'{folder} is a file: --archive is for a results folder')
        folder = _unpacked(folder, options.output)
    elif options.output:
        raise ConfigError(f'--output is for an archived run: {folder} is no file, and the report '
                          'of a folder goes into it')
    kind, results = open_results(folder)
    print(kind.report(results))
    if options.folder.is_file():
        _check_figures(folder, results.rows)
    if options.archive:
        from adversarial_lcd_ros.evaluation.archive import pack_results

        pack_results(folder, options.archive)
        print(options.archive)
    if options.compare:
        compare_folders([folder, *options.compare])


def _unpacked(path: Path, output: Path | None) -> Path:
    from adversarial_lcd_ros.evaluation.archive import unpack_results

    folder = output or Path('results') / path.name.split('.')[0]
    unpack_results(path, folder)
    return folder


def _check_figures(folder: Path, archived: list[dict[str, object]]) -> None:
    """Tell whether the figures that were made of the cells are those in the archive."""
    from adversarial_lcd_ros.evaluation.results import SUMMARY, read_json

    made = read_json(folder / SUMMARY)['rows']
    same = sum(row in archived for row in made)
    tell(f'{same} of {len(archived)} rows of figures, made of the cells here, are those in the '
         'archive' if made == archived else
         f'warning: only {same} of {len(archived)} rows of figures, made of the cells here, are '
         'those in the archive: it was damaged, or made by another release')
