"""What the commands share."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace, _SubParsersAction
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import os
import sys
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from rich.console import Console

TABLE_WIDTH = 150
Commands: TypeAlias = '_SubParsersAction[ArgumentParser]'


def add_command(commands: Commands, name: str, help: str,
                run: Callable[[Namespace], None]) -> ArgumentParser:
    """Add a command that calls ``run`` with its options; return its parser."""
    parser = commands.add_parser(name, help=help, description=help)
    parser.set_defaults(run=run)
    return parser


def add_json_option(parser: ArgumentParser) -> None:
    """Declare ``--json``."""
    parser.add_argument('--json', action='store_true',
                        help='print the results as data (JSON), and nothing else, on standard '
                        'output')


def print_json(values: Mapping[str, Any]) -> None:
    """Print values as JSON; what is not a finite number becomes null."""
    from adversarial_lcd_ros.files import json_text

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


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[int, int], None]]:
    """Show a bar on stderr; yield what is to be called with the work done and the whole."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    with Progress(TextColumn('{task.description}', markup=False), BarColumn(),
                  MofNCompleteColumn(), TimeRemainingColumn(),
                  console=make_console(stderr=True)) as bar:
        task = bar.add_task(title, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def tell(text: str) -> None:
    """Print a line on stderr."""
    print(text, file=sys.stderr, flush=True)
