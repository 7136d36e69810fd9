# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Start, life and end of a node process; what all nodes have in common.

A callback decodes, calls the core once, encodes and publishes: so the same comes out over the wire
and offline, and a test holds decisions, forwarded graphs and reports equal. rclpy's executor of
events is used where a node has no guard condition: listing what to wait for took a third of the
time of lockstep.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import importlib
import importlib.util
import os
from pathlib import Path
import secrets
import signal
import sys
from threading import Event
from typing import Any, ClassVar

import rclpy
from rclpy.context import Context
from rclpy.exceptions import InvalidNamespaceException, InvalidTopicNameException
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from adversarial_lcd_ros.config import Config
from adversarial_lcd_ros.errors import AdversarialLcdError, ConfigError
from adversarial_lcd_ros.nodes import parameters
from adversarial_lcd_ros.nodes.diagnostics import Diagnostics
from adversarial_lcd_ros.start import SIGNALS, ignore_signals, interruptible, report

EXIT_OK, EXIT_ERROR, EXIT_USAGE = 0, 1, 2
NO_LOG_FILES = ['--ros-args', '--disable-external-lib-logs', '--']
# What a node says once it takes messages.
READY = 'ready'
_SPIN_S = 0.1
_OF_ROS = ('/rosout', '/parameter_events')
_BAD_ARGUMENTS = (
    rclpy_implementation.RCLError, rclpy_implementation.RCLInvalidROSArgsError,
    rclpy_implementation.UnknownROSArgsError, InvalidNamespaceException,
    InvalidTopicNameException)


@dataclass(frozen=True)
class Manual:
    """What ``--help`` prints of a node: its purpose, and a line for each topic."""

    purpose: str
    subscribes: tuple[str, ...] = ()
    publishes: tuple[str, ...] = ()


class PipelineNode(Node):  # type: ignore[misc]
    """
    A node whose parameters are settings of the package, with counts on /diagnostics.

    Parameters
    ----------
    options
        Of ``rclpy.node.Node``: context, parameter_overrides, use_global_arguments, namespace.

    Attributes
    ----------
    session : int
        Another one for each run: tells a restart to whoever reads its messages.
    inputs : list of str
        Topics that are subscribed to once they have a publisher.
    wakes_itself : bool
        It has guard conditions, and needs an executor that knows of them.

    Raises
    ------
    ConfigError
        A parameter is unknown, of the wrong type or out of range.

    """

    default_name: ClassVar[str]
    manual: ClassVar[Manual]
    configs: ClassVar[tuple[type[Config], ...]]
    wakes_itself: ClassVar[bool] = False

    def __init__(self, **options: Any) -> None:
        super().__init__(self.default_name, automatically_declare_parameters_from_overrides=True,
                         **options)
        self.settings: list[Any] = parameters.declare(self, self.configs)
        self.diagnostics = Diagnostics(self, self.manual.purpose)
        self.session = secrets.randbits(64) or 1
        self.inputs: list[str] = []
        self.say('loading')

    def say_ready(self, about: str, *outputs: str) -> None:
        """
        Log what the node is and on which topics; see that QoS overrides are for some of them.

        Parameters
        ----------
        about : str
            The settings that tell most.
        outputs : str
            Topics that will have a publisher later.

        """
        heard = sorted({*self.inputs, *(entry.topic_name for entry in self.subscriptions)})
        said = sorted({*map(self.resolve_topic_name, outputs),
                       *(entry.topic_name for entry in self.publishers)} - set(_OF_ROS))
        parameters.check_overridden_topics(self, subscription=heard, publisher=said)
        self.say(READY, f'{about}; hears {", ".join(heard)}; publishes {", ".join(said)}')

    def destroy_node(self) -> None:
        """Log what was counted before the publishers go."""
        if self.context.ok():
            self.get_logger().info(f'end: {self.diagnostics.summary()}')
        super().destroy_node()

    def say(self, state: str, about: str = '') -> None:
        """Tell how far the start has come: to the log, to /diagnostics, and to a supervisor."""
        self.get_logger().info(f'{state}: {about}' if about else state)
        self.diagnostics.state = '' if state == READY else state
        self.diagnostics.publish()
        report(state)

    def work(self, spin: Callable[[float], bool]) -> int:
        """
        Work until told to stop, and return the exit code.

        Parameters
        ----------
        spin : callable
            Runs callbacks for at most the given seconds; False once the node shall stop.

        """
        while spin(_SPIN_S):
            pass
        return EXIT_OK

    def close(self) -> None:
        """Finish what is under way; called before the node is destroyed."""


