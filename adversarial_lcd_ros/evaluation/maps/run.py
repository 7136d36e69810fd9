# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Maps of a replay: every run, young and whole, by every back end, over draws of the odometry.

They go into a folder of their own in the results folder. Finished cases are not run again, and go
draw by draw: broken off, there is a whole table with fewer draws.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.config import LabelConfig, LcdConfig, MapConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.maps.cases import (
    WHOLE,
    YOUNG,
    Case,
    Poses,
    Task,
    case_key,
    choice_of,
    pose_graph_of,
    run_case,
)
from adversarial_lcd_ros.evaluation.maps.inputs import (
    LEAST_FRAMES,
    SOURCE,
    MapInputs,
    built_graphs,
    read_inputs,
    section_of,
)
from adversarial_lcd_ros.evaluation.maps.report import FOLDER
from adversarial_lcd_ros.evaluation.maps.summary import map_document
from adversarial_lcd_ros.evaluation.replay.records import CLEAN
from adversarial_lcd_ros.evaluation.results import (
    CONFIGURATION,
    SUMMARY,
    ResultsFolder,
    read_json,
)
from adversarial_lcd_ros.evaluation.store import CellStore, open_store
from adversarial_lcd_ros.evaluation.workers import Run
from adversarial_lcd_ros.files.writing import write_text
from adversarial_lcd_ros.sequences.sequence import Progress
from adversarial_lcd_ros.slam.closures import Pairs
from adversarial_lcd_ros.slam.essential import relative_pose
from adversarial_lcd_ros.slam.library import gtsam
from adversarial_lcd_ros.slam.pose_graph import write_g2o

# Sweeps: how much the odometry drifts, false closures added, and right ones left out.
DRIFTS = (3.0, 5.0)
ADDED = (0, 1, 3, 10, 30)
MISSING = (0.0, 0.5, 0.9, 1.0)


def make_maps(folder: Path, config: MapConfig, workers: Run, *, source: str | None = None,
              sweeps: bool = False, command_line: Sequence[str] = (),
              progress: Callable[[str], Progress] = lambda what: lambda done, total: None
              ) -> dict[str, Any]:
    """
    Make the maps of a results folder, or what is left of them; return their summary.

    Parameters
    ----------
    folder : Path
        Results of the kind "replay"; gets a folder "map".
    config : MapConfig
    workers : callable
        From ``local_workers``.
    source : str, optional
        The sequence, where the folder does not say.
    sweeps : bool
        Vary the drift, add false closures, and leave out right ones, too.
    command_line : sequence of str
        Kept with the results.
    progress : callable
        Called with what is being done; returns what is called with work done and in all.

    Raises
    ------
    ConfigError
        gtsam is missing, or nobody says which sequence it was.
    EvaluationError
        The sequence is another one, or has no poses in metres.

    """
    gtsam()  # told before the work
    replayed = read_json(folder / SUMMARY)
    inputs = read_inputs(folder, str(replayed['sequence']), source, labelled=sweeps,
                         progress=progress('labels'))
    cases = list(plan_cases(inputs, config, sweeps=sweeps))
    output = folder / FOLDER
    with open_store(output) as store:
        tasks = make_tasks(inputs, cases, config, folder, progress)
        _write_setup(output, folder, inputs, config, command_line)
        rows = _run(tasks, store, workers, progress('maps'))
        summary = map_document(inputs, config, rows)
        ResultsFolder(output).write_json(SUMMARY, summary)
    return summary


def plan_cases(inputs: MapInputs, config: MapConfig, *, sweeps: bool) -> Iterator[Case]:
    """Yield the maps to be made, draw by draw."""
    whole = len(inputs.frame)
    young = min(config.young_frames or inputs.first_loop or whole, whole)
    # Where the first loop comes at once, or never, there is one map.
    stages = ([(YOUNG, young)] if LEAST_FRAMES <= young < whole else []) + [(WHOLE, whole)]
    worst = max(inputs.runs, key=lambda run: int(inputs.runs[run].pairs.is_false.sum()))
    for draw in range(config.draws):
        for stage, frames in stages:
            for run, declared in inputs.runs.items():
                yield Case(run, stage, frames, 1.0, draw)
                if declared.stands is not None:
                    yield Case(run, stage, frames, 1.0, draw, checked=True)
            if not sweeps:
                continue
            for drift in DRIFTS:
                for run in dict.fromkeys((CLEAN, worst)):
                    yield Case(run, stage, frames, drift, draw)
            for drift in (1.0, *DRIFTS):
                for added in ADDED if drift == 1.0 else (ADDED[0], ADDED[-1]):
                    for consistent in (False, True)[:1 + (added > 1)]:
                        yield Case(CLEAN, stage, frames, drift, draw, added, consistent)
        if sweeps:
            for drift in (1.0, *DRIFTS):
                for missing in MISSING:
                    yield Case(CLEAN, WHOLE, whole, drift, draw, missing=missing)


def make_tasks(inputs: MapInputs, cases: Sequence[Case], config: MapConfig, folder: Path,
               progress: Callable[[str], Progress]) -> list[Task]:
    """Return the cases with what they are made of; raises EvaluationError."""
    pairs = [pairs_of(inputs, case, config) for case in cases]
    wanted = [_by_features(one, config) for one in pairs]
    for case, asked in zip(cases, wanted, strict=True):
        if asked and not inputs.runs[case.run].is_clean:
            raise EvaluationError(
                f'{case.run}: the attack changed features, which are not kept with the results: '
                'nobody knows what they claim; choose other claims than "essential"')
    poses = _measured(inputs, folder, sorted(set().union(*wanted)), config, progress)
    apart = max(1, round(config.rpe_s / inputs.period_s))
    tasks = []
    for case, declared, asked in zip(cases, pairs, wanted, strict=True):
        own = {pair: poses[pair] for pair in sorted(asked)}
        tasks.append(Task(case, case_key(case, inputs.truth, declared, own, config, apart),
                          inputs.truth, declared, own, config, apart))
    return tasks


