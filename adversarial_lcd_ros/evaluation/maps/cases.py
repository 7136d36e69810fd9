# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A line of cells.jsonl: one draw of the odometry, the closures of one run, all back ends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import BACK_ENDS, MapConfig
from adversarial_lcd_ros.environment import code_digest
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.files.digests import digest_of_parts
from adversarial_lcd_ros.slam.accuracy import absolute_error_m, aligned, relative_error
from adversarial_lcd_ros.slam.back_ends import Solution, solve
from adversarial_lcd_ros.slam.closures import Pairs, claim
from adversarial_lcd_ros.slam.motions import Motions
from adversarial_lcd_ros.slam.odometry import drifting
from adversarial_lcd_ros.slam.pose_graph import PoseGraph

ODOMETRY = 'odometry'  # in the place of a back end: no closures
YOUNG, WHOLE = 'young', 'whole'
# Random numbers of a draw: of its odometry, its closures, and of what is added or left out.
_STEPS, _CLAIMS, CHOICE = range(3)
_CODE = ('slam', 'poses', 'evaluation/maps/cases')
_SHOWN_DIGITS = 3  # millimetres
# What closures claim beside what the settings say, by name: pose of the features for all, or
# false ones that agree with one another.
ESSENTIAL, CONSISTENT = 'essential', 'consistent'
CLAIMS: Mapping[str, Mapping[str, Any]] = {
    '': {}, ESSENTIAL: {'right_claim': ESSENTIAL, 'false_claim': ESSENTIAL},
    CONSISTENT: {'false_claim': CONSISTENT}}

Poses = Mapping[tuple[int, int], NDArray[np.float64] | None]


@dataclass(frozen=True)
class Case:
    """
    One map to be made, by every back end.

    Attributes
    ----------
    run : str
        Whose closures.
    stage : str
        young or whole.
    frames : int
        That the map has.
    drift : float
        Multiplies the errors of the odometry.
    draw : int
        Of the odometry.
    added : int or None
        Right closures of the run and so many false ones drawn for it; None: as declared.
    consistent : bool
        Those that are added agree with one another.
    missing : float or None
        Right closures of the run, but for this share of them; None: as declared.
    checked : bool
        Those alone that a geometric check behind the detector bears out.
    setting : str
        Of the detector, where replays with several are side by side: what is another.
    claims : str
        One of ``CLAIMS``; empty: as the settings say.

    """

    run: str
    stage: str
    frames: int
    drift: float
    draw: int
    added: int | None = None
    consistent: bool = False
    missing: float | None = None
    checked: bool = False
    setting: str = ''
    claims: str = ''

    @property
    def declared(self) -> str:
        """Return the title of the run whose closures these are."""
        return title_of(self.run, self.setting)

    def settings(self, config: MapConfig) -> MapConfig:
        """Return the settings by which this map is made."""
        settings = CLAIMS[CONSISTENT] if self.consistent else CLAIMS[self.claims]
        return replace(config, **settings)


def title_of(run: str, setting: str) -> str:
    """Return a run in words, and which detector it was."""
    return f'{run}, {setting}' if setting else run


GROUP = tuple(entry.name for entry in fields(Case) if entry.name != 'draw')


@dataclass(frozen=True, eq=False)
class Task:
    """
    A case and what it is made of.

    Attributes
    ----------
    case : Case
    key : str
    truth : float64, (n, 4, 4)
        Of the whole sequence.
    pairs : Pairs
        Closures of the case, of the whole sequence.
    measured : mapping
        (match, query) to the pose that their features claim, where any is asked for.
    config : MapConfig
        With the claims of the case.
    apart : int
        Frames between the two of a relative pose error.

    """

    case: Case
    key: str
    truth: Motions
    pairs: Pairs
    measured: Poses
    config: MapConfig
    apart: int