def run_node(node_class: type[PipelineNode], args: Sequence[str] | None = None) -> int:
    """
    Run a node as a process until it is done or gets SIGINT or SIGTERM; return the exit code.

    Parameters
    ----------
    node_class : type
        A PipelineNode.
    args : sequence of str, optional
        Command line without the program; that of the process if not given.

    """
    arguments = list(sys.argv[1:] if args is None else args)
    own_process = args is None
    context = Context()
    if own_process:
        interruptible(EXIT_OK)
    try:
        _parser(node_class).parse_args(remove_ros_args(['', *arguments])[1:])
        # rclpy's own handlers shut the context down under a callback that is publishing.
        rclpy.init(args=[*arguments, *_without_log_files(arguments)], context=context,
                   signal_handler_options=SignalHandlerOptions.NO)
        return _live(node_class, context, own_process)
    except KeyboardInterrupt:  # before the node was ready
        return EXIT_OK
    except SystemExit as end:  # argparse: --help, or an argument that is none
        return int(end.code or EXIT_OK)
    except (AdversarialLcdError, *_BAD_ARGUMENTS) as error:
        # A supervisor tells it himself, as the last that he says.
        if not report(f'error {_one_line(error)}'):
            print(f'{node_class.default_name}: {_one_line(error)}', file=sys.stderr)
        known = isinstance(error, AdversarialLcdError) and not isinstance(error, ConfigError)
        return EXIT_ERROR if known else EXIT_USAGE
    finally:
        if own_process:
            ignore_signals()
        context.try_shutdown()


def _without_log_files(arguments: Sequence[str]) -> list[str]:
    """Return arguments that keep rclpy from log files where there is no place for them."""
    if NO_LOG_FILES[1] in arguments:
        return []
    chosen, home = os.environ.get('ROS_LOG_DIR'), os.environ.get('ROS_HOME')
    try:
        place = Path(chosen or home or '~/.ros').expanduser()
    except RuntimeError:  # no home
        place = None
    # rclpy makes the folder; what must be there, and be open to writing, is a folder above it.
    while place and not place.exists() and place != place.parent:
        place = place.parent
    if place and os.access(place, os.W_OK):
        return []
    print('no log files are kept: set ROS_LOG_DIR to a folder that can be written',
          file=sys.stderr)
    return NO_LOG_FILES


def _live(node_class: type[PipelineNode], context: Context, own_process: bool) -> int:
    node = node_class(context=context)
    executor = make_executor(context, node_class.wakes_itself)
    executor.add_node(node)
    stop = Event()
    with _stopping(stop, restore=not own_process):
        try:
            # The nodes of a pipeline share the cores. BLAS threads that wait spinning for a core
            # another node has cost three times the time (measured: 36 ms a graph in lcd, not 12).
            with threadpool_limits(1):
                return node.work(lambda seconds: _spin(executor, stop, seconds))
        finally:
            # A second Ctrl-C, or launch's, must not hit what follows.
            ignore_signals()
            node.close()
            executor.shutdown()
            node.destroy_node()


def make_executor(context: Context, guard_conditions: bool = False) -> Executor:
    """
    Return what runs callbacks in one thread.

    Rclpy's executor of events, where this release has it: the other one lists in Python all that
    there is to wait for, each time anew, which takes it longer than most callbacks here. The one
    of events has no guard conditions.
    """
    if guard_conditions or importlib.util.find_spec('rclpy.experimental') is None:
        return SingleThreadedExecutor(context=context)
    events = importlib.import_module('rclpy.experimental.events_executor')
    executor: Executor = events.EventsExecutor(context=context)
    return executor


def _spin(executor: Executor, stop: Event, seconds: float) -> bool:
    if not stop.is_set():
        executor.spin_once(timeout_sec=seconds)
    return not stop.is_set()


@contextmanager
def _stopping(stop: Event, restore: bool) -> Iterator[None]:
    """Turn signals into the event; a process of its own leaves them ignored until it is gone."""
    before = {number: signal.signal(number, lambda *_: stop.set()) for number in SIGNALS}
    try:
        yield
    finally:
        if restore:
            for number, handler in before.items():
                signal.signal(number, handler)


def _one_line(error: Exception) -> str:
    return ' '.join(str(error).split())


def _parser(node_class: type[PipelineNode]) -> argparse.ArgumentParser:
    manual = node_class.manual
    lines = ['Subscribes:', *(f'  {line}' for line in manual.subscribes),
             'Publishes:', *(f'  {line}' for line in manual.publishes),
             'Parameters (--ros-args -p NAME:=VALUE, or --params-file FILE):',
             *parameters.describe(node_class.configs)]
    return argparse.ArgumentParser(
        prog=node_class.default_name, description=manual.purpose, epilog='\n'.join(lines),
        usage='%(prog)s [-h] [--ros-args -r NAME:=NAME -p NAME:=VALUE --params-file FILE]',
        formatter_class=argparse.RawDescriptionHelpFormatter)
