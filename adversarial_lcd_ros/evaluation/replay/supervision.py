# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes as child processes: they end with this one, and say how far they are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.start import SUPERVISOR

STARTING, READY, PLAYING = 'starting', 'ready', 'playing'
STOP_TIMEOUT_S = 60.0
# After an error or a signal nobody waits for what a node would still like to do.
_HASTY_STOP_S = 0.7
_POLL_S = 0.05
_TELL_PERIOD_S = 10.0
# Between the last "ready" and the first frame there is discovery alone.
_DISCOVERY_S = 600.0
_LOG_TAIL_LINES = 8
_ERROR = 'error '

Tell = Callable[[str], None]


class NodeProcess:
    """
    A node in a process of its own.

    The process reports over a pipe (``start.report``) and is killed when this one ends, by
    whatever means. It is in a session of its own: Ctrl-C reaches this process alone, which ends
    the others in order.

    Parameters
    ----------
    name : str
    arguments : sequence of str
        After the node's name.
    environment : mapping of str to str
    log : Path
        File for its output.
    keep_stderr : bool
        Leave stderr where this process has it.

    Attributes
    ----------
    name : str
    state : str
        The last that it reported: 'starting', 'loading', 'compiling', 'ready', 'playing'.

    """

    def __init__(self, name: str, arguments: Sequence[str], environment: Mapping[str, str],
                 log: Path, *, keep_stderr: bool = False) -> None:
        self.name, self.state = name, STARTING
        self._log, self._said, self._error = log, b'', ''
        self._pipe, theirs = os.pipe()
        os.set_blocking(self._pipe, False)
        try:
            with log.open('wb') as output:
                self._process = subprocess.Popen(
                    [sys.executable, '-m', f'adversarial_lcd_ros.nodes.{name}', *arguments],
                    env={**environment, SUPERVISOR: f'{os.getpid()} {theirs}'},
                    stdin=subprocess.DEVNULL, stdout=output, start_new_session=True,
                    stderr=None if keep_stderr else subprocess.STDOUT, pass_fds=(theirs,))
        except BaseException:
            os.close(self._pipe)
            raise
        finally:
            os.close(theirs)

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def poll(self) -> int | None:
        """Take in what it reported; return its exit code, None while it lives."""
        code = self._process.poll()
        self._read()
        return code

    def _read(self) -> None:
        try:
            while block := os.read(self._pipe, 1 << 16):
                self._said += block
        except BlockingIOError:
            pass
        *lines, self._said = self._said.split(b'\n')
        for line in (raw.decode('utf-8', 'replace') for raw in lines):
            if line.startswith(_ERROR):
                self._error = line.removeprefix(_ERROR)
            else:
                self.state = line

    def interrupt(self) -> None:
        """Ask it to end; by force where it is not yet able to hear that."""
        if self.poll() is None:
            self._process.send_signal(signal.SIGKILL if self.state == STARTING else signal.SIGINT)

    def end(self, deadline_s: float) -> int:
        """Wait until it has ended, kill it at a time of the monotonic clock; return its code."""
        try:
            self._process.wait(max(0.0, deadline_s - time.monotonic()))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._read()
        return self._process.returncode

    def close(self) -> None:
        """Give up the pipe."""
        os.close(self._pipe)

    def failure(self) -> EvaluationError:
        """Return an error that tells how it ended, in its own words."""
        code = self._process.returncode
        how = (f'was ended by {signal.Signals(-code).name}' if code < 0 else
               f'ended with exit code {code}')
        said = self._error or self._tail() or f'it said nothing while {self.state}'
        return EvaluationError(f'node {self.name} {how}: {said} (log: {self._log})')

    def _tail(self) -> str:
        tail = self._log.read_text(encoding='utf-8', errors='replace').splitlines()
        return ' | '.join(line.strip() for line in tail[-_LOG_TAIL_LINES:] if line.strip())


@contextmanager
def ended_together(processes: list[NodeProcess]) -> Iterator[None]:
    """
    End all processes on the way out, first asking them and then by force.

    Raises
    ------
    EvaluationError
        One of them failed, while all else went well.

    """
    stop_s = _HASTY_STOP_S
    try:
        yield
        stop_s = STOP_TIMEOUT_S
    finally:
        for process in processes:
            process.interrupt()
        deadline_s = time.monotonic() + stop_s
        codes = [process.end(deadline_s) for process in processes]
        for process in processes:
            process.close()
    for process, code in zip(processes, codes, strict=True):
        if code:
            raise process.failure()


def await_end(replay: NodeProcess, peers: Sequence[NodeProcess], tell: Tell) -> None:
    """
    Wait until a replay is over, while its peers live: as long as they take to get ready.

    Parameters
    ----------
    replay : NodeProcess
        Reports 'playing' once it has found its peers.
    peers : sequence of NodeProcess
    tell : callable
        Gets a line every ten seconds before the replay plays.

    Raises
    ------
    EvaluationError
        A process ended that should not have, or all are ready and do not find each other.

    """
    everyone = [*peers, replay]
    began_s = all_ready_s = told_s = time.monotonic()
    while True:
        code = replay.poll()
        # One that died is why the others fail: it comes first.
        for peer in peers:
            if peer.poll() is not None:
                raise peer.failure()
        if code is not None:
            if code:
                raise replay.failure()
            return
        now_s = time.monotonic()
        if replay.state != PLAYING:
            if any(process.state != READY for process in everyone):
                all_ready_s = now_s
            if now_s - told_s >= _TELL_PERIOD_S:
                told_s = now_s
                tell(f'after {now_s - began_s:.0f} s: ' + ', '.join(
                    f'{process.name} is {process.state}' for process in everyone))
            if now_s - all_ready_s >= _DISCOVERY_S:
                raise EvaluationError(
                    f'all nodes have been ready for {_DISCOVERY_S:.0f} s and do not find each '
                    'other: is a firewall between them, or RMW_IMPLEMENTATION set to what is not '
                    'complete here?')
        time.sleep(_POLL_S)