def case_key(case: Case, truth: Motions, pairs: Pairs, measured: Poses, config: MapConfig,
             apart: int) -> str:
    """
    Return the digest of all that a case's figures depend on, hexadecimal.

    Whose closures they are is not among it: runs that declared the same share their maps.
    """
    settings = {**asdict(config), 'draws': None, 'young_frames': None, 'apart': apart,
                'case': [case.frames, case.drift, case.draw, is_shown(case)],
                'code': code_digest(*_CODE)}
    poses = [(match, query, None if pose is None else pose.tolist())
             for (match, query), pose in sorted(measured.items())]
    return digest_of_parts([
        json.dumps(settings, sort_keys=True).encode(), truth.tobytes(), pairs.query.tobytes(),
        pairs.match.tobytes(), pairs.is_false.tobytes(), json.dumps(poses).encode()])


def pose_graph_of(task: Task) -> PoseGraph:
    """Return the pose graph of a case."""
    case, config, truth = task.case, task.config, task.truth
    odometry = drifting(truth, config, case.drift, _random(config, case, _STEPS))
    closures = claim(task.pairs, truth, config, _random(config, case, _CLAIMS),
                     lambda match, query: task.measured[match, query])
    return PoseGraph(truth[0], odometry, closures).first(case.frames)


def _random(config: MapConfig, case: Case, purpose: int) -> np.random.Generator:
    # By draw alone: all runs, stages and drifts of a draw share it, and compare in pairs.
    return np.random.default_rng([config.seed, case.draw, purpose])


def choice_of(config: MapConfig, draw: int) -> np.random.Generator:
    """Return the random numbers by which a draw adds closures, or leaves some out."""
    return np.random.default_rng([config.seed, draw, CHOICE])


def run_case(task: Task) -> tuple[str, Row]:
    """Return the key of a case, and its row: figures by back end, for draw 0 with the paths."""
    case, graph = task.case, pose_graph_of(task)
    truth = task.truth[:case.frames]
    found: dict[str, Any] = {
        ODOMETRY: _figures(graph.dead_reckoning, truth, task.apart, None, graph.closures.pairs)}
    for back_end in BACK_ENDS:
        solution = solve(graph, back_end, task.config)
        found[back_end] = _figures(solution.poses, truth, task.apart, solution,
                                   graph.closures.pairs)
    pairs = graph.closures.pairs
    row: Row = {'frames': case.frames, 'right': int((~pairs.is_false).sum()),
                'false': int(pairs.is_false.sum()),
                'unposed': int((task.pairs.query < case.frames).sum()) - len(pairs),
                'back_ends': found}
    if is_shown(case):
        row['closures'] = [[int(query), int(match), bool(is_false)] for query, match, is_false
                           in zip(pairs.query, pairs.match, pairs.is_false, strict=True)]
        row['truth'] = _path(truth, truth)
    else:
        for figures in found.values():
            del figures['path'], figures['kept']
    return task.key, row


def is_shown(case: Case) -> bool:
    """Tell whether the paths of a case are kept for pictures."""
    return (case.draw == 0 and case.drift == 1.0 and case.added is None
            and case.missing is None and not case.claims)


def _figures(poses: Motions, truth: Motions, apart: int, solution: Solution | None,
             pairs: Pairs) -> dict[str, Any]:
    relative = relative_error(poses, truth, apart)
    kept = np.zeros(len(pairs), bool) if solution is None else solution.kept
    return {'ate_m': absolute_error_m(poses, truth),
            'rpe_m': None if relative is None else relative.translation_m,
            'rpe_deg': None if relative is None else relative.rotation_deg,
            'right_kept': int((kept & ~pairs.is_false).sum()),
            'false_kept': int((kept & pairs.is_false).sum()),
            'duration_s': 0.0 if solution is None else solution.duration_s,
            'path': _path(poses, truth), 'kept': [int(value) for value in kept]}


def _path(poses: Motions, truth: Motions) -> list[list[float]]:
    rows: list[list[float]] = np.round(aligned(poses, truth)[:, :3, 3], _SHOWN_DIGITS).tolist()
    return rows
