"""
The command ``adversarial-lcd``: parse, call one function of the core, show what it returns.

Every module that costs time to import is imported by the command that needs it, when it runs.
"""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Sequence
import signal
import sys

from adversarial_lcd_ros import __version__
from adversarial_lcd_ros.commands import (
    build,
    compare,
    evaluate,
    fetch_model,
    importing,
    inspect,
    labels,
    params,
    report,
    targets,
    train,
)
from adversarial_lcd_ros.errors import AdversarialLcdError

EXIT_OK, EXIT_ERROR, EXIT_INTERRUPTED = 0, 2, 130


def main(argv: Sequence[str] | None = None) -> int:
    """
    Run a subcommand and return the exit code.

    0: done; 2: the command line or an input is wrong, said in one line; 130: interrupted, by
    SIGINT or SIGTERM.
    """
    options = _parser().parse_args(argv)
    # A cluster or a shell that ends us gets the same tidy end as Ctrl-C.
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        options.run(options)
    except AdversarialLcdError as error:
        print(f'error: {" ".join(str(error).split())}', file=sys.stderr)
        return EXIT_ERROR
    except KeyboardInterrupt:
        print('interrupted', file=sys.stderr)
        return EXIT_INTERRUPTED
    finally:
        signal.signal(signal.SIGTERM, before)
    return EXIT_OK


def _parser() -> ArgumentParser:
    parser = ArgumentParser(
        prog='adversarial-lcd',
        description='Measure how easily graph-based loop closure detection is fooled.')
    parser.add_argument('--version', action='version', version=f'%(prog)s {__version__}')
    commands = parser.add_subparsers(metavar='COMMAND', required=True)
    for add in (evaluate.add_demo, importing.add, build.add, evaluate.add, report.add,
                compare.add, targets.add, train.add, fetch_model.add, labels.add, inspect.add,
                params.add):
        add(commands)
    return parser


if __name__ == '__main__':
    sys.exit(main())
