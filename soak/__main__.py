"""``python -m soak``: run all faults and write docs/reliability.md (make soak)."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
import importlib.util
import os
from pathlib import Path
import platform
import sys
import tempfile
import time

import cv2
import numpy as np

from adversarial_lcd_ros import __version__
from soak import nodes, offline, processes
from soak.outcome import Outcome

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'reliability.md'
_HEAD = """\
# Reliability

What is promised under faults, and what came of it, by `make soak` (an hour at scale 1; `make test`
runs a short form). Version {version}, Python {python}, {cores} cores, {minutes:.0f} minutes, scale
{scale:g} of all counts and times, {date}; load of the machine at the end: {load:.0f}.

Memory: slope of the resident size over the later three quarters of a run, with the 95 % interval
of a straight line through up to sixty samples. A stream of graphs fills the 300 keyframes that
its detector may remember before memory can be flat.

| fault | promise | tried | outcome | broken | note |
|---|---|---|---|---|---|
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


def faults(work: Path, scale: float) -> Iterator[Callable[[], Outcome]]:
    """Yield what there is to run; a scale of 1 takes an hour at most."""
    def some(count: int) -> int:
        return max(round(count * scale), 2)

    def room(name: str) -> Path:
        folder = work / name
        folder.mkdir()
        return folder

    source = pictures(work / 'pictures')
    yield lambda: offline.fuzz_codec(some(1_000_000))
    yield lambda: offline.fuzz_files(some(20_000), room('files'))
    yield lambda: offline.fuzz_config(some(100_000))
    yield lambda: offline.fuzz_imports(some(2000), source, room('imports'))
    yield lambda: processes.full_disk(some(60), source, room('full'))
    yield lambda: processes.killed(some(60), source, room('killed'))
    yield lambda: processes.two_at_once(some(10), source, room('two'))
    if importlib.util.find_spec('rclpy') is None:
        return
    for node in ('lcd', 'attacker'):
        yield lambda node=node: nodes.flood(node, some(20_000))
    for size in (300, 1000):
        for rate_hz in (30.0, 300.0):
            yield lambda size=size, rate_hz=rate_hz: nodes.stream(
                size, rate_hz, max(600 * scale, 2.0))


def row(outcome: Outcome) -> str:
    """Return a fault as a row of the table."""
    kinds = '; '.join(f'{name}: {count:,}' for name, count in sorted(outcome.outcomes.items()))
    return (f'| {outcome.fault} | {outcome.promise} | {outcome.tried:,} | {kinds} | '
            f'{outcome.broken or "none"} | {outcome.note} |')


def main(argv: Sequence[str] | None = None) -> int:
    """Run all faults; exit code 1 if a promise was broken."""
    parser = argparse.ArgumentParser(prog='make soak', description=__doc__)
    parser.add_argument('--scale', type=float, default=1.0,
                        help='fraction of all counts and times (default: %(default)s, an hour)')
    parser.add_argument('--output', type=Path, default=PAGE)
    options = parser.parse_args(argv)
    began, rows, broken = time.monotonic(), [], 0
    with tempfile.TemporaryDirectory(prefix='soak-') as folder:
        for run in faults(Path(folder), options.scale):
            outcome = run()
            rows.append(row(outcome))
            broken += outcome.broken
            print(rows[-1], file=sys.stderr, flush=True)
    head = _HEAD.format(version=__version__, python=platform.python_version(),
                        cores=os.cpu_count(), scale=options.scale,
                        load=os.getloadavg()[2],
                        minutes=(time.monotonic() - began) / 60, date=time.strftime('%Y-%m-%d'))
    options.output.write_text(head + '\n'.join(rows) + '\n', encoding='utf-8')
    return 1 if broken else 0


if __name__ == '__main__':
    sys.exit(main())
