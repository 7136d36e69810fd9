# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A ROS domain for one run alone: runs side by side on a machine must not hear each other."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
import socket

from adversarial_lcd_ros.errors import ConfigError, EvaluationError

VARIABLE = 'ROS_DOMAIN_ID'
LAST_DOMAIN = 232
# 0 is where everybody is, low numbers are what people choose; the ports of those above 101 may be
# taken by the system for other connections.
_CANDIDATES = range(101, 0, -1)


@contextmanager
def own_domain() -> Iterator[int]:
    """
    Hold a ROS domain in which no other run on this machine is; yield its number.

    ROS_DOMAIN_ID is respected where it is set. The lock is a name of the Linux abstract socket
    namespace: it belongs to the network that the domain is on, leaves no file, needs no rights,
    and is free again however its holder ends.

    Raises
    ------
    ConfigError
        ROS_DOMAIN_ID is no domain.
    EvaluationError
        Another run is in the domain that ROS_DOMAIN_ID names, or in every one.

    """
    chosen = os.environ.get(VARIABLE)
    candidates = _CANDIDATES if chosen is None else (_number(chosen),)
    for number in candidates:
        lock = _lock(number)
        if lock is not None:
            with lock:
                yield number
            return
    raise EvaluationError(
        f'every ROS domain from {_CANDIDATES[-1]} to {_CANDIDATES[0]} has a run of its own here: '
        'wait for one to end' if chosen is None else
        f'another run on this machine is in ROS domain {chosen}, which {VARIABLE} names: wait '
        'for it, name another domain, or unset the variable for a free one')


def _number(text: str) -> int:
    try:
        number = int(text)
    except ValueError:
        number = -1
    if not 0 <= number <= LAST_DOMAIN:
        raise ConfigError(f'{VARIABLE} is {text!r}: expected a whole number from 0 to '
                          f'{LAST_DOMAIN}, or the variable unset for a free domain')
    return number


def _lock(number: int) -> socket.socket | None:
    """Return what holds a domain, to be closed; None: somebody else holds it."""
    lock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        lock.bind(f'\0adversarial_lcd_ros/domain/{number}')
    except OSError:
        lock.close()
        return None
    return lock
