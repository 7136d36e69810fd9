# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Print a table of the licences of all that a lock names, as far as it is installed here.

``python requirements/licences.py > docs/licences.md`` (make licences).
"""

from __future__ import annotations

from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from lock import LOCKS, parse

HERE = Path(__file__).resolve().parent
_HEAD = """\
# Licences

What `make setup` and `make bench` install, and under which terms, as each distribution says of
itself. Made by `make licences`; what the lock names for other Pythons or systems is not in it.
Nothing of it ships with this package.

| distribution | version | licence |
|---|---|---|"""
_LONGEST = 100


def licence(found: Distribution) -> str:
    """Return what a distribution says of its licence: expression, classifiers, or free text."""
    fields = found.metadata
    expression = fields.get('License-Expression')
    if expression:
        return str(expression)
    classified = [entry.rpartition(' :: ')[2] for entry in fields.get_all('Classifier') or ()
                  if entry.startswith('License ::') and not entry.endswith('OSI Approved')]
    if classified:
        return ', '.join(classified)
    text = str(fields.get('License') or '').strip().splitlines()
    return text[0][:_LONGEST] if text and text[0] != 'UNKNOWN' else 'not said'


def main() -> None:
    """Print the table."""
    names = sorted({name for lock in LOCKS
                    for name, _ in parse((HERE / lock).read_text(encoding='utf-8'))})
    print(_HEAD)
    for name in names:
        try:
            found = distribution(name)
        except PackageNotFoundError:
            continue
        print(f'| {name} | {found.version} | {licence(found)} |')


if __name__ == '__main__':
    main()
