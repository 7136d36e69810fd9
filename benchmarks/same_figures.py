# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Compare the figures of two results folders to the last digit: python same_figures.py A B.

For changes that must not change a figure. Rows of summary.json, cells.jsonl and report.json are
paired by what tells them apart, so B may hold a part of A; durations, versions and keys do not
count. A search may have its name under "perturbation", as it once had. Prints what
differs, and ends with 1 if anything does or if nothing could be compared.
"""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
import sys
from typing import Any

# What a row is of, in any kind of results.
IDENTITY = ('sequence', 'target', 'asked_target', 'protocol', 'attack', 'method', 'surrogate',
            'oracle', 'mode', 'ratio', 'edits', 'queries_per_edit', 'nodes', 'threshold',
            'variant', 'seed', 'name')
# What may differ between two runs of one thing, or is told by other columns.
LEFT_OUT = ('key', 'versions', 'environment', 'created', 'command_line', 'search',
            'perturbation', 'geometric_check', 'defences', 'code', 'schema', 'duration_s',
            'query_s', 'search_s', 'judge_s')
SEARCHES = ('recall', 'optimum')


def rows_of(folder: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the rows of a folder with the name of their file."""
    for path in sorted(folder.glob('*.json*')):
        if path.suffix == '.jsonl':
            for line in path.read_text(encoding='utf-8').splitlines():
                entry = json.loads(line)
                yield path.name, entry.get('row', entry)
        elif path.name in ('summary.json', 'report.json'):
            content = json.loads(path.read_text(encoding='utf-8'))
            for values in [content, *content.values()] if isinstance(content, dict) else [content]:
                if isinstance(values, list):
                    yield from ((path.name, row) for row in values if isinstance(row, dict))


def identity(file: str, row: dict[str, Any]) -> tuple[str, ...]:
    """Return what tells a row from others, old names of searches mapped."""
    perturbation, search = row.get('perturbation', ''), row.get('search', '')
    method = perturbation if search in ('', 'stepwise') else search
    surrogate = '' if method in SEARCHES else row.get('surrogate', '')
    known = {**row, 'method': method, 'surrogate': surrogate}
    return (file, *(str(known.get(name, '')) for name in IDENTITY))


def figures(value: Any, path: str = '') -> Iterator[tuple[str, Any]]:
    """Yield every figure and outcome below a value, with where it is."""
    if isinstance(value, dict):
        for name, part in value.items():
            if name not in LEFT_OUT and name != 'surrogate':
                yield from figures(part, f'{path}.{name}')
    elif isinstance(value, list):
        for place, part in enumerate(value):
            yield from figures(part, f'{path}[{place}]')
    else:
        yield path, value


def main(one: str, other: str) -> int:
    """Print what differs; return the exit code."""
    first, second = ({identity(*entry): entry[1] for entry in rows_of(Path(folder))}
                     for folder in (one, other))
    common = [key for key in first if key in second]
    count = differing = 0
    for key in common:
        here, there = dict(figures(first[key])), dict(figures(second[key]))
        for name in sorted(here.keys() & there.keys()):
            count += 1
            if here[name] != there[name]:
                differing += 1
                print(f'{" ".join(filter(None, key))}{name}: {here[name]!r} -> {there[name]!r}')
    print(f'{len(common)} rows in both ({len(first)} and {len(second)}), {count} values, '
          f'{differing} differ')
    return int(bool(differing) or not count)


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:3]))
