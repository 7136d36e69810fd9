# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Maps of a replay: every run, young and whole, by every back end, over draws of the odometry.

They go into a folder of their own in the results folder. Finished cases are not run again, and go
draw by draw: broken off, there is a whole table with fewer draws.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
import re
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.config import LabelConfig, LcdConfig, MapConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.maps.beside import read_beside
from adversarial_lcd_ros.evaluation.maps.cases import (
    ESSENTIAL,
    WHOLE,
    Case,
    Poses,
    Task,
    case_key,
    pose_graph_of,
    run_case,
)
from adversarial_lcd_ros.evaluation.maps.claims import claim_errors
from adversarial_lcd_ros.evaluation.maps.inputs import (
    SOURCE,
    MapInputs,
    built_graphs,
    section_of,
)
from adversarial_lcd_ros.evaluation.maps.plan import pairs_of, plan_cases
from adversarial_lcd_ros.evaluation.maps.report import FOLDER
from adversarial_lcd_ros.evaluation.maps.summary import map_document
from adversarial_lcd_ros.evaluation.results import (
    CONFIGURATION,
    SUMMARY,
    ResultsFolder,
    read_json,
)
from adversarial_lcd_ros.evaluation.store import CellStore, Row, open_store
from adversarial_lcd_ros.evaluation.workers import Run
from adversarial_lcd_ros.files.writing import write_text
from adversarial_lcd_ros.sequences.sequence import Progress
from adversarial_lcd_ros.slam.closures import Pairs
from adversarial_lcd_ros.slam.essential import relative_pose
from adversarial_lcd_ros.slam.library import gtsam
from adversarial_lcd_ros.slam.pose_graph import write_g2o


def make_maps(folders: Sequence[Path], config: MapConfig, workers: Run, *,
              output: Path | None = None, source: str | None = None, sweeps: bool = False,
              claims: Sequence[str] = (), command_line: Sequence[str] = (),
              progress: Callable[[str], Progress] = lambda what: lambda done, total: None
              ) -> dict[str, Any]:
    """
    Make the maps of results folders, or what is left of them; return their summary.

    Parameters
    ----------
    folders : sequence of Path
        Results of the kind "replay": one, or several of one sequence that differ in settings of
        the detector.
    config : MapConfig
    workers : callable
        From ``local_workers``.
    output : Path, optional
        Folder of the maps; a folder "map" in the first one if none is named.
    source : str, optional
        The sequence, where the folders do not say.
    sweeps, claims
        As for ``plan_cases``.
    command_line : sequence of str
        Kept with the results.
    progress : callable
        Called with what is being done; returns what is called with work done and in all.

    Raises
    ------
    ConfigError
        gtsam is missing, or nobody says which sequence it was.
    EvaluationError
        As ``read_beside``; or the sequence is another one, or has no poses in metres.

    """
    gtsam()  # told before the work
    inputs = read_beside(folders, source, labelled=sweeps, progress=progress('labels'))
    cases = list(plan_cases(inputs, config, sweeps=sweeps, claims=claims))
    output = output or folders[0] / FOLDER
    with open_store(output) as store:
        tasks = make_tasks(inputs, cases, config, folders[0], progress)
        _write_setup(output, folders, inputs, config, command_line)
        rows = _run(tasks, store, workers, progress('maps'))
        summary = map_document(inputs, config, rows, _claim_errors(inputs, tasks))
        ResultsFolder(output).write_json(SUMMARY, summary)
    return summary


def _claim_errors(inputs: MapInputs, tasks: Sequence[Task]) -> list[Row]:
    """Return how far the features' poses are from the truth, where any were asked for."""
    measured = {pair: pose for task in tasks for pair, pose in task.measured.items()}
    asked = {(task.case.run, task.case.setting): inputs.runs[task.case.declared].pairs
             for task in tasks if task.config.right_claim == ESSENTIAL}
    return claim_errors(asked, inputs.truth, measured)


