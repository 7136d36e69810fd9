# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the commands share."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace, _ActionsContainer, _SubParsersAction
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import sys
from typing import TYPE_CHECKING, Any, TypeAlias

from adversarial_lcd_ros.commands.examples import shown
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.settings import add_config_option
from adversarial_lcd_ros.start import QUIET

if TYPE_CHECKING:
    from rich.console import Console

TABLE_WIDTH = 150
_LEAST_NAME = 12
Commands: TypeAlias = '_SubParsersAction[Any]'


def add_command(commands: Commands, name: str, help: str,
                run: Callable[[Namespace], None]) -> ArgumentParser:
    """Add a command that calls ``run`` with its options; return its parser."""
    parser: ArgumentParser = commands.add_parser(name, help=help, description=help,
                                                 epilog=shown(name))
    parser.set_defaults(run=run, parser=parser)
    parser.add_argument('-q', '--quiet', action='store_true',
                        help='say nothing but results, warnings and errors')
    return parser


def be_quiet(quiet: bool) -> None:
    """Set whether ``tell`` and ``progress_bar`` show nothing; also in processes from here on."""
    if quiet:
        os.environ[QUIET] = '1'
    else:
        os.environ.pop(QUIET, None)


def is_quiet() -> bool:
    """Tell whether only results, warnings and errors are to be shown."""
    return QUIET in os.environ


def add_json_option(parser: ArgumentParser) -> None:
    """Declare ``--json``."""
    parser.add_argument('--json', action='store_true',
                        help='print the results as data (JSON), and nothing else, on standard '
                        'output')


def print_json(values: Mapping[str, Any]) -> None:
    """Print values as JSON; what is not a finite number becomes null."""
    from adversarial_lcd_ros.files.writing import json_text

    print(json_text(values), end='')


def print_rows(title: str, rows: Sequence[Mapping[str, str]]) -> None:
    """Print rows of heading to cell as a table."""
    from rich.table import Table

    table = Table(title=title, title_justify='left')
    for index, heading in enumerate(rows[0] if rows else ()):
        table.add_column(heading, justify='left' if index == 0 else 'right')
    for row in rows:
        table.add_row(*row.values())
    make_console().print(table)


def print_lines(title: str, rows: Sequence[Mapping[str, str]]) -> None:
    """Print rows of heading to cell, each on a line of 80 columns, or of the terminal's."""
    from rich.table import Table
    from rich.text import Text

    console = make_console()
    widths = {heading: max(len(heading), *(len(row[heading]) for row in rows))
              for heading in (rows[0] if rows else ())}
    # The first column gives way; what is behind it are figures. Two blanks are between columns.
    room = console.width - sum(list(widths.values())[1:]) - 2 * (len(widths) - 1)
    table = Table(box=None, padding=(0, 1), pad_edge=False)
    for index, heading in enumerate(widths):
        table.add_column(heading, justify='left' if index < 2 else 'right', no_wrap=True)
    for row in rows:
        name, *figures = row.values()
        table.add_row(_shortened(name, max(_LEAST_NAME, room)), *figures)
    console.print(Text(title))
    console.print(table)


def _shortened(name: str, width: int) -> str:
    """Return a name with its middle left out where it is too wide: its end tells it apart."""
    if len(name) <= width:
        return name
    tail = (width - 1) // 2
    return f'{name[:width - 1 - tail]}…{name[-tail:]}'


def make_console(*, stderr: bool = False) -> Console:
    """
    Return what prints tables and figures, as wide as the terminal or COLUMNS, else 150 columns.

    Brackets and colons in names are what they are: no markup, no emoji.
    """
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    # Where there is no terminal there is no width to keep to.
    known = stream.isatty() or 'COLUMNS' in os.environ
    return Console(width=None if known else TABLE_WIDTH, stderr=stderr, markup=False,
                   emoji=False, highlight=False)


def add_work_options(parser: ArgumentParser) -> None:
    """Add how many processes work, where built graphs are kept, and a file of settings."""
    parser.add_argument('--jobs', type=int, default=worker_count(None), metavar='N',
                        help='processes (default: one for each core)')
    add_cache_option(parser)
    add_config_option(parser)


def add_cache_option(parser: _ActionsContainer) -> None:
    """Declare ``--cache``; also in a group of a parser."""
    parser.add_argument('--cache', type=Path, metavar='FOLDER',
                        help='where built graphs are kept (default: in the cache of the user)')


def worker_count(jobs: int | None) -> int:
    """Return how many processes work: those that were asked for, else one for each core."""
    return jobs or os.cpu_count() or 1


