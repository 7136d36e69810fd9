# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Evaluation of one sequence over ROS 2: the same bag replayed clean and attacked.

Under attack the map consists of attacked graphs: the detector stores what it was sent. The clean
run and the first attack start from the images, which shows whether the graphs come out the same;
further attacks replay the clean graphs of the first. Frames, graphs, decisions and reports are
equal in number, or the run fails: a figure over fewer frames is another figure. Replays are in
lockstep with a window of four frames: builder, attacker and detector work side by side, and
nothing is lost. A run with a poster of its own always starts from the images.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
import shutil
import time
from typing import Any

from adversarial_lcd_ros.config import BuilderConfig
from adversarial_lcd_ros.errors import AdversarialLcdError, EvaluationError
from adversarial_lcd_ros.evaluation.replay.domain import own_domain
from adversarial_lcd_ros.evaluation.replay.figures import label_run, make_figures
from adversarial_lcd_ros.evaluation.replay.label_variants import SWEEP, sweep_labels, write_sweep
from adversarial_lcd_ros.evaluation.replay.pictures import telling_pictures
from adversarial_lcd_ros.evaluation.replay.plan import Plan
from adversarial_lcd_ros.evaluation.replay.processes import Recording
from adversarial_lcd_ros.evaluation.replay.recipe import POSTERS
from adversarial_lcd_ros.evaluation.replay.records import CLEAN, QueryRecord
from adversarial_lcd_ros.evaluation.replay.replays import Replays
from adversarial_lcd_ros.evaluation.replay.report import write_results
from adversarial_lcd_ros.evaluation.replay.supervision import Tell
from adversarial_lcd_ros.evaluation.replay.unfinished import (
    RECORDINGS,
    finished_in_s,
    plan_digest,
    results_folder,
)
from adversarial_lcd_ros.evaluation.results import ResultsFolder
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.graph_sequences.opening import (
    GraphSequence,
    holds_graphs,
    open_graphs,
)
from adversarial_lcd_ros.ground_truth.labelling import label_graphs
from adversarial_lcd_ros.lcd.targets import check_variant
from adversarial_lcd_ros.paths import target_path
from adversarial_lcd_ros.registry import TARGETS
from adversarial_lcd_ros.sequences import Sequence as CameraSequence
from adversarial_lcd_ros.sequences import open_sequence


def evaluate_live(bag: Path, output: Path, plan: Plan, *, command_line: Sequence[str] = (),
                  tell: Tell = lambda text: None,
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
    # Whether the nodes still live is watched here: the replay waits for them without a limit.
    plan = replace(plan, replay=replace(plan.replay, lockstep=True, loop=1, start_timeout_s=0.0))
    sequence = _open(bag, plan, tell)
    digest = plan_digest(bag, plan.sections, plan.rebuild)
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
        _write_setup(folder, plan, command_line,
                     {'ros_domain_id': domain, 'source': str(bag.resolve())})
        write_results(folder, summary, records, telling_pictures(
            sequence, clean, runs, records, summary,
            {name: plan.replay_of(name) for name in plan.posters}))
        if not keep_recordings:
            shutil.rmtree(folder.path / RECORDINGS)
        return folder.finish(), summary


def _open(bag: Path, plan: Plan, tell: Tell) -> CameraSequence | GraphSequence:
    """Return what is in the bag; refuse what would fail after the first minutes of a replay."""
    sequence = open_sequence(bag) if plan.builder else open_graphs(str(bag), BuilderConfig())
    if sequence.trajectory is None:
        if plan.sweep_labels:
            raise EvaluationError(f'{bag} has no ground truth: there are no labels to vary')
        tell('no ground truth: decisions that change are counted, none can be scored')
    target_path(plan.lcd.model, plan.lcd.target)  # or the node would end for want of it
    if isinstance(sequence, GraphSequence):
        check_variant(TARGETS.find(plan.lcd.target), sequence.graphs[0])
    return sequence


def _figures(sequence: CameraSequence | GraphSequence, clean: Recording,
             runs: Mapping[str, Recording], plan: Plan
             ) -> tuple[list[QueryRecord], dict[str, Any]]:
    """Return the records of all runs, and what they come to."""
    records, summary = make_figures(
        sequence.name, label_run(sequence, clean, plan.labels), clean, runs, plan.attacks,
        plan.lcd, plan.seed)
    for attack in summary['attacks']:
        if attack['name'] in plan.posters:
            hung = plan.replay_of(attack['name'])
            attack['poster'] = {'kind': hung.poster, 'share': hung.poster_share,
                                'sheets': hung.poster_sheets, 'spans': hung.poster_spans}
    summary['graphs_rebuilt_differently'] = {
        name: _differing(clean.clean, run.clean) for name, run in runs.items()
        if name not in plan.posters}
    if plan.sweep_labels and sequence.trajectory:
        label = partial(label_graphs, clean.clean, sequence.trajectory, sequence.source)
        summary['label_sweep'] = sweep_labels(records, label, plan.labels)
    return records, summary


@contextmanager
def _kept(folder: Path, tell: Tell) -> Iterator[None]:
    """Say what is kept of an evaluation that ends early."""
    try:
        yield
    except (AdversarialLcdError, KeyboardInterrupt):
        finished = sum(finished_in_s(run) is not None
                       for run in (folder / RECORDINGS).iterdir() if run.is_dir())
        tell(f'{finished} finished runs are kept in {folder}; the same command goes on from '
             'there, "adversarial-lcd clean" clears it away')
        raise


def _without_builder(bag: Path, plan: Plan, tell: Tell) -> Plan:
    if plan.rebuild:
        raise EvaluationError(f'{bag} has graphs and no images: nothing can be rebuilt')
    if plan.posters:
        raise EvaluationError(f'{bag} has graphs and no images to paste a poster into: expected '
                              'a bag with images, or attacks without a poster')
    tell('the bag has graphs: they are used as they are, without a graph_builder')
    return replace(plan, builder=None)


def _differing(first: Sequence[MultiTierGraph], second: Sequence[MultiTierGraph]) -> int:
    """Count the frames whose clean graph was built differently in another replay."""
    return sum(a != b for a, b in zip(first, second, strict=True))


def _write_setup(folder: ResultsFolder, plan: Plan, command_line: Sequence[str],
                 extra: Mapping[str, Any]) -> None:
    sections = (plan.builder, plan.lcd, plan.labels, plan.replay, *plan.attacks.values())
    folder.write_setup([section for section in sections if section], command_line, plan.seed,
                       {**extra, **({POSTERS: dict(plan.posters)} if plan.posters else {})})