def pairs_of(inputs: MapInputs, case: Case, config: MapConfig) -> Pairs:
    """Return the closures of a case, right and false, of the whole sequence."""
    declared = inputs.runs[case.run]
    pairs = declared.pairs
    if case.checked and declared.stands is not None:
        return pairs.chosen(declared.stands)
    if case.added is None and case.missing is None:
        return pairs
    right = pairs.chosen(~pairs.is_false)
    rng = choice_of(config, case.draw)
    if case.missing is not None:
        return right.chosen(rng.permutation(len(right)) >= round(case.missing * len(right)))
    elsewhere = np.zeros((0, 0), bool) if inputs.elsewhere is None else inputs.elsewhere
    false = _false_pairs(elsewhere[:case.frames], int(case.added or 0), rng,
                         consistent=case.consistent)
    return Pairs(np.r_[right.query, false[:, 0]], np.r_[right.match, false[:, 1]],
                 np.r_[right.is_false, np.ones(len(false), bool)])


def _false_pairs(elsewhere: NDArray[np.bool_], count: int, rng: np.random.Generator, *,
                 consistent: bool) -> NDArray[np.int64]:
    """Return pairs (query, match) of different places: scattered, or a stretch and its double."""
    table = np.argwhere(elsewhere)
    if not consistent or not len(table):
        chosen = rng.permutation(len(table))[:count]
        return table[np.sort(chosen)].astype(np.int64)
    best = table[:0]
    for start in table[rng.permutation(len(table))[:200]]:
        run = start + np.arange(count)[:, None]
        run = run[(run < elsewhere.shape).all(axis=1)]
        run = run[elsewhere[run[:, 0], run[:, 1]]]
        best = run if len(run) > len(best) else best
        if len(best) == count:
            break
    return best.astype(np.int64)


def _by_features(pairs: Pairs, config: MapConfig) -> set[tuple[int, int]]:
    """Return (match, query) of the closures whose features claim the pose."""
    asked = ((pairs.is_false & (config.false_claim == 'essential'))
             | (~pairs.is_false & (config.right_claim == 'essential')))
    return set(zip(pairs.match[asked].tolist(), pairs.query[asked].tolist(), strict=True))


def _measured(inputs: MapInputs, folder: Path, pairs: Sequence[tuple[int, int]],
              config: MapConfig, progress: Callable[[str], Progress]) -> Poses:
    # Attacks on edges leave features as they are: they claim what those of clean graphs do.
    if not pairs:
        return {}
    graphs = built_graphs(inputs, folder, progress('graphs'))
    poses, tell = {}, progress('relative poses')
    for done, (match, query) in enumerate(pairs, 1):
        poses[match, query] = relative_pose(
            graphs[match], graphs[query], inputs.focal_px, config.essential_threshold_px,
            config.scene_depth_m)
        tell(done, len(pairs))
    return poses


def _write_setup(output: Path, folder: Path, inputs: MapInputs, config: MapConfig,
                 command_line: Sequence[str]) -> None:
    configuration = read_json(folder / CONFIGURATION)
    ResultsFolder(output).write_setup(
        [config, section_of(configuration, LabelConfig), section_of(configuration, LcdConfig)],
        command_line, config.seed, {SOURCE: inputs.source})


def _run(tasks: Sequence[Task], store: CellStore, workers: Run,
         progress: Progress) -> list[dict[str, Any]]:
    left = [task for task in tasks if task.key not in store.rows]
    done = len(tasks) - len(left)
    progress(done, len(tasks))
    for key, row in workers(run_case, left):
        store.add(key, row)
        done += 1
        progress(done, len(tasks))
    return [store.rows[task.key] for task in tasks]


def export_g2o(folder: Path, output: Path, config: MapConfig, *, source: str | None = None,
               progress: Callable[[str], Progress] = lambda what: lambda done, total: None
               ) -> Iterator[Path]:
    """
    Write the pose graph of every run as g2o, by the first draw of the odometry; yield the paths.

    Beside them lies the truth, as TUM text, to measure what a solver makes of them.

    Parameters
    ----------
    folder, config, source, progress
        As for ``make_maps``.
    output : Path
        Folder, made if it is missing.

    """
    gtsam()
    replayed = read_json(folder / SUMMARY)
    inputs = read_inputs(folder, str(replayed['sequence']), source)
    cases = [Case(run, WHOLE, len(inputs.frame), 1.0, 0) for run in inputs.runs]
    output.mkdir(parents=True, exist_ok=True)
    for task in make_tasks(inputs, cases, config, folder, progress):
        path = output / f'{_file_name(task.case.run)}.g2o'
        write_g2o(path, pose_graph_of(task))
        yield path
    quaternion = Rotation.from_matrix(inputs.truth[:, :3, :3]).as_quat()
    rows = np.c_[inputs.stamp_ns / 1e9, inputs.truth[:, :3, 3], quaternion]
    write_text(output / 'truth.tum', ''.join(
        ' '.join(f'{value:.9f}' for value in row) + '\n' for row in rows.tolist()))
    yield output / 'truth.tum'


def _file_name(run: str) -> str:
    return '_'.join(re.findall(r'[A-Za-z0-9]+', run)) or 'run'
