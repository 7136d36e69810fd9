# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Keys of graphs that are sealed: files that only their owner can read."""

from __future__ import annotations

import os
from pathlib import Path
import secrets

from adversarial_lcd_ros.errors import FileError
from adversarial_lcd_ros.files.reading import read_private

KEY_BYTES = 32
_MAX_FILE_BYTES = 1024


def make_key(path: Path) -> None:
    """
    Write a new key: 32 random bytes as a line of hexadecimal digits, readable by its owner only.

    Raises
    ------
    FileError
        Something is there already, or the place cannot be written.

    """
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        with open(descriptor, 'w', encoding='ascii') as stream:
            stream.write(f'{secrets.token_hex(KEY_BYTES)}\n')
            stream.flush()
            os.fsync(descriptor)
    except FileExistsError as error:
        raise FileError(f'{path} is there already: expected a new file, since a key in use is not '
                        'overwritten') from error
    except OSError as error:
        raise FileError(f'{path} cannot be written ({error.strerror})') from error


def read_key(path: Path) -> bytes:
    """
    Return the 32 bytes of a key.

    Raises
    ------
    FileError
        The file is missing, others than its owner can read or write it, or it holds no key.

    """
    text = read_private(path, _MAX_FILE_BYTES)
    try:
        key = bytes.fromhex(text.decode('ascii'))
    except ValueError:  # what is in the file is not repeated in an error
        key = b''
    if len(key) != KEY_BYTES:
        raise FileError(f'{path} holds no key: expected {2 * KEY_BYTES} hexadecimal digits, as '
                        '"adversarial-lcd key FILE" writes them')
    return key
