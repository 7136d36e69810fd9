# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
npz archives, looked at before they are read: an archive declares sizes that it need not have.

Its members are entries of a zip archive, each with a header that tells type and shape. Both
are compared with each other, and with what the caller expects, before an array is made.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
import os
from pathlib import Path
import stat
from typing import IO, Any
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import FileError
from adversarial_lcd_ros.files.reading import MIB

MAX_ARRAY_BYTES = 512 * MIB
# Deflate reaches 1032; descriptors and features, 10.
MAX_RATIO = 200
_MAX_DIRECTORY_BYTES = MIB
_END, _END_BYTES = b'PK\x05\x06', 22
_ZIP64_LOCATOR, _LOCATOR_BYTES = b'PK\x06\x07', 20


def read_npz(path: Path, names: Sequence[str], *, limit: int = MAX_ARRAY_BYTES,
             ratio: float = MAX_RATIO) -> dict[str, NDArray[Any]]:
    """
    Return some arrays of an npz archive; others in it are not looked at.

    Parameters
    ----------
    path : Path
    names : sequence of str
    limit : int
        Most bytes of all these arrays together.
    ratio : float
        Most bytes of an array for each byte in the archive; 1: it is not compressed.

    Raises
    ------
    FileError
        It is missing or damaged, an array is missing, holds objects, or is larger than it may
        be or than the archive says.

    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with open(descriptor, 'rb') as stream:
            _check_archive(stream, limit)
            with ZipFile(stream) as archive:
                _check_sizes(archive, names, limit, ratio)
                return {name: _read(archive, f'{name}.npy') for name in names}
    except Exception as error:
        # Damage shows in zipfile, zlib, numpy or tokenize: no list of classes is complete.
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise FileError(f'{path} cannot be read as npz: {reason or type(error).__name__}'
                        ) from error


def _check_archive(stream: IO[bytes], limit: int) -> None:
    """Look at the end of a zip archive, which says how large its directory is."""
    mode, size = os.fstat(stream.fileno()).st_mode, os.fstat(stream.fileno()).st_size
    if not stat.S_ISREG(mode):
        raise ValueError('it is no regular file')
    if size > limit + _MAX_DIRECTORY_BYTES:
        raise ValueError(f'{size} bytes, more than the {limit} that are read')
    stream.seek(-min(size, _END_BYTES + _LOCATOR_BYTES), os.SEEK_END)
    tail = stream.read()
    end = tail[-_END_BYTES:]
    if not end.startswith(_END):
        raise ValueError('it does not end as an npz does')
    if int.from_bytes(end[12:16], 'little') > _MAX_DIRECTORY_BYTES or (
            tail.startswith(_ZIP64_LOCATOR) and size < 1 << 31):
        raise ValueError('it has more members than an npz')


def _check_sizes(archive: ZipFile, names: Sequence[str], limit: int, ratio: float) -> None:
    left = limit
    for name in names:
        try:
            entry = archive.getinfo(f'{name}.npy')
        except KeyError:
            raise ValueError(f'it has no array {name!r}') from None
        if entry.compress_type not in (ZIP_STORED, ZIP_DEFLATED):
            raise ValueError(f'the array {name!r} is compressed as numpy never does')
        left -= entry.file_size
        if left < 0:
            raise ValueError(f'the array {name!r} takes it beyond {limit} bytes')
        if entry.file_size > ratio * entry.compress_size + MIB:
            raise ValueError(f'the array {name!r} unfolds from {entry.compress_size} bytes to '
                             f'{entry.file_size}: no array of this package does')
        _check_header(archive, entry, name)


def _check_header(archive: ZipFile, entry: ZipInfo, name: str) -> None:
    """Compare what the header of an array declares with the size of its member."""
    with archive.open(entry) as member:
        version = npy.read_magic(member)
        read = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}.get(version)
        if read is None:
            raise ValueError(f'the array {name!r} is of version {version} of the format')
        shape, _, dtype = read(member)
        header = member.tell()
    if dtype.hasobject:
        raise ValueError(f'the array {name!r} holds objects: expected numbers')
    declared = header + math.prod(shape) * dtype.itemsize
    if min(shape, default=0) < 0 or declared != entry.file_size:
        raise ValueError(f'the array {name!r} declares {dtype}{shape}, but has '
                         f'{entry.file_size - header} bytes')


def _read(archive: ZipFile, member: str) -> NDArray[Any]:
    with archive.open(member) as stream:
        array: NDArray[Any] = np.lib.format.read_array(stream, allow_pickle=False)
        if stream.read(1):
            raise ValueError(f'{member} goes on after its array')
        return array
