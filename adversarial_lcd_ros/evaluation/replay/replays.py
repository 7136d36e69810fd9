# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""All runs of a replay, one after the other: clean, and under each attack."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
import shutil
import time

from adversarial_lcd_ros.attack.forging import change_between
from adversarial_lcd_ros.config import ReplayConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.replay.plan import Plan
from adversarial_lcd_ros.evaluation.replay.processes import (
    RECORDING,
    Recording,
    Setup,
    read_recording,
    run_pipeline,
)
from adversarial_lcd_ros.evaluation.replay.records import CLEAN
from adversarial_lcd_ros.evaluation.replay.supervision import Tell
from adversarial_lcd_ros.evaluation.replay.unfinished import finished_in_s, mark_finished
from adversarial_lcd_ros.graph_sequences.bags import CLEAN_TOPIC, GRAPH_TOPIC, write_graphs
from adversarial_lcd_ros.graph_sequences.opening import GraphSequence
from adversarial_lcd_ros.sequences import Sequence as CameraSequence
from adversarial_lcd_ros.sequences.bagfile import BagWriter
from adversarial_lcd_ros.sequences.replay import Replay


class Replays:
    """
    A bag replayed clean and under every attack, in one ROS domain.

    Parameters
    ----------
    bag : Path
    sequence : CameraSequence or GraphSequence
        What is in it.
    plan : Plan
    folder : Path
        For the recordings; those of finished runs that are there are read, not made again.
    domain : int
    tell : callable
        Gets a line of text for each run.

    """

    def __init__(self, bag: Path, sequence: CameraSequence | GraphSequence, plan: Plan,
                 folder: Path, domain: int, tell: Tell) -> None:
        self._bag, self._sequence, self._plan = bag, sequence, plan
        self._folder, self._domain, self._tell = folder, domain, tell
        self._frames = Replay(bag, plan.replay).frame_count

    def run(self) -> tuple[dict[str, Recording], float]:
        """Return the recordings by name of the run, and how long the earlier ones took."""
        runs: dict[str, Recording] = {}
        earlier_s = 0.0
        for number, (name, attack) in enumerate([(CLEAN, None), *self._plan.attacks.items()]):
            built = self._built_by(name)
            title = (f'run {number + 1} of {len(self._plan.attacks) + 1}: {name}'
                     + ('' if built is None else f' (from the graphs of run {built + 1})'))
            folder = self._folder / f'{number}'
            spent_s = finished_in_s(folder)
            if spent_s is not None:
                self._tell(f'{title}: finished earlier')
                earlier_s += spent_s
                runs[name] = read_recording(folder, attacked=attack is not None)
                continue
            self._tell(title)
            began_s = time.monotonic()
            shutil.rmtree(folder, ignore_errors=True)
            source, setup = self._source(number, name, built)
            runs[name] = run_pipeline(source, setup, folder, self._domain, self._tell)
            _check(name, runs[name], self._frames)
            mark_finished(folder, time.monotonic() - began_s)
        return runs, earlier_s

    def _built_by(self, name: str) -> int | None:
        """Return the number of the run whose clean graphs a run starts from; None: from images."""
        plan = self._plan
        first = next((number for number, attack in enumerate(plan.attacks, 1)
                      if attack not in plan.posters), None)
        if plan.rebuild or name == CLEAN or name in plan.posters or first is None:
            return None
        return None if list(plan.attacks)[first - 1] == name else first

    def _source(self, number: int, name: str, built: int | None) -> tuple[Path, Setup]:
        """Return the bag of a run and the settings of its nodes."""
        plan, attack = self._plan, self._plan.attacks.get(name)
        if built is not None:
            # The recording holds the chosen frames only: nothing is to be skipped again.
            every = ReplayConfig()
            replay = replace(plan.replay, start_s=every.start_s, duration_s=every.duration_s,
                             stride=every.stride)
            return (self._folder / f'{built}' / RECORDING,
                    Setup(None, plan.lcd, replay, attack))
        setup = Setup(plan.builder, plan.lcd, plan.replay_of(name), attack)
        if not isinstance(self._sequence, GraphSequence):
            return self._bag, setup
        # Where the graphs enter the pipeline depends on whether somebody is in the middle.
        source = self._folder / f'graphs_{number}'
        shutil.rmtree(source, ignore_errors=True)
        with BagWriter(source) as copy:
            write_graphs(copy, self._sequence, CLEAN_TOPIC if attack else GRAPH_TOPIC)
        return source, setup


def _check(name: str, run: Recording, frames: int) -> None:
    """Refuse a run that lost a message or whose attacker broke its word."""
    counts = {'graphs': len(run.clean), 'forwarded graphs': len(run.forwarded),
              'decisions': len(run.decisions)}
    if name != CLEAN:
        counts['attack reports'] = len(run.reports)
    wrong = {what: count for what, count in counts.items() if count != frames}
    if wrong:
        raise EvaluationError(f'run {name}: {frames} frames, but ' + ', '.join(
            f'{count} {what}' for what, count in wrong.items()))
    for before, after, report in zip(run.clean, run.forwarded, run.reports, strict=False):
        change = change_between(before, after)
        if change.nodes > report.node_budget:
            raise EvaluationError(f'run {name}: graph {before.sequence} was changed in '
                                  f'{change.nodes} nodes, over its budget of '
                                  f'{report.node_budget}')
        if change.edits > report.edit_budget:
            raise EvaluationError(f'run {name}: graph {before.sequence} was changed in more '
                                  f'edges than its budget of {report.edit_budget}')
