"""
Print a part of a lock file: some distributions, or those that this Python has not.

Where ROS 2 is sourced, its own Python packages (numpy among them, which its messages are
compiled against) stay what they are; the rest comes from the lock.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
import re

# What builds this package has to be of the lock: that of a system may be too old.
ALWAYS = ('setuptools',)


def part(text: str, is_wanted: Callable[[str], bool]) -> Iterator[str]:
    """Yield the lines of a lock that belong to the distributions that are wanted."""
    wanted = True
    for line in text.splitlines():
        pin = re.match(r'([A-Za-z0-9._-]+)==', line)
        if pin is not None:
            wanted = is_wanted(pin[1])
        if wanted:
            yield line


def is_missing(name: str) -> bool:
    """Tell whether a distribution is to be installed here."""
    try:
        version(name)
    except PackageNotFoundError:
        return True
    return name in ALWAYS


def main() -> None:
    """Print the part that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('lock', type=Path)
    parser.add_argument('--only', nargs='+', metavar='NAME', help='default: what is missing here')
    options = parser.parse_args()
    chosen = is_missing if options.only is None else options.only.__contains__
    print('\n'.join(part(options.lock.read_text(encoding='utf-8'), chosen)))


if __name__ == '__main__':
    main()
