"""Faults of whole commands: a full disk, kill -9, two at once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
import resource
import shutil
import signal
import subprocess
import sys
import time

import numpy as np

from soak.outcome import Outcome

_TIMEOUT_S = 300.0
ROOT = Path(__file__).resolve().parents[1]


def _command(*arguments: object) -> list[str]:
    return [sys.executable, '-m', 'adversarial_lcd_ros.cli', *map(str, arguments)]


def commands(source: Path) -> dict[str, Sequence[object]]:
    """Return commands by name; each writes OUT, and has a cache of its own."""
    small = ('--detector', 'none', '--features', 40, '--detected-features', 80)
    return {'import': ('import', source, 'OUT'),
            'build': ('build', source, 'OUT', '--cache', 'CACHE', *small)}


def _start(arguments: Sequence[object], out: Path, *, most_bytes: int | None = None
           ) -> subprocess.Popen[str]:
    def limit() -> None:
        if most_bytes is not None:  # a write beyond it fails, as on a full disk
            resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, most_bytes))
    places = {'OUT': out, 'CACHE': out.with_name(f'{out.name}_cache')}
    return subprocess.Popen(
        _command(*(places.get(str(part), part) for part in arguments)), cwd=ROOT, text=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, preexec_fn=limit,
        start_new_session=True)


def _ended(process: subprocess.Popen[str], out: Path) -> str:
    """Return in words how a command ended that should have done all, or nothing."""
    _, said = process.communicate(timeout=_TIMEOUT_S)
    if process.returncode not in (0, 2):
        return f'BROKEN exit code {process.returncode}'
    if 'Traceback' in said:
        return 'BROKEN traceback'
    if (process.returncode == 0) != (out / 'metadata.yaml').is_file():
        return 'BROKEN exit code and bag do not agree'
    if process.returncode == 0:
        return 'done'
    return 'one line, exit 2' if said.splitlines()[-1].startswith('error: ') else 'BROKEN no line'


def full_disk(count: int, source: Path, work: Path, seed: int = 0) -> Outcome:
    """Run commands that may write files of so many bytes only."""
    outcome = Outcome('full disk, at any byte, under "import" and "build"',
                      'done, or one line and exit 2; never half a bag')
    rng, several = np.random.default_rng(seed), commands(source)
    for number in range(count):
        name = list(several)[number % len(several)]
        out = work / f'full_{number}'
        most = int(2 ** rng.uniform(0, 18))
        outcome.outcomes[f'{_ended(_start(several[name], out, most_bytes=most), out)}'] += 1
        shutil.rmtree(out, ignore_errors=True)
    outcome.note = _left(work)
    return outcome


def killed(count: int, source: Path, work: Path, seed: int = 0) -> Outcome:
    """End commands by kill -9 at random moments, and run them again."""
    outcome = Outcome('kill -9 of "import" and "build" at random moments, then the same again',
                      'no bag or a whole one; the second run does it')
    rng, several = np.random.default_rng(seed), commands(source)
    usual: dict[str, float] = {}
    for name, arguments in several.items():
        began, out = time.monotonic(), work / f'first_{name}'
        outcome.outcomes[_ended(_start(arguments, out), out)] += 1
        usual[name] = time.monotonic() - began
        shutil.rmtree(out, ignore_errors=True)
    for number in range(count):
        name = list(several)[number % len(several)]
        out = work / f'killed_{number}'
        process = _start(several[name], out)
        try:
            process.wait(float(rng.uniform(0.0, usual[name])))
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
        process.communicate()
        if out.exists() and not (out / 'metadata.yaml').is_file():
            outcome.outcomes['BROKEN half a bag'] += 1
            continue
        shutil.rmtree(out, ignore_errors=True)
        again = _ended(_start(several[name], out), out)
        outcome.outcomes['done by the second run' if again == 'done' else f'BROKEN {again}'] += 1
        shutil.rmtree(out, ignore_errors=True)
    outcome.note = _left(work)
    return outcome


def two_at_once(count: int, source: Path, work: Path) -> Outcome:
    """Run the same command twice at once, to one place."""
    outcome = Outcome('two of the same "import" or "build" at once, to one place',
                      'one does it, the other says that it is there')
    several = commands(source)
    for number in range(count):
        name = list(several)[number % len(several)]
        out = work / f'two_{number}'
        both = [_start(several[name], out) for _ in range(2)]
        codes = []
        for process in both:
            _, said = process.communicate(timeout=_TIMEOUT_S)
            codes.append(process.returncode if 'Traceback' not in said else 'traceback')
        whole = (out / 'metadata.yaml').is_file()
        outcome.outcomes['one bag, the other refused' if whole and sorted(map(str, codes))
                         == ['0', '2'] else f'BROKEN {codes}, bag {whole}'] += 1
        shutil.rmtree(out, ignore_errors=True)
    return outcome


def _left(work: Path) -> str:
    left = [path for path in work.iterdir() if path.name.endswith('.partial')]
    for path in left:
        shutil.rmtree(path, ignore_errors=True)
    return f'hidden .partial folders left behind: {len(left)}'
