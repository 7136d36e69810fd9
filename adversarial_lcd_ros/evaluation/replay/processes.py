# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""One replay of a bag through the nodes, each a process of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
import os
from pathlib import Path

import yaml

from adversarial_lcd_ros.compiled.caching import code_folder
from adversarial_lcd_ros.config import AttackConfig, BuilderConfig, LcdConfig, ReplayConfig
from adversarial_lcd_ros.evaluation.replay.domain import VARIABLE
from adversarial_lcd_ros.evaluation.replay.supervision import (
    NodeProcess,
    Tell,
    await_end,
    ended_together,
)
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages.codec import (
    decode_attack_report,
    decode_graph,
    decode_loop_closure,
)
from adversarial_lcd_ros.messages.types import AttackReport, LoopClosure
from adversarial_lcd_ros.paths import share_path
from adversarial_lcd_ros.sequences.replay import read_messages

RECORDING = 'recording'
_MAN_IN_THE_MIDDLE = ('-r', 'graph:=graph_clean')


@dataclass(frozen=True)
class Setup:
    """
    Settings of the nodes.

    Without an attack, ``lcd`` listens to ``graph_builder``. Without a builder, the bag holds
    the clean graphs of an earlier replay. With the file of a key, the builder seals graphs, and
    ``lcd`` takes no others, however long ago those of a bag were sealed.
    """

    builder: BuilderConfig | None
    lcd: LcdConfig
    replay: ReplayConfig
    attack: AttackConfig | None = None
    key: str = ''


@dataclass(frozen=True)
class Recording:
    """
    What went over the wire in one replay.

    Attributes
    ----------
    clean, forwarded : list of MultiTierGraph
        As built, and as the detector got them; the same list without an attack.
    decisions : list of LoopClosure
        Under a key there is none on a graph that was refused.
    reports : list of AttackReport
        Empty without an attack.

    """

    clean: list[MultiTierGraph]
    forwarded: list[MultiTierGraph]
    decisions: list[LoopClosure]
    reports: list[AttackReport]


def run_pipeline(bag: Path, setup: Setup, folder: Path, domain: int,
                 tell: Tell = lambda text: None) -> Recording:
    """
    Replay a bag through real processes and return what was recorded.

    Parameters
    ----------
    bag : Path
        Bag with images, or with graphs where no builder is set up.
    setup : Setup
    folder : Path
        New folder; gets the recording, the parameters and a log of every node.
    domain : int
        ROS domain, from ``own_domain``.
    tell : callable
        Gets a line of text now and then, while nodes get ready.

    Raises
    ------
    EvaluationError
        A node ends early or fails; what it said is in the message.

    """
    folder.mkdir(parents=True)
    parameters = folder / 'parameters.yaml'
    parameters.write_text(yaml.safe_dump(_parameters(bag, setup, folder / RECORDING)),
                          encoding='utf-8')
    nodes: dict[str, Sequence[str]] = {'lcd': ()}
    if setup.builder:
        nodes['graph_builder'] = _MAN_IN_THE_MIDDLE if setup.attack else ()
    if setup.attack:
        nodes['attacker'] = ()
    # Its progress goes to the terminal; what it logs while it starts is of no use there.
    nodes['bag_replay'] = ('--log-level', 'warn')
    running: list[NodeProcess] = []
    with ended_together(running):
        for name, remaps in nodes.items():
            running.append(NodeProcess(
                # What they log is kept with the run, and not below the user's home.
                name, ['--ros-args', '--disable-external-lib-logs', '--params-file',
                       str(parameters), *remaps],
                node_environment(domain, folder.parent / 'compiled'), folder / f'{name}.log',
                keep_stderr=name == 'bag_replay'))
        await_end(running[-1], running[:-1], tell)
    return read_recording(folder, attacked=setup.attack is not None)


def _parameters(bag: Path, setup: Setup, recording: Path) -> dict[str, object]:
    key = {'key': str(Path(setup.key).resolve())} if setup.key else {}
    age = {'max_age_s': 0.0} if setup.key and not setup.builder else {}
    sections = {'lcd': {**asdict(setup.lcd), **key, **age},
                'bag_replay': {**asdict(setup.replay), **key, 'bag': str(bag.resolve()),
                               'record': str(recording.resolve()),
                               # They are in the bag; the next attack starts from the graphs.
                               'record_frames': False}}
    if setup.builder:
        sections['graph_builder'] = {**asdict(setup.builder), **key}
    if setup.attack:
        # On a busy machine an answer may be slow; an attack that ends for it is another attack.
        sections['attacker'] = {**asdict(setup.attack),
                                'query_timeout_s': setup.replay.timeout_s / 2}
    return {f'/**/{node}': {'ros__parameters': values} for node, values in sections.items()}


def node_environment(domain: int, spare: Path | None = None) -> Mapping[str, str]:
    """
    Return the environment of the nodes: on this machine only, in a domain of their own.

    Parameters
    ----------
    domain : int
    spare : Path, optional
        Folder for compiled code where it can be kept nowhere else.

    """
    kept = {'NUMBA_CACHE_DIR': str(spare.resolve())} if spare and code_folder() is None else {}
    return {**os.environ, **kept,
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            VARIABLE: str(domain),
            'FASTRTPS_DEFAULT_PROFILES_FILE': str(share_path('config/fastdds.xml')),
            # Three processes share the cores; their small matrices gain nothing from threads.
            'OMP_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1'}


def read_recording(folder: Path, attacked: bool) -> Recording:
    """Return what ``run_pipeline`` recorded in a folder; raises SequenceError, CodecError."""
    recording = folder / RECORDING
    forwarded = read_messages(recording, 'graph', decode_graph)
    decisions = read_messages(recording, 'loop_closures', decode_loop_closure)
    if not attacked:
        return Recording(forwarded, forwarded, decisions, [])
    return Recording(read_messages(recording, 'graph_clean', decode_graph), forwarded, decisions,
                     read_messages(recording, 'attack_report', decode_attack_report))
