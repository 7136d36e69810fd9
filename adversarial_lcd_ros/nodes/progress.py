# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How far a replay has come, on stderr."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
import sys
import time
from typing import Protocol

from adversarial_lcd_ros.start import QUIET

_LINE_PERIOD_S = 5.0


class Advance(Protocol):
    """Tells that frames were replayed."""

    def __call__(self, frames: int) -> None:
        """Show the number of frames replayed so far."""


@contextmanager
def progress(title: str, total: int) -> Iterator[Advance]:
    """
    Show a bar on a terminal, else a line every five seconds.

    Parameters
    ----------
    title : str
    total : int
        Frames to come.

    """
    if QUIET in os.environ:
        yield lambda frames: None
    elif sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn
        with Progress(*Progress.get_default_columns()[:2], MofNCompleteColumn(),
                      TimeRemainingColumn(), console=Console(stderr=True)) as bar:
            task = bar.add_task(title, total=total)
            yield lambda frames: bar.update(task, completed=frames)
    else:
        yield _Lines(title, total)


class _Lines:
    def __init__(self, title: str, total: int) -> None:
        self._title, self._total = title, total
        self._next_s = time.monotonic() + _LINE_PERIOD_S

    def __call__(self, frames: int) -> None:
        now_s = time.monotonic()
        if now_s >= self._next_s:
            self._next_s = now_s + _LINE_PERIOD_S
            print(f'{self._title}: {frames} of {self._total} frames', file=sys.stderr, flush=True)
