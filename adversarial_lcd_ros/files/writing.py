# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Files that appear under their name complete, or not at all.

Each is written beside its place and moved there: what was there before stays whole until then, a
full disk leaves nothing half done, and where the place is a link, the link is replaced and what
it leads to is left alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import csv
import json
import math
import os
from pathlib import Path
from typing import IO, Any

from adversarial_lcd_ros.errors import FileError

# What makes a spreadsheet take a cell for a formula (or look for one behind it).
_FORMULA = ('=', '+', '-', '@', '\t', '\r')


@contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """
    Yield a stream whose bytes become the file when the block ends without an error.

    Raises
    ------
    FileError
        The place cannot be written, or the disk is full.

    """
    draft = path.with_name(f'.{path.name}.{os.getpid()}.partial')
    try:
        draft.unlink(missing_ok=True)
        # Exclusive: nothing that waits under this name, such as a link, is written to.
        with draft.open('xb') as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        draft.replace(path)
    except OSError as error:
        raise FileError(f'{path} cannot be written ({error.strerror}): make room, or choose '
                        'another place, and run the same command again; finished files are kept'
                        ) from error
    finally:
        _remove(draft)


def _remove(draft: Path) -> None:
    try:
        draft.unlink(missing_ok=True)
    except OSError:
        pass  # where the folder cannot be written there is no draft either


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file as ``replacing`` does; raises FileError."""
    with replacing(path) as stream:
        stream.write(data)


def write_text(path: Path, text: str) -> None:
    """Write a text in UTF-8 as ``replacing`` does; raises FileError."""
    write_bytes(path, text.encode('utf-8', 'backslashreplace'))


def write_json(path: Path, values: Mapping[str, Any] | Sequence[Any]) -> None:
    """Write JSON as ``replacing`` does; what is not a finite number becomes null."""
    write_text(path, json_text(values))


def json_text(values: Mapping[str, Any] | Sequence[Any]) -> str:
    """Return values as JSON; what is not a finite number becomes null."""
    return json.dumps(_plain(values), indent=2, allow_nan=False) + '\n'


def _plain(value: Any) -> Any:
    # numpy scalars to Python's, NaN and infinity to None.
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if hasattr(value, 'item') and not isinstance(value, (str, bytes)):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def write_csv(path: Path, names: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> None:
    """
    Write a CSV file with a header as ``replacing`` does; None becomes an empty cell.

    A text that a spreadsheet would take for a formula gets an apostrophe in front; numbers stay
    numbers, truth becomes 1 or 0.

    Raises
    ------
    FileError
        The place cannot be written.

    """
    with replacing(path) as stream:
        lines = _Lines(stream)
        writer = csv.writer(lines)
        writer.writerow(names)
        for row in rows:
            writer.writerow([_cell(row.get(name)) for name in names])


class _Lines:
    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream

    def write(self, text: str) -> None:
        self._stream.write(text.encode('utf-8', 'backslashreplace'))


def _cell(value: Any) -> Any:
    if isinstance(value, bool):
        return int(value)
    if isinstance(value, str) and value.lstrip("'").startswith(_FORMULA):
        return f"'{value}"
    return value


def plain_cell(text: str) -> str:
    """Return what a cell was before ``write_csv`` put an apostrophe in front, if it did."""
    if text.startswith("'") and text.lstrip("'").startswith(_FORMULA):
        return text[1:]
    return text
