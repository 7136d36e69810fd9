# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""cells.jsonl: the finished cells of an evaluation by frames, one a line, only appended to."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
import fcntl
import json
import logging
import os
from pathlib import Path
from typing import Any

from adversarial_lcd_ros.errors import EvaluationError, FileError
from adversarial_lcd_ros.files.reading import MIB, parse_json, read_bytes

CELLS = 'cells.jsonl'
Row = dict[str, Any]  # one line of it, or of summary.json: column to value
_LOCK = '.lock'
_MAX_BYTES = 2048 * MIB
_log = logging.getLogger(__name__)

Columns = Mapping[str, tuple[type, ...]]


class CellStore:
    """
    Rows by their keys, on disk as soon as they are added.

    Made by ``open_store``, which sees that nobody else writes.

    Attributes
    ----------
    path : Path
    rows : dict
        Key to row, in the order in which cells were finished.

    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows = _read_rows(path, repair=True)

    def add(self, key: str, row: Mapping[str, Any]) -> None:
        """
        Append a finished cell; it is on disk when this returns.

        Raises
        ------
        EvaluationError
            The cell is there already, or the disk is full.

        """
        if key in self.rows:
            raise EvaluationError(f'cell {key} is finished already: it is never written again')
        kept = {'key': key, **row}
        line = json.dumps(kept, allow_nan=False).encode() + b'\n'
        try:
            with self.path.open('ab', buffering=0) as stream:
                if stream.write(line) != len(line):  # one write: a line is there or cut at its end
                    raise OSError('no space left')
                os.fsync(stream.fileno())
        except OSError as error:
            raise EvaluationError(f'{self.path} cannot be written ({error}); make room and run '
                                  'the same command again: finished cells are kept') from error
        self.rows[key] = kept

    def check(self, keys: Iterable[str], columns: Columns) -> None:
        """
        Look whether rows have the columns that whoever made them writes.

        Parameters
        ----------
        keys : iterable of str
            Those that are not there do not count.
        columns : mapping
            Name to the types of its values.

        Raises
        ------
        EvaluationError
            A row lacks a column, or it is of another type.

        """
        for row in (self.rows[key] for key in keys if key in self.rows):
            wrong = [name for name, kinds in columns.items()
                     if name not in row or not isinstance(row[name], kinds)]
            if wrong:
                raise EvaluationError(
                    f'{self.path}, cell {row["key"]}: {", ".join(wrong)} is missing, or not what '
                    'it should be: delete the line, and its cell runs again')


@contextmanager
def open_store(folder: Path) -> Iterator[CellStore]:
    """
    Open the cells of a results folder, made if it is missing, for this process alone.

    Raises
    ------
    EvaluationError
        Another process has it open, it cannot be made, or cells.jsonl is damaged.

    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / _LOCK).open('a')
    except OSError as error:
        raise EvaluationError(f'{folder} is no folder for results: {error.strerror}; name '
                              'another one with --output') from error
    with lock:
        try:
            # Held by the open file: the system frees it however this process ends.
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise EvaluationError(f'another process is writing to {folder}: wait for it, or name '
                                  'another folder with --output') from error
        yield CellStore(folder / CELLS)


def read_cells(folder: Path) -> list[dict[str, Any]]:
    """
    Return the finished cells of a results folder, also while another process adds to them.

    Raises
    ------
    EvaluationError
        There is no cells.jsonl, or it is damaged.

    """
    path = folder / CELLS
    if not path.is_file():
        raise EvaluationError(f'{folder} has no {CELLS}: it is no folder of an evaluation by '
                              'frames')
    return list(_read_rows(path, repair=False).values())


def _read_rows(path: Path, *, repair: bool) -> dict[str, dict[str, Any]]:
    if not path.exists():
        return {}
    content = read_bytes(path, _MAX_BYTES)
    whole = content.rfind(b'\n') + 1
    if whole < len(content) and repair:
        _log.warning('%s: the last line is cut off (%d bytes); dropped, its cell runs again',
                     path, len(content) - whole)
        os.truncate(path, whole)
    rows: dict[str, dict[str, Any]] = {}
    for number, line in enumerate(content[:whole].splitlines(), start=1):
        try:
            row = parse_json(line, 'the line')
            key = str(row['key'])
        except (FileError, TypeError, KeyError) as error:
            raise EvaluationError(f'{path}, line {number} is no finished cell ({error}): delete '
                                  'the line, and its cell runs again') from error
        if key in rows:
            raise EvaluationError(f'{path}, line {number}: the cell is there twice; delete one '
                                  'of the two lines')
        rows[key] = row
    return rows
