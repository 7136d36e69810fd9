# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A run as one compressed file: all that its figures are made of, to be read and checked anywhere.

JSON lines under xz. The first line says what it is and has the JSON files of the folder, every
other one is a finished cell. No line names a file: reading it writes nowhere but into the folder
that is asked for. Pictures stay behind, and so does where the files lay on the machine that ran.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import json
import lzma
from pathlib import Path
import re
from typing import Any

from adversarial_lcd_ros.errors import EvaluationError, FileError
from adversarial_lcd_ros.evaluation.kinds import open_results
from adversarial_lcd_ros.evaluation.kinds.base import Results
from adversarial_lcd_ros.evaluation.results import CONFIGURATION, ENVIRONMENT, SUMMARY, read_json
from adversarial_lcd_ros.evaluation.store import CELLS, Row, read_cells
from adversarial_lcd_ros.files.reading import MIB, parse_json, read_bytes
from adversarial_lcd_ros.files.writing import replacing, write_bytes, write_json

FORMAT, VERSION = 'adversarial-lcd results', 1
_MAX_PACKED, _MAX_BYTES, _MAX_LINE = 64 * MIB, 256 * MIB, 16 * MIB
_XZ_MEMORY, _CHUNK = 128 * MIB, MIB
_DOCUMENTS = {'summary': SUMMARY, 'configuration': CONFIGURATION, 'environment': ENVIRONMENT}
# Releases that rows name (``versions``): they become names of files.
_DIGEST = re.compile(r'[0-9a-f]{8}')
_ENVIRONMENT = Path(ENVIRONMENT).stem
# The folders before the last name of a path.
_FOLDERS = re.compile(r'(^|[=\s])(?:/[^/\s]+)*/(?=[^/\s])')


def pack_results(folder: Path, path: Path) -> None:
    """
    Write the results of a folder, and the cells that they are made of, into one file.

    Raises
    ------
    EvaluationError, FileError
        The folder is not of a kind that has cells, or lacks some of them; or the file cannot be
        written.

    """
    kind, results = open_results(folder)
    wanted = results.summary.get('cells')
    if not isinstance(wanted, list):
        raise EvaluationError(f'{folder} is of the kind {kind.name}, whose report is not made of '
                              'cells: only folders with cells can be archived')
    there = {row['key']: row for row in read_cells(folder)}
    missing = sum(key not in there for key in wanted)
    if missing:
        raise EvaluationError(f'{folder / CELLS} lacks {missing} of the {len(wanted)} cells that '
                              f'{SUMMARY} is of: run the evaluation again')
    with replacing(path) as stream, lzma.open(stream, 'wb', preset=9) as packed:
        for line in (_head(results), *(there[key] for key in wanted)):
            packed.write(json.dumps(line, separators=(',', ':')).encode() + b'\n')


def _head(results: Results) -> dict[str, Any]:
    releases = {path.stem.removeprefix(f'{_ENVIRONMENT}-'): read_json(path)
                for path in sorted(results.folder.glob(f'{_ENVIRONMENT}-*.json'))}
    return {'format': FORMAT, 'version': VERSION, 'summary': results.summary,
            'configuration': _portable(results.configuration),
            'environment': _portable(results.environment),
            'releases': {name: _portable(values) for name, values in releases.items()
                         if _DIGEST.fullmatch(name)}}


def _portable(value: Any) -> Any:
    """Return a JSON value in which paths are cut to their last names."""
    if isinstance(value, Mapping):
        return {name: _portable(entry) for name, entry in value.items()}
    if isinstance(value, list):
        return [_portable(entry) for entry in value]
    return _FOLDERS.sub(r'\1', value) if isinstance(value, str) else value


def unpack_results(path: Path, folder: Path) -> None:
    """
    Write what ``pack_results`` has packed into a new folder, ready to be reported on.

    Parameters
    ----------
    path : Path
        The file.
    folder : Path
        Made; must not be there, or be empty.

    Raises
    ------
    EvaluationError, FileError
        It is no such file, is larger than expected or damaged, or the folder is in use. Nothing is
        written then.

    """
    head, rows = _read(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        used = any(folder.iterdir())
    except OSError as error:
        raise EvaluationError(f'{folder} cannot be made ({error.strerror}): name another folder '
                              'with --output') from error
    if used:
        raise EvaluationError(f'{folder} is not empty: name a new folder with --output')
    write_bytes(folder / CELLS, b''.join(json.dumps(row).encode() + b'\n' for row in rows))
    for digest, values in head['releases'].items():
        write_json(folder / f'{_ENVIRONMENT}-{digest}.json', values)
    for name, file in reversed(_DOCUMENTS.items()):  # the summary last: it makes it a whole folder
        write_json(folder / file, head[name])


def _read(path: Path) -> tuple[dict[str, Any], list[Row]]:
    lines = _lines(path)
    head = _value(path, 1, next(lines, b''))
    if head.get('format') != FORMAT or head.get('version') != VERSION:
        found = f'{str(head.get("format"))[:40]!r} {str(head.get("version"))[:10]}'
        raise EvaluationError(f'{path} is no archive of results that this release reads: expected '
                              f'format "{FORMAT}" {VERSION}, found {found}')
    wrong = [name for name in (*_DOCUMENTS, 'releases') if not isinstance(head.get(name), dict)]
    wrong = wrong or [f'releases of {name[:20]!r}' for name, values in head['releases'].items()
                      if not _DIGEST.fullmatch(name) or not isinstance(values, dict)]
    if wrong:
        raise EvaluationError(f'{path}, line 1: {", ".join(wrong)} missing or not what it should '
                              'be: get the file again')
    rows = [_value(path, number, line) for number, line in enumerate(lines, start=2)]
    if not all(isinstance(row.get('key'), str) for row in rows):
        raise EvaluationError(f'{path}: a cell has no key: get the file again')
    return head, rows


def _value(path: Path, number: int, line: bytes) -> dict[str, Any]:
    value = parse_json(line, f'{path}, line {number}')
    if not isinstance(value, dict):
        raise EvaluationError(f'{path}, line {number} is a {type(value).__name__}: expected an '
                              'object')
    return value


def _lines(path: Path) -> Iterator[bytes]:
    """Yield the lines of a file under xz; in bounded memory, whatever it holds."""
    left = b''
    for chunk in _chunks(path):
        *whole, left = (left + chunk).split(b'\n')
        yield from whole
        if len(left) > _MAX_LINE:
            raise FileError(f'{path} has a line of more than {_MAX_LINE} bytes, the most that is '
                            'read')
    if left:
        raise FileError(f'{path} ends within a line: get the file again')


def _chunks(path: Path) -> Iterator[bytes]:
    packed = read_bytes(path, _MAX_PACKED)
    unpacker = lzma.LZMADecompressor(lzma.FORMAT_XZ, memlimit=_XZ_MEMORY)
    total = 0
    try:
        while not unpacker.eof:
            if unpacker.needs_input and not packed:
                raise FileError(f'{path} is cut off: get the file again')
            chunk = unpacker.decompress(packed, _CHUNK)
            packed = b''
            total += len(chunk)
            if total > _MAX_BYTES:
                raise FileError(f'{path} is larger than {_MAX_BYTES} bytes when unpacked, the '
                                'most that is read')
            yield chunk
    except lzma.LZMAError as error:
        raise FileError(f'{path} cannot be unpacked as xz ({error}): expected a file that "report '
                        '--archive" wrote') from error
    if unpacker.unused_data:
        raise FileError(f'{path} has {len(unpacker.unused_data)} bytes behind its end: get the '
                        'file again')
