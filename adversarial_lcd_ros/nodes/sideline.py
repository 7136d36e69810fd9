# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A thread of its own for work that somebody waits for, but not for ever.

Python cannot stop a thread. So the search has one of its own: the best graph so far is taken at
the deadline, and what the search brings later is thrown away.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from queue import SimpleQueue
from threading import Thread
from typing import Any, TypeVar

ResultT = TypeVar('ResultT')


class Sideline:
    """
    Does one thing after another, in the order in which they were asked for.

    Unlike a ThreadPoolExecutor it does not keep a process from ending.
    """

    def __init__(self, name: str) -> None:
        self._tasks: SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None] = SimpleQueue()
        Thread(target=self._run, name=name, daemon=True).start()

    def do(self, task: Callable[[], ResultT]) -> Future[ResultT]:
        """Return what will hold the result of the task."""
        future: Future[ResultT] = Future()
        self._tasks.put((future, task))
        return future

    def close(self) -> None:
        """End the thread once what was asked for is done; does not wait."""
        self._tasks.put(None)

    def _run(self) -> None:
        while (entry := self._tasks.get()) is not None:
            future, task = entry
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(task())
            except BaseException as error:
                future.set_exception(error)
