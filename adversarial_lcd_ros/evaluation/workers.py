# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Processes that work on tasks side by side: on this machine, or on a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
import multiprocessing
import os
import signal
import threading
from typing import Any

from adversarial_lcd_ros.errors import ConfigError, EvaluationError

# Called with a function and tasks; yields results as they come, in any order.
Run = Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[Any]]
_CONNECT_S = 20


@contextmanager
def local_workers(jobs: int) -> Iterator[Run]:
    """
    Provide processes of this machine; leaving early, also by Ctrl-C, ends them at once.

    Parameters
    ----------
    jobs : int
        Number of processes.

    Raises
    ------
    EvaluationError
        From the iterator: a process ended, most likely for want of memory.

    """
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context('spawn'),
                               initializer=_begin_worker)

    def run(function: Callable[[Any], Any], tasks: Sequence[Any]) -> Iterator[Any]:
        with _deaf_children():
            futures: list[Future[Any]] = [pool.submit(function, task) for task in tasks]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BrokenProcessPool as error:
            raise EvaluationError('a worker process ended without a word, most likely for want '
                                  'of memory: run the same command again with fewer --jobs; '
                                  'finished cells are kept') from error

    try:
        yield run
    except BaseException:
        # The tasks under way are lost anyway; waiting for them would only look like hanging.
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - before:
            process.terminate()
        raise
    finally:
        pool.shutdown()


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Let processes that are started here never hear Ctrl-C, not even while they import."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin_worker() -> None:
    # Ctrl-C reaches the whole process group; the parent alone decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    # A parent that was killed cannot end its workers, and they would wait for tasks forever.
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def dask_workers(address: str) -> Iterator[Run]:
    """
    Provide the workers of a Dask cluster; a worker that is lost has its tasks done by others.

    The workers need this package, and the sequences at the paths where they are here.

    Parameters
    ----------
    address : str
        Of the scheduler: ``tcp://HOST:PORT``.

    Raises
    ------
    ConfigError
        Dask is not installed.
    EvaluationError
        There is no scheduler, or (from the iterator) the cluster was lost.

    """
    try:
        from distributed import Client
        from distributed import as_completed as completed
        from distributed.scheduler import KilledWorker
    except ImportError as error:
        raise ConfigError('a scheduler needs Dask: pip install '
                          '"adversarial_lcd_ros[cluster]"') from error
    try:
        client = Client(address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise EvaluationError(f'no Dask scheduler at {address} ({error}): expected one started '
                              'with "dask scheduler"') from error

    def run(function: Callable[[Any], Any], tasks: Sequence[Any]) -> Iterator[Any]:
        futures = client.map(function, tasks, pure=False)
        try:
            for future in completed(futures, loop=client.loop):
                yield future.result()
        except (KilledWorker, CancelledError, OSError) as error:
            raise EvaluationError(f'the Dask cluster at {address} was lost ({error}): start it '
                                  'and run the same command again; finished cells are kept'
                                  ) from error
        finally:
            client.cancel(futures)

    with client:
        yield run
