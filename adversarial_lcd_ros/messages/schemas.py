# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The messages of ``msg_schemas`` as types, and their CDR: this and earlier versions of each.

A field that came with a later version ends its line with ``(since N)`` and stands behind all
earlier ones: without these lines a schema is that of the version before, whose recordings are
read by it.
"""

from __future__ import annotations

from functools import cache
import re
from typing import TYPE_CHECKING, Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from adversarial_lcd_ros.errors import CodecError
from adversarial_lcd_ros.paths import PACKAGE, share_path

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

MESSAGES = ('MultiTierGraph', 'LoopClosure', 'LcdQuery', 'LcdAnswer', 'AttackReport',
            'Detections')
_LATEST = 2
_VERSION = re.compile(r'^uint16 SCHEMA_VERSION = (\d+)$', re.MULTILINE)
_SINCE = re.compile(r'\(since (\d+)\)$')


def schema_text(message: str, version: int | None = None) -> str:
    """Return the .msg text of one of MESSAGES, as it is or as it was in an earlier version."""
    text = share_path(f'msg_schemas/{message}.msg').read_text(encoding='utf-8')
    if version is None:
        return text
    kept = (line for line in text.splitlines(keepends=True)
            if not (since := _SINCE.search(line)) or int(since[1]) <= version)
    return ''.join(kept)


@cache
def schema_version(message: str) -> int:
    """Return the version of a message that this package writes."""
    found = _VERSION.search(schema_text(message))
    assert found is not None, message
    return int(found[1])


@cache
def typestore(version: int = _LATEST) -> Typestore:
    """Return the Jazzy typestore with this package's messages registered."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types: dict[str, Any] = {}
    for message in MESSAGES:
        types |= get_types_from_msg(schema_text(message, version), f'{PACKAGE}/msg/{message}')
    store.register(types)
    return store


def message_type(name: str) -> Any:
    """Return the class of a message by its full name."""
    return typestore().types[name]


def dump(message: Any, name: str) -> bytes:
    """Return the CDR of one of MESSAGES."""
    return bytes(typestore().serialize_cdr(message, f'{PACKAGE}/msg/{name}'))


def load(payload: bytes | bytearray | memoryview, name: str, max_bytes: int) -> Any:
    """
    Return the message in a payload, of this or of an earlier version.

    Raises
    ------
    CodecError
        The payload is too large, no such message, or of a version that is not known.

    """
    if len(payload) > max_bytes:
        raise CodecError(f'{name} payload of {len(payload)} bytes: at most {max_bytes} are '
                         'accepted', cause='bytes')
    latest = schema_version(name)
    reason: Exception | None = None
    for version in range(latest, 0, -1):
        try:
            # rosbags reports most damage as SerdeError, the rest as whatever broke inside it.
            message: Any = typestore(version).deserialize_cdr(bytes(payload),
                                                              f'{PACKAGE}/msg/{name}')
        except Exception as error:
            reason = reason or error
            continue
        if message.schema_version == version:
            return message
        if 1 <= message.schema_version <= latest:
            # A layout that only looks like this one: the newest says what is wrong.
            reason = reason or CodecError(f'{name} of version {message.schema_version} has the '
                                          f'fields of version {version}', cause='version')
            continue
        reason = CodecError(
            f'{name} has schema version {message.schema_version}: this package reads 1 to '
            f'{latest}', cause='version')
        break
    if isinstance(reason, CodecError):
        raise reason
    raise CodecError(f'{len(payload)} bytes are no {name}: {reason!r}') from reason
