# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Evaluation of one sequence over ROS 2: the same bag replayed clean and attacked.

Under attack the map consists of attacked graphs: the detector stores what it was sent. The clean
run and the first attack start from the images, which shows whether the graphs come out the same;
further attacks replay the clean graphs of the first. Frames, graphs, decisions and reports are
equal in number, or the run fails: a figure over fewer frames is another figure. Replays are in
lockstep with a window of four frames: builder, attacker and detector work side by side, and
nothing is lost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
import shutil
import time
from typing import Any

from adversarial_lcd_ros.attack.forging import change_between
from adversarial_lcd_ros.config import (
    AttackConfig,
    BuilderConfig,
    LabelConfig,
    LcdConfig,
    ReplayConfig,
)
from adversarial_lcd_ros.errors import AdversarialLcdError, EvaluationError
from adversarial_lcd_ros.evaluation.pictures import Picture
from adversarial_lcd_ros.evaluation.replay.behind import ask_check
from adversarial_lcd_ros.evaluation.replay.domain import own_domain
from adversarial_lcd_ros.evaluation.replay.label_variants import SWEEP, sweep_labels, write_sweep
from adversarial_lcd_ros.evaluation.replay.processes import (
    RECORDING,
    Recording,
    Setup,
    read_recording,
    run_pipeline,
)
from adversarial_lcd_ros.evaluation.replay.records import (
    CLEAN,
    AttackRun,
    QueryRecord,
    make_records,
)
from adversarial_lcd_ros.evaluation.replay.report import write_results
from adversarial_lcd_ros.evaluation.replay.summary import GraphStatistics, summarise
from adversarial_lcd_ros.evaluation.replay.telling import telling_pictures
from adversarial_lcd_ros.evaluation.replay.unexplained import unexplained_edges
from adversarial_lcd_ros.evaluation.replay.unfinished import (
    RECORDINGS,
    finished_in_s,
    mark_finished,
    plan_digest,
    results_folder,
)
from adversarial_lcd_ros.evaluation.results import ResultsFolder
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.graph_sequences.bags import CLEAN_TOPIC, GRAPH_TOPIC, write_graphs
from adversarial_lcd_ros.graph_sequences.opening import (
    GraphSequence,
    holds_graphs,
    open_graphs,
)
from adversarial_lcd_ros.ground_truth.labelling import label_graphs
from adversarial_lcd_ros.ground_truth.labels import FrameLabels, unlabelled
from adversarial_lcd_ros.lcd.targets import check_variant
from adversarial_lcd_ros.paths import target_path
from adversarial_lcd_ros.registry import TARGETS
from adversarial_lcd_ros.sequences import Sequence as CameraSequence
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.sequences.bagfile import BagWriter
from adversarial_lcd_ros.sequences.replay import Replay


@dataclass(frozen=True)
class Plan:
    """
    Everything that decides what an evaluation gives.

    Attributes
    ----------
    builder, lcd, labels, replay
        Settings; the replay is in lockstep, whatever they say. None for a builder: the bag has
        graphs.
    attacks : mapping
        Settings of every attack by the name of its run.
    rebuild : bool
        Replay the images for every attack. Otherwise they are for the first one, which shows
        whether the graphs come out the same, and the others start from the graphs of that run.
    seed : int
        Of the bootstrap.
    sweep_labels : bool
        Label the decisions with other thresholds, too.

    """

    builder: BuilderConfig | None
    lcd: LcdConfig
    labels: LabelConfig
    replay: ReplayConfig
    attacks: Mapping[str, AttackConfig]
    rebuild: bool = False
    seed: int = 42
    sweep_labels: bool = False


def evaluate_live(bag: Path, output: Path, plan: Plan, *, command_line: Sequence[str] = (),
                  tell: Callable[[str], None] = lambda text: None,
                  keep_recordings: bool = False) -> tuple[Path, dict[str, Any]]:
    """
    Replay a bag without and with every attack; return the results folder and the summary.

    Parameters
    ----------
    bag : Path
        Bag with images, as "adversarial-lcd import" writes it; or with graphs, as
        "adversarial-lcd build" does: these are used as they are, whatever the settings of the
        builder. Without ground truth no decision is scored, and what changes is counted.
    output : Path
        Folder in which the results folder is made; an unfinished one of the same plan that is
        there is gone on with.
    plan : Plan
    command_line : sequence of str
        Kept with the results.
    tell : callable
        Gets a line of text for each step.
    keep_recordings : bool
        Keep everything that went over the wire (about 30 MB a run of 360 frames).

    Raises
    ------
    EvaluationError
        A node failed, or messages were lost.

    """
    started_s = time.monotonic()
    if holds_graphs(bag):
        plan = _without_builder(bag, plan, tell)
    sequence = open_sequence(bag) if plan.builder else open_graphs(str(bag), BuilderConfig())
    if sequence.trajectory is None:
        if plan.sweep_labels:
            raise EvaluationError(f'{bag} has no ground truth: there are no labels to vary')
        tell('no ground truth: decisions that change are counted, none can be scored')
    target_path(plan.lcd.model, plan.lcd.target)  # or the node would end for want of it
    if isinstance(sequence, GraphSequence):
        check_variant(TARGETS.find(plan.lcd.target), sequence.graphs[0])
    # Whether the nodes still live is watched here: the replay waits for them without a limit.
    plan = replace(plan, replay=replace(plan.replay, lockstep=True, loop=1, start_timeout_s=0.0))
    digest = plan_digest(bag, {'builder': plan.builder, 'lcd': plan.lcd, 'replay': plan.replay,
                               **{f'attack {name}': attack
                                  for name, attack in plan.attacks.items()}}, plan.rebuild)
    with own_domain() as domain, results_folder(output, digest) as folder:
        tell(f'ROS domain {domain}')
        with _kept(folder.path, tell):
            runs, earlier_s = Replays(bag, sequence, plan, folder.path / RECORDINGS, domain,
                                      tell).run()
        tell('labels, figures and pictures')
        clean = runs.pop(CLEAN)
        records, summary = _figures(sequence, clean, runs, plan)
        if plan.sweep_labels:
            write_sweep(folder.path / SWEEP, summary['label_sweep'])
        summary['duration_s'] = earlier_s + time.monotonic() - started_s
        _write(folder, plan, summary, records, command_line,
               {'ros_domain_id': domain, 'source': str(bag.resolve())},
               telling_pictures(sequence, clean, runs, records, summary))
        if not keep_recordings:
            shutil.rmtree(folder.path / RECORDINGS)
        return folder.finish(), summary


