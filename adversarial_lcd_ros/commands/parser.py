# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command line of adversarial-lcd: all subcommands."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Sequence
from importlib import import_module
import os
import re
from typing import Any, NoReturn

from adversarial_lcd_ros import __version__
from adversarial_lcd_ros.commands import (
    build,
    certify,
    clean,
    compare,
    compiling,
    convert,
    evaluate,
    fetch_model,
    importing,
    inspect,
    key,
    labels,
    maps,
    params,
    report,
    targets,
    train,
)
from adversarial_lcd_ros.errors import with_suggestions

_INVALID_CHOICE = re.compile(r"argument COMMAND: invalid choice: '([^']*)'.*", re.DOTALL)


class Parser(ArgumentParser):
    """
    A parser that says which command or option may have been meant.

    It does not guess: an option cut short, such as --node, may be that of another setting today
    than the one it was meant for.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**{'allow_abbrev': False, **options})

    def parse_args(self, args: Sequence[str] | None = None,  # type: ignore[override]
                   namespace: Namespace | None = None) -> Namespace:
        """Parse; what is left over is an error of the command, with what may have been meant."""
        options, rest = self.parse_known_args(args, namespace)
        if rest:
            command: Parser = getattr(options, 'parser', self)
            command.error(f'unknown: {with_suggestions(rest, command.option_names())}')
        return options

    def option_names(self) -> Iterable[str]:
        """Return the options of the parser."""
        return self._option_string_actions

    def error(self, message: str) -> NoReturn:
        """End with exit code 2, and suggest a command."""
        wrong = _INVALID_CHOICE.match(message)
        if wrong is not None:
            names = [name for action in self._actions for name in action.choices or ()]
            message = (f'there is no command {with_suggestions([wrong[1]], names)}; there are: '
                       f'{", ".join(names)}')
        super().error(message)


def make_parser() -> Parser:
    """Return the parser; the options of a subcommand know what to run."""
    parser = Parser(
        prog='adversarial-lcd',
        description='Measure how easily graph-based loop closure detection is fooled.')
    parser.add_argument('--version', action='version', version=f'%(prog)s {__version__}')
    # Subcommands are Parsers, too; what adds them need not know.
    base: ArgumentParser = parser
    commands = base.add_subparsers(metavar='COMMAND', required=True)
    for add in (evaluate.add_demo, importing.add, build.add, evaluate.add, report.add,
                compare.add, targets.add, certify.add, train.add, fetch_model.add, compiling.add,
                clean.add, labels.add, maps.add, maps.add_render, inspect.add, convert.add,
                params.add, key.add):
        add(commands)
    return parser


def complete(parser: ArgumentParser) -> None:
    """Answer a shell that asks for completions, and end; do nothing for anybody else."""
    if '_ARGCOMPLETE' not in os.environ:
        return
    try:
        argcomplete: Any = import_module('argcomplete')
    except ImportError:
        return
    argcomplete.autocomplete(parser)
