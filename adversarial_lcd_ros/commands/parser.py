# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command line of adversarial-lcd: all subcommands."""

from __future__ import annotations

from argparse import Action, ArgumentParser, HelpFormatter, Namespace, _ArgumentGroup
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
import os
import re
import sys
from textwrap import fill
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
from adversarial_lcd_ros.settings import SETTINGS_OF

# The commands as the help shows them: what to do first comes first.
GROUPS: Mapping[str, tuple[Any, ...]] = {
    'from a recording to a report, in this order': (
        evaluate.add_demo, inspect.add, importing.add, labels.add, evaluate.add, compare.add,
        report.add),
    'what it does to the map': (maps.add, maps.add_render),
    'detectors and defences': (targets.add, certify.add, train.add, build.add),
    'for the nodes': (params.add, key.add, convert.add),
    'upkeep': (compiling.add, fetch_model.add, clean.add),
}
_HELP_ALL, _NO_COMMAND = '--help-all', 'required: COMMAND'
_INVALID_CHOICE = re.compile(r"argument COMMAND: invalid choice: '([^']*)'.*", re.DOTALL)


class Formatter(HelpFormatter):
    """Leaves the lines of examples, and the names of options, as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if text.startswith('examples:'):
            return text
        return fill(' '.join(text.split()), width, initial_indent=indent,
                    subsequent_indent=indent, break_on_hyphens=False)


class Parser(ArgumentParser):
    """
    A parser that says which command or option may have been meant.

    Its help names settings; what they mean, some hundreds of lines, is told by ``--help-all``.

    It does not guess: an option cut short, such as --node, may be that of another setting today
    than the one it was meant for.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**{'allow_abbrev': False, 'formatter_class': Formatter, **options})
        self.groups: dict[str, list[str]] = {}

    def parse_args(self, args: Sequence[str] | None = None,  # type: ignore[override]
                   namespace: Namespace | None = None) -> Namespace:
        """Parse; what is left over is an error of the command, with what may have been meant."""
        options, rest = self.parse_known_args(args, namespace)
        if rest:
            command: Parser = getattr(options, 'parser', self)
            command.error(f'unknown: {with_suggestions(rest, command.option_names())}')
        return options

    def format_help(self) -> str:
        """Return the help; settings by their names alone."""
        return self._help(whole=False)

    def format_whole_help(self) -> str:
        """Return the help with what every setting means."""
        return self._help(whole=True)

    def _help(self, *, whole: bool) -> str:
        formatter = self._get_formatter()
        formatter.add_usage(self.usage, self._actions, self._mutually_exclusive_groups)
        formatter.add_text(self.description)
        for group in sorted(self._action_groups, key=_has_settings):
            listed = self._commands() if self.groups and group is self._positionals else {
                group.title: group._group_actions}
            for title, actions in listed.items():
                formatter.start_section(title)
                if whole or not _has_settings(group):
                    formatter.add_arguments(actions)
                else:
                    formatter.add_text(', '.join(each.option_strings[0] for each in actions))
                formatter.end_section()
        formatter.add_text(self.epilog)
        return formatter.format_help()

    def _commands(self) -> dict[str | None, list[Action]]:
        """Return the lines of the subcommands, by the heading that they stand under."""
        rows = {row.dest: row for action in self._actions
                for row in getattr(action, '_choices_actions', ())}
        return {title: [rows[name] for name in names] for title, names in self.groups.items()}

    def option_names(self) -> Iterable[str]:
        """Return the options of the parser."""
        return self._option_string_actions

    def error(self, message: str) -> NoReturn:
        """End with exit code 2, and suggest a command; without any show what there is."""
        if message.endswith(_NO_COMMAND):
            self.print_help(sys.stderr)
            self.exit(2)
        wrong = _INVALID_CHOICE.match(message)
        if wrong is not None:
            names = [name for group in self.groups.values() for name in group]
            message = (f'there is no command {with_suggestions([wrong[1]], names)}; there are: '
                       f'{", ".join(names)}')
        super().error(message)


def _has_settings(group: _ArgumentGroup) -> bool:
    return (group.title or '').startswith(SETTINGS_OF)


class _HelpAll(Action):
    """Print the whole help, and end."""

    def __call__(self, parser: ArgumentParser, *_: Any) -> NoReturn:
        assert isinstance(parser, Parser)
        print(parser.format_whole_help(), end='')
        parser.exit()


def make_parser() -> Parser:
    """Return the parser; the options of a subcommand know what to run."""
    parser = Parser(
        prog='adversarial-lcd',
        description='Measure how easily graph-based loop closure detection is fooled.',
        epilog='"adversarial-lcd COMMAND --help" has examples; README.md and docs/ the rest.')
    parser.add_argument('--version', action='version', version=f'%(prog)s {__version__}')
    # Subcommands are Parsers, too; what adds them need not know.
    base: ArgumentParser = parser
    commands = base.add_subparsers(metavar='COMMAND', required=True)
    for title, adding in GROUPS.items():
        before = len(commands.choices)
        for add in adding:
            add(commands)
        parser.groups[title] = list(commands.choices)[before:]
    for command in commands.choices.values():
        if any(map(_has_settings, command._action_groups)):
            command.add_argument(_HELP_ALL, action=_HelpAll, nargs=0,
                                 help='show what every setting means, its range and default')
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
