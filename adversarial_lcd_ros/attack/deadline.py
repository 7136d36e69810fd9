# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The end of the time that a search has, known to its steps without being handed down to each."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
import math
import time

from adversarial_lcd_ros.errors import BudgetError

_deadline_s: ContextVar[float] = ContextVar('deadline_s', default=math.inf)


@contextmanager
def ending_at(deadline_s: float) -> Iterator[None]:
    """Let ``check_time`` refuse from ``time.monotonic()`` on, in this thread."""
    token = _deadline_s.set(deadline_s)
    try:
        yield
    finally:
        _deadline_s.reset(token)


def check_time() -> None:
    """
    Called before a step that may take long.

    Raises
    ------
    BudgetError
        The deadline has passed.

    """
    if time.monotonic() >= _deadline_s.get():
        raise BudgetError('the deadline has passed')
