# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The first code of every process: how it ends, decided before anything slow is imported.

Imports of a node take a second, compiling several; a signal may come at any time. This module
imports nothing but the standard library's own small parts.
"""

from __future__ import annotations

import _thread
import atexit
import codecs
from collections.abc import Mapping
from contextlib import suppress
import importlib
import importlib.util
import os
import signal
import sys
import time
from types import FrameType

EXIT_OK, EXIT_USAGE = 0, 2
SIGNALS = (signal.SIGINT, signal.SIGTERM)
# Process id of whoever started this node and waits for it, and where he reads how it is going.
SUPERVISOR = 'ADVERSARIAL_LCD_SUPERVISOR'
# Set where nothing but results, warnings and errors is to be said.
QUIET = 'ADVERSARIAL_LCD_QUIET'
_GRACE_S = 3.0
_PR_SET_PDEATHSIG = 1
_PLAIN: Mapping[str, str] = {'\u202f': ' ', '\u00a0': ' ', '–': '-', '−': '-', '→': '->', '×': 'x',
                             '…': '~'}
_ERRORS = 'adversarial_lcd_plain'
_interrupted: list[int] = []  # the exit code, once a signal came


def interruptible(exit_code: int) -> None:
    """
    Let the first SIGINT or SIGTERM raise KeyboardInterrupt, and ignore the others.

    Some code swallows exceptions, and some clean-ups take long: what has not ended 3 s after
    the signal is cut off.

    Parameters
    ----------
    exit_code : int
        Of a process that was interrupted, or cut off.

    """
    def interrupt(number: int, frame: FrameType | None) -> None:
        ignore_signals()
        _interrupted.append(exit_code)
        # Not threading.Thread: its locks may be held by what was interrupted here.
        _thread.start_new_thread(_cut_off, (exit_code,))
        raise KeyboardInterrupt
    for number in SIGNALS:
        signal.signal(number, interrupt)
    # What calls back from C, as compiling does, swallows it too, and would print a traceback.
    told = sys.unraisablehook
    sys.unraisablehook = lambda found: (
        None if issubclass(found.exc_type, KeyboardInterrupt) else told(found))


def _leave() -> None:
    # Python ends a process by SIGINT, whatever its exit code, once a KeyboardInterrupt has passed
    # through exec of a text (dataclasses make their methods so), also if it was caught.
    if _interrupted:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError, AttributeError):
                stream.flush()
        os._exit(_interrupted[0])


def _cut_off(exit_code: int) -> None:
    time.sleep(_GRACE_S)
    os._exit(exit_code)


def ignore_signals() -> None:
    """Ignore SIGINT and SIGTERM from now on: a second Ctrl-C must not hit the clean-up."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def write_plainly() -> None:
    """
    Let stdout and stderr replace what their encoding lacks: a terminal need not be UTF-8.

    Where one was closed, what is written to it goes nowhere; its number would else be that of the
    next file that is opened.
    """
    _open_closed()
    codecs.register_error(_ERRORS, _replace)
    for stream in (sys.stdout, sys.stderr):
        # Some programs put streams of their own there, or none.
        reconfigure = getattr(stream, 'reconfigure', None)
        if reconfigure is not None:
            reconfigure(errors=_ERRORS)


def _open_closed() -> None:
    for number, name in enumerate(('stdin', 'stdout', 'stderr')):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free: this one
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, 'r' if number == 0 else 'w', encoding='utf-8',
                                    closefd=False))


def _replace(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start:error.end]
    return ''.join(_PLAIN.get(character, '?') for character in lacking), error.end


def end_with_supervisor() -> None:
    """
    Let this process be killed when the one that supervises it ends, also by kill -9.

    The system watches the thread that started this process, and forgets this when a process
    that has started it by way of a shell ends: only a direct child is watched.
    """
    supervisor = _supervisor()
    if supervisor is None or not sys.platform.startswith('linux'):
        return
    import ctypes

    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != supervisor[0]:  # it ended before the system was told
        os._exit(EXIT_USAGE)


def _supervisor() -> tuple[int, int] | None:
    """Return the supervisor's process id and the descriptor of its pipe; None: there is none."""
    given = os.environ.get(SUPERVISOR)
    if not given:
        return None
    process, descriptor = given.split()
    return int(process), int(descriptor)


def report(line: str) -> bool:
    """Tell the supervisor how it is going, in one line; False if nobody supervises."""
    supervisor = _supervisor()
    if supervisor is None:
        return False
    try:
        os.write(supervisor[1], line.encode('utf-8', 'replace') + b'\n')
    except OSError:
        return False  # it has just ended, and so will this process
    return True


def run_node_process(name: str) -> int:
    """
    Be the process of a node; return its exit code.

    0: it was done, or told to stop by SIGINT or SIGTERM at whatever time; 1: it failed; 2: the
    command line is wrong, or rclpy is missing.
    """
    interruptible(EXIT_OK)
    try:
        end_with_supervisor()
        write_plainly()
        problem = ros_problem()
        if problem:
            return _refuse(name, problem)
        report('loading')
        code: int = importlib.import_module(f'adversarial_lcd_ros.nodes.{name}').main()
        return code
    except KeyboardInterrupt:
        return EXIT_OK
    finally:
        ignore_signals()


def ros_problem() -> str:
    """Return why there is no ROS 2 here, and what to do, in one line; empty if there is."""
    remedy = ('source a ROS 2 installation, or take the libraries from PyPI: pip install '
              '"adversarial_lcd_ros[ros]"')
    if importlib.util.find_spec('rclpy') is None:
        return f'rclpy, the library of ROS 2 for Python, is not installed: {remedy}'
    try:
        importlib.import_module('rclpy')
        importlib.import_module('diagnostic_msgs')
    except ImportError as error:
        reason = str(error).splitlines()[0]
        return f'ROS 2 is not complete here ({reason}): {remedy}'
    return ''


def _refuse(name: str, problem: str) -> int:
    if not report(f'error {problem}'):
        print(f'{name}: {problem}', file=sys.stderr)
    return EXIT_USAGE


def attacker() -> int:
    """Be the node attacker."""
    return run_node_process('attacker')


def bag_replay() -> int:
    """Be the node bag_replay."""
    return run_node_process('bag_replay')


def graph_builder() -> int:
    """Be the node graph_builder."""
    return run_node_process('graph_builder')


def lcd() -> int:
    """Be the node lcd."""
    return run_node_process('lcd')


def map_builder() -> int:
    """Be the node map_builder."""
    return run_node_process('map_builder')


def viewer() -> int:
    """Be the node viewer."""
    return run_node_process('viewer')


# What is registered first runs last, when all others have cleaned up.
atexit.register(_leave)
