# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The header that messages start with: read, rewritten and made, without decoding the rest."""

from __future__ import annotations

import struct
from typing import Any

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.messages.codec import typestore

_NS = 1_000_000_000
_CDR_HEADER = 4  # bytes of encapsulation, then the stamp of a std_msgs/Header


def join_ns(seconds: int, nanoseconds: int) -> int:
    """Return the two parts of a stamp as nanoseconds; raises SequenceError."""
    if not 0 <= nanoseconds < _NS:
        raise SequenceError(f'stamp with {nanoseconds} nanoseconds: expected below {_NS}')
    return seconds * _NS + nanoseconds


def _time_format(cdr: bytes) -> str:
    if len(cdr) < _CDR_HEADER + 8 or cdr[0] != 0 or cdr[1] not in (0, 1):
        raise SequenceError(f'{len(cdr)} bytes starting with {cdr[:4].hex() or "nothing"} are no '
                            'CDR of a message with a header')
    return '<iI' if cdr[1] else '>iI'


def cdr_stamp_ns(cdr: bytes) -> int:
    """Return the stamp of the header that a message in CDR starts with; raises SequenceError."""
    return join_ns(*struct.unpack_from(_time_format(cdr), cdr, _CDR_HEADER))


def with_cdr_stamp(cdr: bytes, stamp_ns: int) -> bytes:
    """Return a message in CDR that starts with a header, with another stamp in it."""
    seconds, nanoseconds = divmod(stamp_ns, _NS)
    if seconds >= 2**31:
        raise SequenceError(f'{stamp_ns} ns is beyond the stamps of ROS 2, which end in 2038')
    changed = bytearray(cdr)
    struct.pack_into(_time_format(cdr), changed, _CDR_HEADER, seconds, nanoseconds)
    return bytes(changed)


def header(stamp_ns: int, frame_id: str) -> Any:
    """Return a std_msgs/Header."""
    types: Any = typestore().types
    seconds, nanoseconds = divmod(stamp_ns, _NS)
    return types['std_msgs/msg/Header'](
        stamp=types['builtin_interfaces/msg/Time'](sec=seconds, nanosec=nanoseconds),
        frame_id=frame_id)