def check_counts(options: Namespace, *names: str) -> None:
    """Raise ConfigError unless each of these options that is given is 1 or more."""
    for name in names:
        value = getattr(options, name)
        if value is not None and value < 1:
            raise ConfigError(f'--{name} {value}: expected 1 or more')


def add_source_options(parser: ArgumentParser) -> None:
    """Declare the options that say how a recording is read; ``source_options`` collects them."""
    group = parser.add_argument_group('how a recording is read')
    group.add_argument('--topic', help='bags: topic of the frames, where several hold images')
    group.add_argument('--ground-truth', metavar='SOURCE', help='file of poses (TUM, KITTI, '
                       'EuRoC, 4 x 4), or a topic of a bag: PoseStamped, '
                       'PoseWithCovarianceStamped, Odometry, TransformStamped, Path, /tf; none: '
                       'use none (default: the only one that the source brings along)')
    group.add_argument('--rate-hz', type=float, metavar='X', help='sources without time stamps: '
                       'frames per second (default: 30)')
    group.add_argument('--camera', metavar='NAME', help='folders: which of several cameras, as '
                       'image_2 (KITTI), cam1 (EuRoC), fisheye1 (OpenLORIS)')
    group.add_argument('--stamps', choices=('header', 'log'), help='bags: stamps of the headers, '
                       'or log times where the headers are wrong (default: header, refused if '
                       'their clock jumps)')
    group.add_argument('--fixed-frame', metavar='FRAME', help='bags: frame in which the camera '
                       'moves, such as world, map, odom')
    group.add_argument('--body-frame', metavar='FRAME', help='bags: whose poses a PoseStamped '
                       'or Path holds (default: the camera)')
    group.add_argument('--camera-frame', metavar='FRAME', help='bags: optical frame of the '
                       'camera in /tf (default: that of the images, or of their camera_info)')
    group.add_argument('--extrinsics', nargs='+', metavar='X', help='the optical frame in that '
                       'of the poses: TX TY TZ QX QY QZ QW, a file of a 4 x 4 matrix, or '
                       'identity')


def source_options(options: Namespace) -> dict[str, Any]:
    """Return the arguments of ``open_sequence`` that were given; empty if none was."""
    from adversarial_lcd_ros.poses.frame_poses import parse_extrinsics
    from adversarial_lcd_ros.sequences.bag_truth import TruthOptions

    given = {name: value for name in ('topic', 'ground_truth', 'rate_hz', 'camera', 'stamps')
             if (value := getattr(options, name)) is not None}
    truth = {name: value for name in ('fixed_frame', 'body_frame', 'camera_frame')
             if (value := getattr(options, name)) is not None}
    if options.extrinsics:
        truth['extrinsics'] = parse_extrinsics(options.extrinsics)
    return {**given, 'truth': TruthOptions(**truth)} if truth else given


def imported_source(source: str, options: Namespace, *, replayed: bool = False) -> str:
    """
    Return a source that needs no more options: imported on the way where any was given.

    Parameters
    ----------
    source : str
        PATH or PATH@FROM:TO.
    options : Namespace
        With those of ``add_source_options``.
    replayed : bool
        The nodes are to replay it: it must be a bag as "import" writes it.

    """
    from adversarial_lcd_ros.sequences.on_the_way import imported
    from adversarial_lcd_ros.sequences.part import SequencePart

    given = source_options(options)
    if not given and not replayed:
        return source
    path = SequencePart.parse(source).path
    part = source.rpartition('@')[2] if path != Path(source) else ''
    if part and replayed:
        raise ConfigError(f'{source}: a replay takes a whole recording; expected {path}, with '
                          '--replay-start-s and --replay-duration-s for a part of it')
    bag = imported(path, given, tell=tell, bar=progress_bar)
    return f'{bag}@{part}' if part else str(bag)


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[int, int], None]]:
    """Show a bar on stderr; yield what is to be called with the work done and the whole."""
    if is_quiet():
        yield lambda done, total: None
        return
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    console = make_console(stderr=True)
    with Progress(TextColumn('{task.description}', markup=False), BarColumn(),
                  MofNCompleteColumn(), TimeRemainingColumn(),
                  console=console) as bar:
        task = bar.add_task(title, total=None)
        try:
            yield lambda done, total: bar.update(task, completed=done, total=total)
        except BaseException:
            # What went wrong is said in one line: no half-done bar stays before it.
            bar.live.transient, console.quiet = True, not console.is_terminal
            raise


def tell(text: str) -> None:
    """Print a line on stderr; with --quiet only a warning."""
    if not is_quiet() or text.startswith('warning'):
        print(text, file=sys.stderr, flush=True)
