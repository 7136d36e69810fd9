# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Print the lines of a lock file that belong to some distributions: ``part.py LOCK NAME ...``."""

from __future__ import annotations

from collections.abc import Container, Iterator
from pathlib import Path
import re
import sys


def part(text: str, names: Container[str]) -> Iterator[str]:
    """Yield the lines of a lock that belong to the distributions of these names."""
    wanted = False
    for line in text.splitlines():
        pin = re.match(r'([A-Za-z0-9._-]+)==', line)
        if pin is not None:
            wanted = pin[1] in names
        if wanted:
            yield line


if __name__ == '__main__':
    print('\n'.join(part(Path(sys.argv[1]).read_text(encoding='utf-8'), sys.argv[2:])))
