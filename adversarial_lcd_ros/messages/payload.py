# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Payloads in and out of std_msgs/UInt8MultiArray, as the bytes that go over the wire.

Bags hold them without this wrapping, as messages of their own types (adversarial_lcd_ros/msg/...)
whose definitions are in the bag: so any reader of MCAP decodes them. Bags of before, and those of
"ros2 bag record", hold them as they went over the wire.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from adversarial_lcd_ros.errors import CodecError
from adversarial_lcd_ros.messages.codec import MAX_PAYLOAD_BYTES, MESSAGES, typestore
from adversarial_lcd_ros.paths import PACKAGE

WIRE_TYPE = 'std_msgs/msg/UInt8MultiArray'
# What the payloads of a topic are, by the last part of its name.
TOPIC_MESSAGES = {
    'graph_clean': 'MultiTierGraph', 'graph': 'MultiTierGraph', 'loop_closures': 'LoopClosure',
    'attack_report': 'AttackReport', 'query': 'LcdQuery', 'answer': 'LcdAnswer',
    'detections': 'Detections'}
# In bags: as over the wire, or typed.
PAYLOAD_TYPES = (WIRE_TYPE, *(f'{PACKAGE}/msg/{message}' for message in MESSAGES))


def bag_type(topic: str) -> str:
    """Return the type that the payloads of a topic have in a bag."""
    message = TOPIC_MESSAGES.get(topic.rsplit('/', 1)[-1])
    return f'{PACKAGE}/msg/{message}' if message else WIRE_TYPE


def payload_of(message_type: str, wire: bytes) -> bytes:
    """Return the payload in a message of one of PAYLOAD_TYPES; raises CodecError."""
    return unwrap(wire) if message_type == WIRE_TYPE else wire


def wrap(payload: bytes) -> bytes:
    """Return the CDR of a UInt8MultiArray that carries a payload; publish it as it is."""
    types = typestore().types
    layout = types['std_msgs/msg/MultiArrayLayout'](dim=[], data_offset=0)
    data = np.frombuffer(payload, np.uint8)
    return bytes(typestore().serialize_cdr(types[WIRE_TYPE](layout=layout, data=data), WIRE_TYPE))


def unwrap(wire: bytes, max_bytes: int = MAX_PAYLOAD_BYTES) -> bytes:
    """
    Return the payload that the CDR of a UInt8MultiArray carries.

    Subscriptions take these messages raw: a message broken on the outside as well is seen,
    counted and, by the attacker, forwarded, where rclpy would lose it without a word.

    Parameters
    ----------
    wire : bytes
    max_bytes : int
        Most bytes of the message.

    Raises
    ------
    CodecError
        The bytes are no such message, or an unreasonably large one.

    """
    if len(wire) > max_bytes:
        raise CodecError(f'message of {len(wire)} bytes: at most {max_bytes} are accepted',
                         cause='bytes')
    try:
        message: Any = typestore().deserialize_cdr(wire, WIRE_TYPE)
    except Exception as error:
        # rosbags reports most damage as SerdeError, the rest as whatever broke inside it.
        raise CodecError(f'{len(wire)} bytes are no {WIRE_TYPE}: {error!r}') from error
    return bytes(message.data)
