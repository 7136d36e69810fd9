# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is wrong with a bag that cannot be read, and what helps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
import shlex

METADATA = 'metadata.yaml'
_MCAP_MAGIC = b'\x89MCAP0\r\n'
_STORAGE_NAMES = {'.mcap': 'mcap', '.db3': 'sqlite3'}


def _has_mcap_end(file: Path) -> bool:
    with file.open('rb') as stream:
        stream.seek(-len(_MCAP_MAGIC), 2)
        return stream.read() == _MCAP_MAGIC


def _has_all_pages(file: Path) -> bool:
    with file.open('rb') as stream:
        header = stream.read(32)
    # Sizes of a page (1 stands for 65536) and of the database, in pages; 0: not told.
    page = int.from_bytes(header[16:18], 'big')
    pages = int.from_bytes(header[28:32], 'big')
    return file.stat().st_size >= (65536 if page == 1 else page) * pages


@dataclass(frozen=True)
class _Kind:
    """A kind of file: how it starts, whether its end is there, and what mends it."""

    name: str
    magic: bytes
    is_whole: Callable[[Path], bool]
    remedy: str

    def mend(self, file: Path) -> str:
        """Return the line that mends a file."""
        return self.remedy.format(file=shlex.quote(str(file)))


_KINDS = {
    '.bag': _Kind('bag of ROS 1', b'#ROSBAG V', lambda file: True,
                  'repair it with "rosbag reindex {file}"'),
    '.mcap': _Kind('MCAP', _MCAP_MAGIC, _has_mcap_end,
                   'repair it with "mcap recover {file} -o whole.mcap" and import whole.mcap'),
    '.db3': _Kind('database of SQLite', b'SQLite format 3\0', _has_all_pages,
                  'repair it with "sqlite3 {file} .recover | sqlite3 whole.db3" and import '
                  'whole.db3'),
}
_START_BYTES = 16


def diagnose(path: Path, detail: str) -> str:
    """
    Return why a bag cannot be read, and what to do.

    Parameters
    ----------
    path : Path
        File, or folder of a rosbag2.
    detail : str
        What the reader said.

    """
    if not path.is_dir():
        return _diagnose_file(path) or _damaged(path, detail)
    files = [file for file in sorted(path.iterdir())
             if file.suffix in _STORAGE_NAMES and not file.name.startswith('.')]
    for file in files:
        found = _diagnose_file(file)
        if found:
            return f'its file {file.name}: {found}'
    names = ', '.join(map(str, files)) or 'none'
    storage = _STORAGE_NAMES[files[0].suffix] if files else 'mcap'
    reindex = f'"ros2 bag reindex -s {storage} {shlex.quote(str(path))}"'
    if not (path / METADATA).is_file():
        return (f'it has no {METADATA}, as after a recording that was not ended: import its file '
                f'itself ({names}), or write the metadata with {reindex}')
    return (f'{detail}: if it is {METADATA} that is damaged, import the file itself ({names}), or '
            f'write the metadata again with {reindex}; else get it again')


def missing_messages(path: Path, found: int, expected: int, topics: str) -> str:
    """Return what to say where a bag holds fewer messages than it promises."""
    where = METADATA if path.is_dir() else 'its index'
    remedy = (_KINDS[path.suffix].mend(path) if path.suffix in _KINDS else
              f'take what is there with "ros2 bag reindex {shlex.quote(str(path))}"')
    return (f'bag {path} is truncated: {found} of {expected} messages on {topics} that {where} '
            f'promises could be read; get it again, or {remedy}')


def unfinished_log(file: Path) -> Path | None:
    """Return the log in which SQLite keeps what is not in its database yet, if there is one."""
    log = file.with_name(f'{file.name}-wal')
    return log if log.is_file() and log.stat().st_size else None


def _diagnose_file(file: Path) -> str:
    """Return what is wrong with a file as such, and what to do; '' if nothing can be seen."""
    kind = _KINDS.get(file.suffix)
    if kind is None:
        return ''
    if not file.stat().st_size:
        return 'it is empty (0 bytes): get it again'
    with file.open('rb') as stream:
        start = stream.read(_START_BYTES)
    if not start.startswith(kind.magic[:len(start)]):
        return f'it is no {kind.name}: it starts with {start!r}; get it again'
    log = unfinished_log(file)
    if log is not None:
        return (f'its recording was not ended, and a part of it is in {log.name}: put it in with '
                f'"sqlite3 {shlex.quote(str(file))} \'PRAGMA wal_checkpoint(TRUNCATE)\'"')
    if len(start) < _START_BYTES or not kind.is_whole(file):
        return (f'it is truncated, or was not closed ({file.stat().st_size} bytes, its end is '
                f'missing): get it again, or {kind.mend(file)}')
    return ''


def _damaged(file: Path, detail: str) -> str:
    remedy = _KINDS[file.suffix].mend(file) if file.suffix in _KINDS else ''
    return (f'{detail}: it is truncated, damaged, or was not closed; get it again'
            f'{", or " if remedy else ""}{remedy}')
