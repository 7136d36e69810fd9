# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The command ``adversarial-lcd``: parse, call one function of the core, show what it returns.

What signals mean is settled before anything is imported that costs time.
"""

from __future__ import annotations

from collections.abc import Sequence
import os
import signal
import sys
from typing import TextIO

from adversarial_lcd_ros.errors import AdversarialLcdError
from adversarial_lcd_ros.start import ignore_signals, interruptible, write_plainly

EXIT_OK, EXIT_ERROR, EXIT_INTERRUPTED = 0, 2, 130
_MAX_ERROR = 1500


def main(argv: Sequence[str] | None = None) -> int:
    """
    Run a subcommand and return the exit code.

    0: done; 2: the command line or an input is wrong, said in one line; 130: interrupted, by
    SIGINT or SIGTERM.

    Parameters
    ----------
    argv : sequence of str, optional
        Command line without the program. That of the process if not given: then the process is
        taken to be this command's own, and ends within three seconds of a signal.

    """
    before = signal.getsignal(signal.SIGTERM)
    if argv is None:
        interruptible(EXIT_INTERRUPTED)
    else:
        # A cluster or a shell that ends us gets the same tidy end as Ctrl-C.
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return _run(argv)
    except KeyboardInterrupt:
        print('interrupted', file=sys.stderr)
        return EXIT_INTERRUPTED
    finally:
        if argv is None:
            ignore_signals()
        else:
            signal.signal(signal.SIGTERM, before)


def _run(argv: Sequence[str] | None) -> int:
    from adversarial_lcd_ros.commands.common import be_quiet
    from adversarial_lcd_ros.commands.parser import complete, make_parser
    from adversarial_lcd_ros.settings import with_options

    write_plainly()
    parser = make_parser()
    complete(parser)
    options = parser.parse_args(argv)
    be_quiet(options.quiet)
    try:
        options.run(options)
        sys.stdout.flush()  # here, where a full disk can still be said
    except AdversarialLcdError as error:
        return _refuse(with_options(str(error), options))
    except BrokenPipeError:
        # Whoever read our output has enough of it; nothing more can be written, also at exit.
        _silence(sys.stdout)
        return EXIT_ERROR
    except OSError as error:
        return _refuse(f'{error}; what was finished before is kept')
    except MemoryError:
        return _refuse('there is not enough memory for this: give it less, or run it elsewhere')
    return EXIT_OK


def _silence(stream: TextIO) -> None:
    """Let what is left in a stream go nowhere: it is flushed at exit, too."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _refuse(reason: str) -> int:
    from adversarial_lcd_ros.files.text import printable

    # What is wrong with an input may quote it: not at any length, nor with control characters.
    line = ' '.join(reason.split())
    line = line if len(line) <= _MAX_ERROR else f'{line[:_MAX_ERROR]} ...'
    try:
        print(f'error: {printable(line)}', file=sys.stderr, flush=True)
    except OSError:  # nobody can be told; the exit code remains
        _silence(sys.stderr)
    return EXIT_ERROR


if __name__ == '__main__':
    sys.exit(main())
