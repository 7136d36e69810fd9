# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Text, JSON, JSON lines, YAML and CSV, read with bounds on size and depth.

Whatever a path names, these functions come back in bounded time and memory, with the content or
a FileError of one line. Only regular files are read: a device or a pipe may never end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import csv
from functools import partial
import json
import math
import os
from pathlib import Path
import stat
from typing import Any

import yaml

from adversarial_lcd_ros.errors import FileError

MIB = 1 << 20
MAX_YAML_BYTES, MAX_TEXT_BYTES = MIB // 2, 256 * MIB
MAX_DEPTH = 32
# Of a YAML file with its aliases written out.
MAX_YAML_NODES = 50_000
_MAX_CSV_CELL = 1 << 16


def read_private(path: Path, limit: int) -> bytes:
    """
    Return the content of a file that nobody but its owner, this user or root, can open.

    Raises
    ------
    FileError
        As ``read_bytes``; or it is somebody else's, or open to others.

    """
    return read_bytes(path, limit, check=partial(_check_private, path))


def _check_private(path: Path, status: os.stat_result) -> None:
    if status.st_uid not in (0, os.geteuid()):
        raise FileError(f'{path} belongs to user {status.st_uid}: expected a file of this user, '
                        'or of root')
    if status.st_mode & 0o077:
        raise FileError(f'{path} is open to others (mode {stat.S_IMODE(status.st_mode):03o}): '
                        f'expected 600, by "chmod 600 {path}"')


def read_bytes(path: Path, limit: int = MAX_TEXT_BYTES,
               check: Callable[[os.stat_result], None] | None = None) -> bytes:
    """
    Return the content of a regular file.

    Parameters
    ----------
    path : Path
    limit : int
        Most bytes.
    check : callable, optional
        Looks at the status of the file that was opened, and may raise.

    Raises
    ------
    FileError
        It is missing, cannot be read, is no regular file, or is larger.

    """
    try:
        # Without O_NONBLOCK, opening a pipe that nobody writes to would wait for ever.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with open(descriptor, 'rb') as stream:
            status = os.fstat(descriptor)
            if not stat.S_ISREG(status.st_mode):
                raise FileError(f'{path} is no regular file: expected one, neither a folder nor a '
                                'device or pipe')
            if check:
                check(status)
            data = stream.read(limit + 1)
    except OSError as error:
        raise FileError(f'{path} cannot be read: {error.strerror}') from error
    except ValueError as error:  # such as a NUL in the name
        raise FileError(f'{str(path)!r} is no name of a file: {error}') from error
    if len(data) > limit:
        raise FileError(f'{path} is larger than {limit} bytes, the most that is read')
    return data


def read_text(path: Path, limit: int = MAX_TEXT_BYTES) -> str:
    """Return a text in UTF-8; raises FileError."""
    try:
        return read_bytes(path, limit).decode('utf-8')
    except UnicodeDecodeError as error:
        raise FileError(f'{path} is not in UTF-8: byte {error.start} is '
                        f'0x{error.object[error.start]:02x}') from error


def read_json(path: Path, limit: int = MAX_TEXT_BYTES) -> Any:
    """
    Return the value in a JSON file.

    Raises
    ------
    FileError
        As ``read_bytes``; or it is no JSON, names a key twice, holds a number that is not
        finite, or is nested deeper than ``MAX_DEPTH``.

    """
    return parse_json(read_bytes(path, limit), str(path))


def parse_json(text: str | bytes, where: str) -> Any:
    """Return the value in a JSON text as ``read_json`` does; ``where`` stands in errors."""
    try:
        value = json.loads(text, object_pairs_hook=_once, parse_constant=_no_constant)
        check_value(value)
    except RecursionError as error:
        raise FileError(f'{where} is nested deeper than {MAX_DEPTH}') from error
    except ValueError as error:
        raise FileError(f'{where} cannot be read as JSON: {error}') from error
    return value


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f'the key {twice!r} is there twice')
    return values


def _no_constant(name: str) -> None:
    raise ValueError(f'{name} is no number of JSON')


def check_value(value: Any) -> None:
    """Raise ValueError for what is nested too deep or holds a number that is not finite."""
    level = [value]
    for _ in range(MAX_DEPTH + 1):
        below: list[Any] = []
        for entry in level:
            if isinstance(entry, dict):
                below.extend(entry.values())
            elif isinstance(entry, list):
                below.extend(entry)
            elif isinstance(entry, float) and not math.isfinite(entry):
                raise ValueError(f'{entry} is no finite number')
        if not below:
            return
        level = below
    raise ValueError(f'nested deeper than {MAX_DEPTH}')


class _BoundedLoader(yaml.SafeLoader):
    """PyYAML's safe loader; refuses duplicate keys, cycles, and nodes too deep or too many."""

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._depth = self._nodes = 0
        # Of each anchor that is complete: nodes below it, aliases written out.
        self._sizes: dict[str, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        before = self._nodes
        if isinstance(event, yaml.AliasEvent):
            if event.anchor in self.anchors and event.anchor not in self._sizes:
                raise ValueError(f'*{event.anchor} is part of itself')
            self._nodes += self._sizes.get(str(event.anchor), 0)
        self._nodes += 1
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise ValueError(f'nested deeper than {MAX_DEPTH}')
        if self._nodes > MAX_YAML_NODES:
            raise ValueError(f'more than {MAX_YAML_NODES} values')
        node = super().compose_node(parent, index)
        self._depth -= 1
        if not isinstance(event, yaml.AliasEvent) and event.anchor is not None:
            self._sizes[event.anchor] = self._nodes - before
        return node

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        node = super().compose_mapping_node(anchor)
        found = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if (key.tag, key.value) in found:
                    raise ValueError(f'line {key.start_mark.line + 1}: the key {key.value!r} is '
                                     'there twice')
                found.add((key.tag, key.value))
        return node


def read_yaml(path: Path) -> Any:
    """
    Return the value in a YAML file; None if it is empty.

    Raises
    ------
    FileError
        As ``read_json``; aliases count as if they were written out.

    """
    text = read_text(path, MAX_YAML_BYTES)
    try:
        loader = _BoundedLoader(text)
        try:
            value = loader.get_single_data()
        finally:
            loader.dispose()
        check_value(value)
    except (yaml.YAMLError, ValueError, TypeError, OverflowError, RecursionError) as error:
        raise FileError(f'{path} cannot be read as YAML: {" ".join(str(error).split())}'
                        ) from error
    return value


def csv_rows(path: Path, limit: int = MAX_TEXT_BYTES) -> Iterator[tuple[int, list[str]]]:
    """
    Yield (number of its last line, cells) of each row of a CSV file in UTF-8.

    Raises
    ------
    FileError
        As ``read_bytes``; or it is no CSV.

    """
    csv.field_size_limit(_MAX_CSV_CELL)
    lines = csv.reader(read_text(path, limit).splitlines(keepends=True), strict=True)
    try:
        for cells in lines:
            yield lines.line_num, cells
    except csv.Error as error:
        raise FileError(f'{path}, line {lines.line_num} cannot be read as CSV: {error}'
                        ) from error
