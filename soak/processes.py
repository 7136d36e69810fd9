# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of whole commands: a full disk, kill -9, two at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import importlib.util
import json
import os
from pathlib import Path
import resource
import shutil
import signal
import subprocess
import sys
import time

import numpy as np

from soak.outcome import Outcome

COUNTS = {'full_disk': 30, 'killed': 30, 'two_at_once': 5}
ROOT = Path(__file__).resolve().parents[1]
_TIMEOUT_S = 600.0
_GONE_S = 60.0
# All that a trial starts has it in its environment, and is found by it.
_MARK = 'ADVERSARIAL_LCD_SOAK'
_TOUR = ROOT / 'bags' / 'flat_tour'
_SMALL = ('--builder-detector', 'none', '--builder-features', 60,
          '--builder-detected-features', 120)
_FRAMES = """\
protocol: frames
seeds: 1
frames: 1
defaults: {target: vbow, perturbation: random_flip, surrogate: none, queries_per_edit: 2}
attacks: [{ratio: 1e-3}, {ratio: 2e-3}, {ratio: 3e-3}]
"""
_LIVE = """\
attacks:
  - {name: walk, perturbation: random_walk, surrogate: none, max_queries: 4}
"""


@dataclass(frozen=True)
class Command:
    """
    A command, and what it leaves.

    Attributes
    ----------
    arguments : tuple
        With OUT for what it writes and CACHE for its cache.
    is_whole : callable
        Tells whether the result is there, complete.
    is_honest : callable
        Tells whether what bears a final name is complete, also when there is no result yet.
    two : tuple of str
        Exit codes, sorted, of two at once.

    """

    arguments: tuple[object, ...]
    is_whole: Callable[[Path], bool]
    is_honest: Callable[[Path], bool]
    two: tuple[str, str] = ('0', '2')

    def start(self, out: Path, mark: str = '', most_bytes: int | None = None
              ) -> subprocess.Popen[str]:
        """Start the command; a file beyond so many bytes fails, as on a full disk."""
        def limit() -> None:
            if most_bytes is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, most_bytes))
        places = {'OUT': out, 'CACHE': out.with_name(f'{out.name}_cache')}
        given = [str(places.get(str(part), part)) for part in self.arguments]
        return subprocess.Popen(
            [sys.executable, '-m', 'adversarial_lcd_ros.cli', *given], cwd=ROOT, text=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, preexec_fn=limit,
            start_new_session=True, env={**os.environ, _MARK: mark})


def commands(source: Path, work: Path) -> dict[str, Command]:
    """Return commands by name; those with nodes only where there is ROS."""
    frames, live = work / 'frames.yaml', work / 'live.yaml'
    frames.write_text(_FRAMES, encoding='utf-8')
    live.write_text(_LIVE, encoding='utf-8')
    builder = ('--detector', 'none', '--features', 40, '--detected-features', 80)
    found = {
        'import': Command(('import', source, 'OUT'), _is_bag, _nothing_or(_is_bag)),
        'build': Command(('build', source, 'OUT', '--cache', 'CACHE', *builder),
                         _is_bag, _nothing_or(_is_bag)),
        'train': Command(('train', _TOUR, '--output', 'OUT', '--vocabulary',
                          ROOT / 'adversarial_lcd_ros' / 'models' / 'vocabulary.npz', '--targets',
                          'vbow', '--pairs', 20, '--flips-per-frame', 0), _is_model,
                         _nothing_or(_is_model)),
        'targets': Command(('targets', _TOUR, '--output', 'OUT', '--cache', 'CACHE', '--targets',
                            'vbow', 'edges', '--protocols', 'pairs', '--nodes', 60, '--pairs', 20,
                            '--draws', 1, '--jobs', 2, '--builder-detector', 'none'),
                           _is_summed, _are_rows),
        'evaluate, frames': Command(('evaluate', _TOUR, '--recipe', frames, '--output', 'OUT',
                                     '--cache', 'CACHE', '--jobs', 2, *_SMALL),
                                    _is_summed, _are_rows)}
    if importlib.util.find_spec('rclpy') is not None:
        found['evaluate, nodes'] = Command(
            ('evaluate', _TOUR, '--recipe', live, '--output', 'OUT', '--replay-stride', 40,
             *_SMALL), _is_evaluated, _are_evaluations, two=('0', '0'))
    return found


def _is_bag(out: Path) -> bool:
    return (out / 'metadata.yaml').is_file()


def _is_model(out: Path) -> bool:
    return _is_json(out / 'MODEL_CARD.json')


def _is_summed(out: Path) -> bool:
    return _is_json(out / 'summary.json') and _are_rows(out)


def _are_rows(out: Path) -> bool:
    """Tell whether all JSON can be read; of rows only the last may be cut off."""
    rows = out / 'cells.jsonl'
    lines = rows.read_text(encoding='utf-8').split('\n')[:-1] if rows.is_file() else []
    return all(map(_is_text, lines)) and all(map(_is_json, out.glob('*.json')))


def _is_evaluated(out: Path) -> bool:
    return bool(_evaluations(out)) and _are_evaluations(out)


def _are_evaluations(out: Path) -> bool:
    return all(_is_json(folder / 'summary.json') and (folder / 'report.html').is_file()
               for folder in _evaluations(out))


def _evaluations(out: Path) -> list[Path]:
    return [folder for folder in (out.iterdir() if out.is_dir() else ())
            if folder.is_dir() and folder.suffix != '.partial']


