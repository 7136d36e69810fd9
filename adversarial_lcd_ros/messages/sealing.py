# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Graphs that show who made them: a tag inside the bytes, which no middleware strips.

Behind the CDR of a graph, in the same byte array, is a seal of 56 bytes, numbers little-endian:

    8   ``MAGIC``
    8   when the builder was started, nanoseconds since 1970
    8   when the graph was sealed, likewise
    32  HMAC-SHA256, by a key that builder and detector share, of all bytes before it

Stamp, sequence and session are fields of the graph: the tag covers them. Whoever has no key reads
such a graph as any other.
"""

from __future__ import annotations

import hmac
import struct
import time

from adversarial_lcd_ros.errors import CodecError

MAGIC = b'ALCDSEAL'
_HASH = 'sha256'
_TIMES = struct.Struct('<8sQQ')
_TAG_BYTES = 32
SEAL_BYTES = _TIMES.size + _TAG_BYTES

Buffer = bytes | bytearray | memoryview


class Sealer:
    """
    Seals the graphs of one run of the builder.

    Parameters
    ----------
    key : bytes
    started_ns : int, optional
        When it was started, nanoseconds since 1970; now if not given.

    """

    def __init__(self, key: bytes, started_ns: int | None = None) -> None:
        self._key = key
        self.started_ns = time.time_ns() if started_ns is None else started_ns

    def seal(self, payload: bytes, now_ns: int | None = None) -> bytes:
        """Return the payload of a graph with a seal behind it."""
        times = _TIMES.pack(MAGIC, self.started_ns, time.time_ns() if now_ns is None else now_ns)
        told = payload + times
        return told + hmac.digest(self._key, told, _HASH)


def is_sealed(payload: Buffer) -> bool:
    """Tell whether a payload ends with a seal, whoever made it."""
    return bytes(payload[-SEAL_BYTES:-SEAL_BYTES + len(MAGIC)]) == MAGIC


def unsealed(payload: Buffer) -> Buffer:
    """Return a payload without its seal, which is not looked at; as it is if it has none."""
    return memoryview(payload)[:-SEAL_BYTES] if is_sealed(payload) else payload


def opened(sealed: Buffer, key: bytes) -> tuple[memoryview, int, int]:
    """
    Return the payload under a seal, when its maker was started, and when it was sealed.

    Raises
    ------
    CodecError
        There is no seal, or it is not of this key and these bytes.

    """
    if not is_sealed(sealed):
        raise CodecError('graph without a seal: expected one of graph_builder with the same key '
                         '(parameter key)', cause='unsealed')
    whole = memoryview(sealed)
    told, tag = whole[:-_TAG_BYTES], whole[-_TAG_BYTES:]
    if not hmac.compare_digest(hmac.digest(key, told, _HASH), tag):
        raise CodecError('graph whose seal is not of this key and these bytes: forged, changed on '
                         'the way, or of a builder with another key', cause='seal')
    _, started_ns, sealed_ns = _TIMES.unpack(told[-_TIMES.size:])
    return told[:-_TIMES.size], started_ns, sealed_ns
