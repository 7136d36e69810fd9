# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Width and height of a JPEG, PNG or WebP file by its header, before anything is decoded."""

from __future__ import annotations

import struct

from adversarial_lcd_ros.errors import CodecError

PNG_MAGIC, JPEG_MAGIC = b'\x89PNG\r\n\x1a\n', b'\xff\xd8\xff'
# Frame headers of JPEG: C4, C8 and CC among them are tables.
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_SCAN = 0xDA
_ALONE = frozenset((0x01, *range(0xD0, 0xD9)))


def picture_size(data: bytes, what: str) -> tuple[int, int]:
    """
    Return width and height that the header of a picture declares, pixels.

    A megabyte of PNG may declare, and become, gigabytes of pixels.

    Parameters
    ----------
    data : bytes
        The file, of which the first part is enough.
    what : str
        What it is, for the error.

    Raises
    ------
    CodecError
        The data are no JPEG, PNG or WebP, or end within the header.

    """
    try:
        if data.startswith(PNG_MAGIC) and data[12:16] == b'IHDR':
            width, height = struct.unpack_from('>II', data, 16)
            return width, height
        if data.startswith(JPEG_MAGIC):
            return _jpeg_size(data)
        if data[:4] == b'RIFF' and data[8:12] == b'WEBP':
            return _webp_size(data)
    except (struct.error, IndexError):
        raise CodecError(f'{what}: {len(data)} bytes end within the header of a picture',
                         cause='format') from None
    raise CodecError(f'{what}: {len(data)} bytes that start with {data[:4].hex() or "nothing"} '
                     'are no picture: expected JPEG, PNG or WebP', cause='format')


def _jpeg_size(data: bytes) -> tuple[int, int]:
    at = 2
    while data[at] == 0xFF and data[at + 1] != _SCAN:
        marker = data[at + 1]
        if marker == 0xFF:  # filling
            at += 1
        elif marker in _ALONE:
            at += 2
        elif marker in _FRAMES:
            height, width = struct.unpack_from('>HH', data, at + 5)
            return width, height
        else:
            at += 2 + max(2, struct.unpack_from('>H', data, at + 2)[0])
    raise IndexError(at)


def _webp_size(data: bytes) -> tuple[int, int]:
    kind = data[12:16]
    if kind == b'VP8X':
        wide, high = data[24:27], data[27:30]
        return (int.from_bytes(wide, 'little') + 1, int.from_bytes(high, 'little') + 1)
    if kind == b'VP8L':
        bits, = struct.unpack_from('<I', data, 21)
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    width, height = struct.unpack_from('<HH', data, 26)
    return width & 0x3FFF, height & 0x3FFF
