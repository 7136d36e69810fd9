"""
Print a lock file without what this Python has already.

Where ROS 2 is sourced, its own Python packages (numpy among them, which its messages are
compiled against) stay what they are; the rest comes from the lock.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
import re
import sys

# What builds this package has to be of the lock: that of a distribution may be too old.
ALWAYS = ('setuptools',)


def missing(text: str) -> Iterator[str]:
    """Yield the lines of a lock that belong to distributions that are not there."""
    wanted = True
    for line in text.splitlines():
        pin = re.match(r'([A-Za-z0-9._-]+)==', line)
        if pin is not None:
            wanted = pin[1] in ALWAYS or not _is_there(pin[1])
        if wanted:
            yield line


def _is_there(name: str) -> bool:
    try:
        version(name)
    except PackageNotFoundError:
        return False
    return True


if __name__ == '__main__':
    print('\n'.join(missing(Path(sys.argv[1]).read_text(encoding='utf-8'))))
