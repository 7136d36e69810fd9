# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Evaluations that were broken off: their finished runs are not run again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
import fcntl
import json
import os
from pathlib import Path
from typing import Any

from adversarial_lcd_ros.config import Config
from adversarial_lcd_ros.environment import code_digest, environment, named_code_digest
from adversarial_lcd_ros.evaluation.results import PARTIAL, ResultsFolder
from adversarial_lcd_ros.files.digests import digest_of

RECORDINGS = 'recordings'
_PLAN, _FINISHED = 'plan.json', 'finished.json'
_BY_NAME = ('target', 'search', 'perturbation', 'surrogate', 'defences')
# What the nodes of a run are made of: a change in a report does not make runs anew.
_ROOMS = ('nodes', 'lcd', 'attack', 'vision', 'keyframes', 'compiled', 'weisfeiler_lehman',
          'sequences', 'poses', 'graph_sequences', 'messages', 'graph', 'edge_rule', 'config')


def plan_digest(bag: Path, sections: Mapping[str, Config | None], rebuild: bool) -> str:
    """
    Return a digest of all that decides what the runs of an evaluation give, hexadecimal.

    Bag, settings, the files that settings name, releases of libraries, and the code of this
    package; files by name, size and time.

    Parameters
    ----------
    bag : Path
    sections : mapping of str to Config or None
    rebuild : bool

    """
    settings = {name: asdict(section) if section else None for name, section in sections.items()}
    named = {value for section in settings.values() if section for value in section.values()
             if value and isinstance(value, str) and Path(value).exists()}
    # Targets and attacks of the user's own go by module and class.
    own = sorted({part.strip() for section in settings.values() if section
                  for name, value in section.items() if name in _BY_NAME
                  for part in value.split(',') if ':' in part})
    here = environment()
    parts = {'settings': settings, 'order': list(sections), 'rebuild': rebuild,
             'files': {path: _stamps(Path(path)) for path in sorted({str(bag.resolve()), *named})},
             'python': here['python'], 'versions': here['versions'],
             'code': [code_digest(*_ROOMS), *(named_code_digest(name) for name in own)]}
    return digest_of(json.dumps(parts, sort_keys=True).encode())


def _stamps(path: Path) -> list[tuple[str, int, int]]:
    files = sorted(path.rglob('*')) if path.is_dir() else [path]
    stats = [(str(file), file.stat()) for file in files if file.is_file()]
    return [(name, stat.st_size, stat.st_mtime_ns) for name, stat in stats]


@contextmanager
def results_folder(output: Path, digest: str) -> Iterator[ResultsFolder]:
    """
    Hold an unfinished folder of the same plan for this process alone, or else a new one.

    Raises
    ------
    EvaluationError
        No folder can be made.

    """
    folder, lock = _resumed(output, digest) or _new(output, digest)
    try:
        yield folder
    finally:
        os.close(lock)


def _resumed(output: Path, digest: str) -> tuple[ResultsFolder, int] | None:
    for path in unfinished_folders(output):
        lock = hold(path)
        if lock is None:
            continue
        if _read(path / RECORDINGS / _PLAN).get('digest') == digest:
            return ResultsFolder(path), lock
        os.close(lock)
    return None


def _new(output: Path, digest: str) -> tuple[ResultsFolder, int]:
    while True:
        folder = ResultsFolder.create(output)
        lock = hold(folder.path)
        if lock is not None:
            break
    (folder.path / RECORDINGS).mkdir()
    _write(folder.path / RECORDINGS / _PLAN, {'digest': digest})
    return folder, lock


def unfinished_folders(output: Path) -> list[Path]:
    """Return the results folders in a folder that are not complete, the oldest first."""
    return sorted(path for path in output.glob(f'*{PARTIAL}')
                  if path.is_dir() and not path.is_symlink())


def hold(path: Path) -> int | None:
    """Lock a folder; return the descriptor that holds it, None if another process does."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    except OSError:
        return None  # finished or cleared away just now
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


def mark_finished(run: Path, spent_s: float) -> None:
    """Note that the recording of a run is complete and was found right."""
    _write(run / _FINISHED, {'spent_s': spent_s})


def finished_in_s(run: Path) -> float | None:
    """Return how long a run took; None if it is not finished."""
    spent = _read(run / _FINISHED).get('spent_s')
    return float(spent) if isinstance(spent, (int, float)) else None


def _write(path: Path, values: Mapping[str, Any]) -> None:
    draft = path.with_name(f'.{path.name}')
    draft.write_text(json.dumps(values), encoding='utf-8')
    draft.replace(path)


def _read(path: Path) -> dict[str, Any]:
    """Return what is there; nothing where it is missing or damaged: then all runs anew."""
    try:
        values = json.loads(path.read_text(encoding='utf-8'))
    except (OSError, ValueError):
        return {}
    return values if isinstance(values, dict) else {}
