# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``python -m soak``: run all faults and write docs/reliability.md (make soak)."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
import importlib.util
import itertools
import os
from pathlib import Path
import platform
import sys
import tempfile
import time

import cv2
import numpy as np

from adversarial_lcd_ros import __version__
from soak import forgery, nodes, offline, processes
from soak.outcome import Outcome

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'reliability.md'
GROUPS = ('payloads', 'files', 'commands', 'messages', 'rates')
_HEAD = f"""\
# Reliability

What is promised under faults, and what came of it, by `make soak` (an hour; `make test` runs a
short form). Version {__version__}, Python {platform.python_version()}, {os.cpu_count()} cores.
Each row says when it was run, for how long, and how busy the machine was with other work (load
average); `--scale` makes counts and times of a group smaller, `--only` runs some groups and keeps
the rows of the others.

Memory: slope of the resident size over the later three quarters of its samples, with the 95 %
interval of a straight line. A detector is measured from when it remembers as many keyframes as it
may: until then memory grows by what it is there to remember.

| fault | promise | tried | outcome | broken | note | run |
|---|---|---|---|---|---|---|
"""


def pictures(folder: Path, count: int = 12) -> Path:
    """Write a folder in TUM's layout: some pictures of noise and their poses."""
    (folder / 'rgb').mkdir(parents=True)
    rng = np.random.default_rng(3)
    images, poses = ['# timestamp filename'], ['# timestamp tx ty tz qx qy qz qw']
    for number in range(count):
        stamp = f'{1000 + number / 30:.6f}'
        cv2.imwrite(str(folder / 'rgb' / f'{stamp}.png'),
                    rng.integers(0, 256, (60, 80, 3)).astype(np.uint8))
        images.append(f'{stamp} rgb/{stamp}.png')
        poses.append(f'{stamp} {number} 0 0 0 0 0 1')
    (folder / 'rgb.txt').write_text('\n'.join(images), encoding='utf-8')
    (folder / 'groundtruth.txt').write_text('\n'.join(poses), encoding='utf-8')
    return folder


def faults(work: Path, scales: Mapping[str, float]) -> Iterator[Callable[[], Outcome]]:
    """Yield what there is to run, by the scales of the groups; all at 1 take an hour at most."""
    def some(group: str, count: int) -> int:
        return max(round(count * scales[group]), 2)

    def room(name: str) -> Path:
        folder = work / name
        folder.mkdir()
        return folder

    source = pictures(work / 'pictures')
    if 'payloads' in scales:
        yield lambda: offline.fuzz_codec(some('payloads', 1_000_000))
        yield lambda: forgery.forge(some('payloads', 1_000_000))
    if 'files' in scales:
        yield lambda: offline.fuzz_files(some('files', 20_000), room('files'))
        yield lambda: offline.fuzz_config(some('files', 100_000))
        yield lambda: offline.fuzz_imports(some('files', 2000), source, room('imports'))
    if 'commands' in scales:
        for name, command in processes.commands(source, work).items():
            for fault in (processes.full_disk, processes.killed, processes.two_at_once):
                yield lambda command=command, name=name, fault=fault: fault(
                    name, command, some('commands', processes.COUNTS[fault.__name__]),
                    room(f'{fault.__name__}_{name}'))
    if importlib.util.find_spec('rclpy') is None:
        return
    for node in nodes.NODES if 'messages' in scales else ():
        yield lambda node=node: nodes.flood(node, some('messages', 20_000))
    for size, rate_hz in itertools.product((300, 1000), (30.0, 300.0)):
        if 'rates' in scales:
            yield lambda size=size, rate_hz=rate_hz: nodes.stream(
                size, rate_hz, max(600 * scales['rates'], 2.0))


def row(outcome: Outcome, run: str = '') -> str:
    """Return a fault as a row of the table."""
    kinds = '; '.join(f'{name}: {count:,}' for name, count in sorted(outcome.outcomes.items()))
    return (f'| {outcome.fault} | {outcome.promise} | {outcome.tried:,} | {kinds} | '
            f'{outcome.broken or "none"} | {outcome.note} | {run} |')


def keep(page: Path, made: str) -> None:
    """Put a row into the page, in place of the earlier one of the same fault."""
    lines = page.read_text(encoding='utf-8').splitlines() if page.is_file() else []
    rows = {_fault(line): line for line in lines if line.startswith('| ')}
    rows.pop('fault', None)
    rows[_fault(made)] = made
    page.write_text(_HEAD + '\n'.join(rows.values()) + '\n', encoding='utf-8')


def _fault(line: str) -> str:
    return line.split('|')[1].strip()


def _scales(options: argparse.Namespace) -> dict[str, float]:
    given = dict.fromkeys(options.only, options.scale)
    for text in options.scale_of:
        group, _, number = text.partition('=')
        given[group] = float(number)
    return given


def main(argv: Sequence[str] | None = None) -> int:
    """Run faults; exit code 1 if a promise was broken."""
    parser = argparse.ArgumentParser(prog='make soak', description=__doc__)
    parser.add_argument('--scale', type=float, default=1.0,
                        help='fraction of all counts and times (default: %(default)s, an hour)')
    parser.add_argument('--scale-of', nargs='+', default=[], metavar='GROUP=NUMBER',
                        help='another fraction for some groups')
    parser.add_argument('--only', nargs='+', default=GROUPS, choices=GROUPS, metavar='GROUP',
                        help=f'groups to run: {" ".join(GROUPS)} (default: all)')
    parser.add_argument('--output', type=Path, default=PAGE)
    options = parser.parse_args(argv)
    broken = 0
    with tempfile.TemporaryDirectory(prefix='soak-') as folder:
        for run in faults(Path(folder), _scales(options)):
            began = time.monotonic()
            outcome = run()
            made = row(outcome, f'{time.strftime("%Y-%m-%d %H:%M")}, '
                       f'{time.monotonic() - began:.0f} s, load {os.getloadavg()[1]:.0f}')
            keep(options.output, made)
            broken += outcome.broken
            print(made, file=sys.stderr, flush=True)
    return 1 if broken else 0


if __name__ == '__main__':
    sys.exit(main())
