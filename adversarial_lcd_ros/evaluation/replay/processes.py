"""One replay of a bag through the nodes, each a process of its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

import yaml

from adversarial_lcd_ros.codec import (
    AttackReport,
    LoopClosure,
    decode_attack_report,
    decode_graph,
    decode_loop_closure,
)
from adversarial_lcd_ros.config import AttackConfig, BuilderConfig, LcdConfig, ReplayConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.paths import share_path
from adversarial_lcd_ros.sequences.replay import read_payloads

STOP_TIMEOUT_S = 15.0
POLL_S = 0.1
LOG_TAIL_LINES = 8
_MAN_IN_THE_MIDDLE = ('-r', 'graph:=graph_clean')


@dataclass(frozen=True)
class Setup:
    """
    Settings of the nodes.

    Without an attack, ``lcd`` listens to ``graph_builder``. Without a builder, the bag holds
    the clean graphs of an earlier replay.
    """

    builder: BuilderConfig | None
    lcd: LcdConfig
    replay: ReplayConfig
    attack: AttackConfig | None = None


@dataclass(frozen=True)
class Recording:
    """
    What went over the wire in one replay.

    Attributes
    ----------
    clean, forwarded : list of MultiTierGraph
        As built, and as the detector got them; the same list without an attack.
    decisions : list of LoopClosure
    reports : list of AttackReport
        Empty without an attack.

    """

    clean: list[MultiTierGraph]
    forwarded: list[MultiTierGraph]
    decisions: list[LoopClosure]
    reports: list[AttackReport]


def run_pipeline(bag: Path, setup: Setup, folder: Path) -> Recording:
    """
    Replay a bag through real processes and return what was recorded.

    Parameters
    ----------
    bag : Path
        Bag with images, or with graphs where no builder is set up.
    setup : Setup
    folder : Path
        New folder; gets the recording, the parameters and a log of every node.

    Raises
    ------
    EvaluationError
        A node ends early or fails; the tail of its log is in the message.

    """
    folder.mkdir(parents=True)
    parameters = folder / 'parameters.yaml'
    parameters.write_text(yaml.safe_dump(_parameters(bag, setup, folder / 'recording')),
                          encoding='utf-8')
    nodes: list[tuple[str, Sequence[str]]] = [('lcd', ())]
    if setup.builder:
        nodes.append(('graph_builder', _MAN_IN_THE_MIDDLE if setup.attack else ()))
    if setup.attack:
        nodes.append(('attacker', ()))
    with ExitStack() as stack:
        running = {name: stack.enter_context(_node(name, parameters, arguments, folder))
                   for name, arguments in nodes}
        # Its progress goes to the terminal.
        replay = stack.enter_context(
            _node('bag_replay', parameters, (), folder, keep_stderr=True))
        _await_end(replay, running, folder)
    return _read(folder / 'recording', attacked=setup.attack is not None)


def _parameters(bag: Path, setup: Setup, recording: Path) -> dict[str, object]:
    sections = {'lcd': asdict(setup.lcd),
                'bag_replay': {**asdict(setup.replay), 'bag': str(bag.resolve()),
                               'record': str(recording.resolve())}}
    if setup.builder:
        sections['graph_builder'] = asdict(setup.builder)
    if setup.attack:
        sections['attacker'] = asdict(setup.attack)
    return {f'/**/{node}': {'ros__parameters': values} for node, values in sections.items()}


def node_environment() -> Mapping[str, str]:
    """Return the environment of the nodes: on this machine only, in a domain of their own."""
    return {**os.environ,
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_DOMAIN_ID': str(1 + os.getpid() % 100),
            'FASTRTPS_DEFAULT_PROFILES_FILE': str(share_path('config/fastdds.xml')),
            # Three processes share the cores; their small matrices gain nothing from threads.
            'OMP_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1'}


@contextmanager
def _node(name: str, parameters: Path, arguments: Sequence[str], folder: Path,
          keep_stderr: bool = False) -> Iterator[subprocess.Popen[bytes]]:
    """Start a node; on the way out, interrupt it and see it end."""
    command = [sys.executable, '-m', f'adversarial_lcd_ros.nodes.{name}', '--ros-args',
               '--params-file', str(parameters), *arguments]
    with (folder / f'{name}.log').open('wb') as log:
        process = subprocess.Popen(command, env=node_environment(), stdout=log,
                                   start_new_session=True,
                                   stderr=None if keep_stderr else subprocess.STDOUT)
        try:
            yield process
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            try:
                process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
    if process.returncode:
        raise EvaluationError(_failure(name, process.returncode, folder))


def _await_end(replay: subprocess.Popen[bytes], running: Mapping[str, subprocess.Popen[bytes]],
               folder: Path) -> None:
    """Wait until the replay is over, while every node lives."""
    while replay.poll() is None:
        for name, process in running.items():
            if process.poll() is not None:
                raise EvaluationError(_failure(name, process.returncode, folder))
        time.sleep(POLL_S)


def _failure(name: str, code: int, folder: Path) -> str:
    log = folder / f'{name}.log'
    tail = log.read_text(encoding='utf-8', errors='replace').splitlines()[-LOG_TAIL_LINES:]
    said = ' | '.join(line.strip() for line in tail if line.strip())
    return f'node {name} ended with exit code {code}: {said or "it said nothing"} (log: {log})'


def _read(recording: Path, attacked: bool) -> Recording:
    forwarded = [decode_graph(payload) for _, payload in read_payloads(recording, 'graph')]
    decisions = [decode_loop_closure(payload)
                 for _, payload in read_payloads(recording, 'loop_closures')]
    if not attacked:
        return Recording(forwarded, forwarded, decisions, [])
    return Recording(
        [decode_graph(payload) for _, payload in read_payloads(recording, 'graph_clean')],
        forwarded, decisions,
        [decode_attack_report(payload)
         for _, payload in read_payloads(recording, 'attack_report')])
