"""The command line of adversarial-lcd: all subcommands."""

from __future__ import annotations

from argparse import ArgumentParser

from adversarial_lcd_ros import __version__
from adversarial_lcd_ros.commands import (
    build,
    clean,
    compare,
    compiling,
    evaluate,
    fetch_model,
    importing,
    inspect,
    labels,
    maps,
    params,
    report,
    targets,
    train,
)


def make_parser() -> ArgumentParser:
    """Return the parser; the options of a subcommand know what to run."""
    parser = ArgumentParser(
        prog='adversarial-lcd',
        description='Measure how easily graph-based loop closure detection is fooled.')
    parser.add_argument('--version', action='version', version=f'%(prog)s {__version__}')
    commands = parser.add_subparsers(metavar='COMMAND', required=True)
    for add in (evaluate.add_demo, importing.add, build.add, evaluate.add, report.add,
                compare.add, targets.add, train.add, fetch_model.add, compiling.add, clean.add,
                labels.add, maps.add, inspect.add, params.add):
        add(commands)
    return parser