def _nothing_or(is_whole: Callable[[Path], bool]) -> Callable[[Path], bool]:
    return lambda out: not out.exists() or is_whole(out)


def _is_json(path: Path) -> bool:
    return path.is_file() and _is_text(path.read_text(encoding='utf-8'))


def _is_text(text: str) -> bool:
    try:
        json.loads(text)
    except ValueError:
        return False
    return True


def _ended(command: Command, process: subprocess.Popen[str], out: Path) -> str:
    """Return in words how a command ended that should have done all, or said why not."""
    _, said = process.communicate(timeout=_TIMEOUT_S)
    if process.returncode not in (0, 2):
        return f'BROKEN exit code {process.returncode}'
    if 'Traceback' in said:
        return 'BROKEN traceback'
    if not command.is_honest(out):
        return 'BROKEN half a result'
    if process.returncode == 0:
        return 'done' if command.is_whole(out) else 'BROKEN exit code 0, and no result'
    lines = said.splitlines() or ['']
    return 'one line, exit 2' if lines[-1].startswith('error: ') else f'BROKEN {lines[-1][:60]}'


def full_disk(name: str, command: Command, count: int, work: Path, seed: int = 0) -> Outcome:
    """Run a command that may write files of so many bytes only; then run it again without."""
    outcome = Outcome(f'full disk, at any byte, under "{name}"',
                      'done, or one line and exit 2, nothing half made; then it can be done')
    rng = np.random.default_rng(seed)
    for number in range(count):
        out = work / f'full_{number}'
        ended = _ended(command, command.start(out, most_bytes=int(2 ** rng.uniform(0, 20))), out)
        outcome.outcomes[ended] += 1
        if ended.startswith('one line') and number % 5 == 0:
            again = _ended(command, command.start(out), out)
            outcome.outcomes[f'{again} with room' if again == 'done' else f'BROKEN {again}'] += 1
        _clear(out)
    outcome.note = _left(work)
    return outcome


def killed(name: str, command: Command, count: int, work: Path, seed: int = 0) -> Outcome:
    """End a command by kill -9 at random moments, see that all of it ends, and run it again."""
    outcome = Outcome(f'kill -9 of "{name}" at random moments, then the same again',
                      'its processes end with it, nothing half made; the second run does it')
    rng, out = np.random.default_rng(seed), work / 'first'
    began = time.monotonic()
    outcome.outcomes[_ended(command, command.start(out), out)] += 1
    usual_s = time.monotonic() - began
    _clear(out)
    for number in range(count):
        out, mark = work / f'killed_{number}', f'{os.getpid()}-{name}-{number}'
        process = command.start(out, mark)
        try:
            process.wait(float(rng.uniform(0.0, usual_s)))
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
        process.wait()
        outcome.outcomes[_left_after(command, mark, out) or _again(command, out)] += 1
        if process.stderr:
            process.stderr.close()
        _clear(out)
    outcome.note = _left(work)
    return outcome


def _again(command: Command, out: Path) -> str:
    """Run a command that was killed again; return what came of it."""
    was_whole = command.is_whole(out)
    again = _ended(command, command.start(out), out)
    if was_whole and again in ('done', 'one line, exit 2'):
        return 'was done when it was killed'
    return 'done by the second run' if again == 'done' else f'BROKEN {again}'


def _left_after(command: Command, mark: str, out: Path) -> str:
    """Return what is wrong after a command was killed; '' if nothing is."""
    end = time.monotonic() + _GONE_S
    while left := processes_with(mark):
        if time.monotonic() > end:
            for process in left:
                os.kill(process, signal.SIGKILL)
            return f'BROKEN {len(left)} processes lived on'
        time.sleep(0.05)
    return '' if command.is_honest(out) else 'BROKEN half a result'


def processes_with(mark: str) -> list[int]:
    """Return the processes that a trial has started, and that live."""
    wanted, found = f'{_MARK}={mark}'.encode(), []
    for folder in Path('/proc').glob('[0-9]*'):
        try:
            if wanted in (folder / 'environ').read_bytes().split(b'\0'):
                found.append(int(folder.name))
        except OSError:  # ended, or not ours
            continue
    return found


def two_at_once(name: str, command: Command, count: int, work: Path) -> Outcome:
    """Run a command twice at once, to one place."""
    outcome = Outcome(f'two of the same "{name}" at once, to one place',
                      'both are done, each in a folder of its own' if command.two == ('0', '0')
                      else 'one does it, the other says that it is there')
    for number in range(count):
        out = work / f'two_{number}'
        both = [command.start(out) for _ in range(2)]
        codes = []
        for process in both:
            _, said = process.communicate(timeout=_TIMEOUT_S)
            codes.append(str(process.returncode) if 'Traceback' not in said else 'traceback')
        kept = command.is_whole(out) and tuple(sorted(codes)) == command.two
        outcome.outcomes['as promised' if kept else
                         f'BROKEN exit codes {" and ".join(codes)}'] += 1
        _clear(out)
    return outcome


def _clear(out: Path) -> None:
    for path in (out, out.with_name(f'{out.name}_cache')):
        shutil.rmtree(path, ignore_errors=True)


def _left(work: Path) -> str:
    left = [path for path in work.iterdir() if path.name.endswith('.partial')]
    for path in left:
        shutil.rmtree(path, ignore_errors=True)
    return f'hidden .partial folders left behind: {len(left)}'
