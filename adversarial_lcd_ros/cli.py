"""
The command ``adversarial-lcd``: parse, call one function of the core, show what it returns.

What signals mean is settled before anything is imported that costs time.
"""

from __future__ import annotations

from collections.abc import Sequence
import signal
import sys

from adversarial_lcd_ros.errors import AdversarialLcdError
from adversarial_lcd_ros.start import ignore_signals, interruptible, write_plainly

EXIT_OK, EXIT_ERROR, EXIT_INTERRUPTED = 0, 2, 130


def main(argv: Sequence[str] | None = None) -> int:
    """
    Run a subcommand and return the exit code.

    0: done; 2: the command line or an input is wrong, said in one line; 130: interrupted, by
    SIGINT or SIGTERM.

    Parameters
    ----------
    argv : sequence of str, optional
        Command line without the program. That of the process if not given: then the process is
        taken to be this command's own, and ends within two seconds of a signal.

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
    from adversarial_lcd_ros.commands.parser import make_parser

    write_plainly()
    options = make_parser().parse_args(argv)
    try:
        options.run(options)
    except AdversarialLcdError as error:
        print(f'error: {" ".join(str(error).split())}', file=sys.stderr)
        return EXIT_ERROR
    return EXIT_OK


if __name__ == '__main__':
    sys.exit(main())
