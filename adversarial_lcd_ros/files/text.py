# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text of numbers and names, as published data sets have it, whatever machine wrote it."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from pathlib import Path
import re

from adversarial_lcd_ros.errors import FileError, SequenceError
from adversarial_lcd_ros.files.reading import read_bytes

_COMMENT = re.compile(r'(^|\s)#.*')
# A text of UTF-32 would start like one of UTF-16: the longer mark is looked for first.
_MARKS = ((codecs.BOM_UTF32_LE, 'utf-32'), (codecs.BOM_UTF32_BE, 'utf-32'),
          (codecs.BOM_UTF8, 'utf-8-sig'), (codecs.BOM_UTF16_LE, 'utf-16'),
          (codecs.BOM_UTF16_BE, 'utf-16'))


def read_text(path: Path) -> str:
    """
    Return a text in UTF-8, or in what its byte order mark says, without the mark.

    Raises
    ------
    SequenceError
        The file is missing or is no such text.

    """
    try:
        data = read_bytes(path)
        encoding = next((name for mark, name in _MARKS if data.startswith(mark)), 'utf-8')
        text = data.decode(encoding)
    except (FileError, UnicodeDecodeError) as error:
        raise SequenceError(f'{path} cannot be read: {error}') from error
    if '\0' in text:
        raise SequenceError(f'{path} is no text in UTF-8, and UTF-16 needs a byte order mark: '
                            'save it as UTF-8')
    return text


def printable(text: str) -> str:
    """Return a text with escapes for what would move a terminal: names of inputs may hold it."""
    return ''.join(character if character.isprintable() else ascii(character)[1:-1]
                   for character in text)


def text_rows(path: Path, columns: str, separator: str | None = None,
              ) -> Iterator[tuple[str, list[str]]]:
    """
    Yield ('file, line n', fields) of a text of columns; # starts a comment.

    Parameters
    ----------
    path : Path
    columns : str
        Names of the columns, apart by blanks; a last one '...' stands for any number more, and
        one 'filename' for the rest of the line, as names may hold blanks.
    separator : str, optional
        Between the columns; blanks unless given.

    Raises
    ------
    SequenceError
        The file is missing, is no text, or a line has the wrong number of fields.

    """
    names = columns.split()
    is_open = names[-1] == '...'
    expected = len(names) - is_open
    splits = expected - 1 if names[-1] == 'filename' else -1
    for number, line in enumerate(read_text(path).splitlines(), 1):
        bare = _COMMENT.sub('', line).strip()
        if not bare:
            continue
        fields = [field.strip() for field in bare.split(separator, splits)]
        if len(fields) < expected or (len(fields) > expected and not is_open):
            raise SequenceError(f'{path}, line {number}: {len(fields)} fields; expected '
                                f'{expected}{" or more" * is_open}: {columns}')
        yield f'{path}, line {number}', fields