def _figures(sequence: CameraSequence | GraphSequence, clean: Recording,
             runs: Mapping[str, Recording], plan: Plan
             ) -> tuple[list[QueryRecord], dict[str, Any]]:
    """Return the records of all runs, and what they come to."""
    labels = _labels(sequence, clean, plan)
    records = make_records(labels, clean.decisions, {
        name: AttackRun(run.decisions, run.reports) for name, run in runs.items()})
    sent = {CLEAN: clean.clean, **{name: run.forwarded for name, run in runs.items()}}
    records = ask_check(records, sent, plan.lcd)
    summary = summarise(sequence.name, records, plan.attacks, GraphStatistics.of(
        [graph.node_count for graph in clean.clean],
        [graph.edge_count for graph in clean.clean]), plan.seed, plan.lcd,
        told_by=labels.told_by)
    summary['unexplained_edges'] = unexplained_edges(sent, plan.lcd)
    summary['graphs_rebuilt_differently'] = {
        name: _differing(clean.clean, run.clean) for name, run in runs.items()}
    if plan.sweep_labels and sequence.trajectory:
        label = partial(label_graphs, clean.clean, sequence.trajectory, sequence.source)
        summary['label_sweep'] = sweep_labels(records, label, plan.labels)
    return records, summary


@contextmanager
def _kept(folder: Path, tell: Callable[[str], None]) -> Iterator[None]:
    """Say what is kept of an evaluation that ends early."""
    try:
        yield
    except (AdversarialLcdError, KeyboardInterrupt):
        finished = sum(finished_in_s(run) is not None
                       for run in (folder / RECORDINGS).iterdir() if run.is_dir())
        tell(f'{finished} finished runs are kept in {folder}; the same command goes on from '
             'there, "adversarial-lcd clean" clears it away')
        raise


def _labels(sequence: CameraSequence | GraphSequence, clean: Recording,
            plan: Plan) -> FrameLabels:
    if sequence.trajectory is None:
        return unlabelled([graph.stamp_ns for graph in clean.clean])
    return label_graphs(clean.clean, sequence.trajectory, sequence.source, plan.labels)


def _without_builder(bag: Path, plan: Plan, tell: Callable[[str], None]) -> Plan:
    if plan.rebuild:
        raise EvaluationError(f'{bag} has graphs and no images: nothing can be rebuilt')
    tell('the bag has graphs: they are used as they are, without a graph_builder')
    return replace(plan, builder=None)


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
                 folder: Path, domain: int, tell: Callable[[str], None]) -> None:
        self._bag, self._sequence, self._plan = bag, sequence, plan
        self._folder, self._domain, self._tell = folder, domain, tell
        self._frames = Replay(bag, plan.replay).frame_count

    def run(self) -> tuple[dict[str, Recording], float]:
        """Return the recordings by name of the run, and how long the earlier ones took."""
        runs: dict[str, Recording] = {}
        earlier_s = 0.0
        for number, (name, attack) in enumerate([(CLEAN, None), *self._plan.attacks.items()]):
            from_bag = self._plan.rebuild or number < 2
            title = (f'run {number + 1} of {len(self._plan.attacks) + 1}: {name}'
                     + ('' if from_bag else ' (from the graphs of run 2)'))
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
            source, setup = self._source(number, attack, from_bag)
            runs[name] = run_pipeline(source, setup, folder, self._domain, self._tell)
            _check(name, runs[name], self._frames)
            mark_finished(folder, time.monotonic() - began_s)
        return runs, earlier_s

    def _source(self, number: int, attack: AttackConfig | None,
                from_bag: bool) -> tuple[Path, Setup]:
        """Return the bag of a run and the settings of its nodes."""
        plan = self._plan
        if not from_bag:
            # The recording holds the chosen frames only: nothing is to be skipped again.
            every = ReplayConfig()
            replay = replace(plan.replay, start_s=every.start_s, duration_s=every.duration_s,
                             stride=every.stride)
            return self._folder / '1' / RECORDING, Setup(None, plan.lcd, replay, attack)
        setup = Setup(plan.builder, plan.lcd, plan.replay, attack)
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


def _differing(first: Sequence[MultiTierGraph], second: Sequence[MultiTierGraph]) -> int:
    """Count the frames whose clean graph was built differently in another replay."""
    return sum(a != b for a, b in zip(first, second, strict=True))


def _write(folder: ResultsFolder, plan: Plan, summary: Mapping[str, Any],
           records: Sequence[QueryRecord], command_line: Sequence[str],
           extra: Mapping[str, Any], pictures: Sequence[Picture]) -> None:
    sections = (plan.builder, plan.lcd, plan.labels, plan.replay, *plan.attacks.values())
    folder.write_setup([section for section in sections if section], command_line, plan.seed,
                       extra)
    write_results(folder, summary, records, pictures)