def make_tasks(inputs: MapInputs, cases: Sequence[Case], config: MapConfig, folder: Path,
               progress: Callable[[str], Progress]) -> list[Task]:
    """Return the cases with what they are made of; raises EvaluationError."""
    pairs = [pairs_of(inputs, case, config) for case in cases]
    settings = [case.settings(config) for case in cases]
    wanted = [_by_features(one, own) for one, own in zip(pairs, settings, strict=True)]
    for case, asked in zip(cases, wanted, strict=True):
        if asked and not inputs.runs[case.declared].is_clean:
            raise EvaluationError(
                f'{case.declared}: the attack changed features, which are not kept with the '
                'results: nobody knows what they claim; choose other claims than "essential"')
    poses = _measured(inputs, folder, sorted(set().union(*wanted)), config, progress)
    apart = max(1, round(config.rpe_s / inputs.period_s))
    tasks = []
    for case, declared, own, asked in zip(cases, pairs, settings, wanted, strict=True):
        claimed = {pair: poses[pair] for pair in sorted(asked)}
        tasks.append(Task(case, case_key(case, inputs.truth, declared, claimed, own, apart),
                          inputs.truth, declared, claimed, own, apart))
    return tasks


def _by_features(pairs: Pairs, config: MapConfig) -> set[tuple[int, int]]:
    """Return (match, query) of the closures whose features claim the pose."""
    asked = ((pairs.is_false & (config.false_claim == ESSENTIAL))
             | (~pairs.is_false & (config.right_claim == ESSENTIAL)))
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


def _write_setup(output: Path, folders: Sequence[Path], inputs: MapInputs, config: MapConfig,
                 command_line: Sequence[str]) -> None:
    configurations = [read_json(folder / CONFIGURATION) for folder in folders]
    ResultsFolder(output).write_setup(
        [config, section_of(configurations[0], LabelConfig),
         *(section_of(configuration, LcdConfig) for configuration in configurations)],
        command_line, config.seed,
        {SOURCE: inputs.source, 'replays': [str(folder.resolve()) for folder in folders]})


def _run(tasks: Sequence[Task], store: CellStore, workers: Run, progress: Progress) -> list[Row]:
    """Return the cases with their figures; those that are made of the same are made once."""
    wanted = {task.key: task for task in tasks}
    left = [task for key, task in wanted.items() if key not in store.rows]
    done = len(wanted) - len(left)
    progress(done, len(wanted))
    for key, row in workers(run_case, left):
        store.add(key, row)
        done += 1
        progress(done, len(wanted))
    return [{**asdict(task.case), **store.rows[task.key]} for task in tasks]


def export_g2o(folders: Sequence[Path], output: Path, config: MapConfig, *,
               source: str | None = None,
               progress: Callable[[str], Progress] = lambda what: lambda done, total: None
               ) -> Iterator[Path]:
    """
    Write the pose graph of every run as g2o, by the first draw of the odometry; yield the paths.

    Beside them lies the truth, as TUM text, to measure what a solver makes of them.

    Parameters
    ----------
    folders, config, source, progress
        As for ``make_maps``.
    output : Path
        Folder, made if it is missing.

    """
    gtsam()
    inputs = read_beside(folders, source)
    cases = [Case(each.run, WHOLE, len(inputs.frame), 1.0, 0, setting=each.setting)
             for each in inputs.runs.values()]
    output.mkdir(parents=True, exist_ok=True)
    for task in make_tasks(inputs, cases, config, folders[0], progress):
        path = output / f'{_file_name(task.case.declared)}.g2o'
        write_g2o(path, pose_graph_of(task))
        yield path
    quaternion = Rotation.from_matrix(inputs.truth[:, :3, :3]).as_quat()
    rows = np.c_[inputs.stamp_ns / 1e9, inputs.truth[:, :3, 3], quaternion]
    write_text(output / 'truth.tum', ''.join(
        ' '.join(f'{value:.9f}' for value in row) + '\n' for row in rows.tolist()))
    yield output / 'truth.tum'


def _file_name(run: str) -> str:
    return '_'.join(re.findall(r'[A-Za-z0-9]+', run)) or 'run'
