# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a map is made of: the true path, and the closures that every run of a replay declared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import BuilderConfig, ConfigT, LabelConfig
from adversarial_lcd_ros.errors import ConfigError, EvaluationError
from adversarial_lcd_ros.evaluation.replay.recipe import POSTERS
from adversarial_lcd_ros.evaluation.replay.records import (
    CLEAN,
    NO_TRUTH,
    QueryRecord,
    column,
    read_records,
    runs_of,
)
from adversarial_lcd_ros.evaluation.results import CONFIGURATION, RECORDS, read_json
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.graph_sequences.opening import holds_graphs, open_graphs
from adversarial_lcd_ros.ground_truth.labelling import Views, label_views
from adversarial_lcd_ros.ground_truth.labels import (
    ELSEWHERE,
    POSITIVE,
    RIGHT,
    FrameLabels,
    located_poses,
)
from adversarial_lcd_ros.registry import NONE
from adversarial_lcd_ros.sequences import PLACE_INDEX, Trajectory, open_sequence
from adversarial_lcd_ros.sequences.sequence import Progress
from adversarial_lcd_ros.slam.closures import Pairs
from adversarial_lcd_ros.slam.motions import Motions, of_trajectory

SOURCE = 'source'  # where configuration.json says which sequence was replayed
LEAST_FRAMES = 3


@dataclass(frozen=True)
class Declared:
    """
    The closures of a run.

    Attributes
    ----------
    pairs : Pairs
        Right ones, and those that certainly show another place.
    stands : bool, (k,), or None
        Which of them a geometric check behind the detector bears out; None: nobody asked it.
    untold : int
        Of neither kind: no edges of the map.
    unlocated : int
        With a frame that has no ground truth pose.
    is_clean : bool
        The features that the detector got are those of the camera.
    run : str
        Its name in the replay.
    setting : str
        Of the detector, where replays with several are side by side: what is another.

    """

    pairs: Pairs
    stands: NDArray[np.bool_] | None
    untold: int
    unlocated: int
    is_clean: bool
    run: str = CLEAN
    setting: str = ''


@dataclass(frozen=True, eq=False)
class MapInputs:
    """
    A replayed sequence, for maps.

    Attributes
    ----------
    name : str
        Of the sequence.
    source : str
        What it was opened from.
    frame : int64, (n,)
        Frames with a ground truth pose, as the records count them; all else counts these.
    stamp_ns : int64, (n,)
    truth : float64, (n, 4, 4)
        Camera to world.
    runs : mapping of str to Declared
        By title (``title_of``), a clean run first.
    elsewhere : bool, (n, n), or None
        Pairs that certainly show different places, the older frame old enough to be a match.
    first_loop : int or None
        The first frame that by ground truth has a loop; None without one.
    focal_px : float

    """

    name: str
    source: str
    frame: NDArray[np.int64]
    stamp_ns: NDArray[np.int64]
    truth: Motions
    runs: Mapping[str, Declared]
    elsewhere: NDArray[np.bool_] | None
    first_loop: int | None
    focal_px: float

    @property
    def period_s(self) -> float:
        """Median time from frame to frame, seconds."""
        return float(np.median(np.diff(self.stamp_ns))) / 1e9


def read_inputs(folder: Path, name: str, source: str | None = None, *, labelled: bool = False,
                progress: Progress | None = None) -> MapInputs:
    """
    Return what the maps of a results folder are made of.

    Parameters
    ----------
    folder : Path
        Results of a replay, of the kind "replay".
    name : str
        Of the sequence.
    source : str, optional
        The sequence, where it is not where the folder says, or the folder does not say.
    labelled : bool
        Look for pairs that certainly show different places.
    progress : callable, optional
        Called with frames labelled and in all.

    Raises
    ------
    ConfigError
        Nobody says which sequence it was.
    EvaluationError
        The sequence is another one, or has no poses in metres.

    """
    configuration = read_json(folder / CONFIGURATION)
    source = source or configuration.get(SOURCE)
    if not source:
        raise ConfigError(f'{folder / CONFIGURATION} does not say which sequence was replayed: '
                          'name it with --sequence')
    records = runs_of(read_records(folder / RECORDS))
    clean = records[CLEAN]
    config = section_of(configuration, LabelConfig)
    views, focal_px = _views(Path(source), column(clean, 'stamp_ns'), config)
    poses, located = located_poses(views.trajectory, views.stamp_ns, config)
    _check_same([record.kind != NO_TRUTH for record in clean], located.tolist(), source)
    frame = np.flatnonzero(located)
    if len(frame) < LEAST_FRAMES:
        raise EvaluationError(f'{source}: {len(frame)} frames with a ground truth pose: expected '
                              f'{LEAST_FRAMES} or more for a map')
    loops = np.flatnonzero(column(clean, 'label')[frame] == POSITIVE)
    labels = label_views(views, config, progress).labels if labelled else None
    if labels is not None:
        _check_same([record.kind for record in clean], labels.names, source)
    return MapInputs(
        name, source, frame, views.stamp_ns[frame], of_trajectory(poses)[frame],
        {run: _declared(rows, frame, _has_poster(configuration, run))
         for run, rows in records.items()},
        None if labels is None else _elsewhere(labels, frame),
        int(loops[0]) if len(loops) else None, focal_px)


def _has_poster(configuration: Mapping[str, Any], run: str) -> bool:
    """Tell whether a poster hung in a run: in all of a replay, or in this one."""
    return run in configuration.get(POSTERS, {}) or any(
        section['values'].get('poster', NONE) != NONE
        for section in configuration.get('settings', ()))


def _elsewhere(labels: FrameLabels, frame: NDArray[np.int64]) -> NDArray[np.bool_]:
    old = np.arange(len(labels.candidates))[None, :] < labels.candidates[:, None]
    pairs: NDArray[np.bool_] = (labels.elsewhere & old)[np.ix_(frame, frame)]
    return pairs


def section_of(configuration: Mapping[str, Any], kind: type[ConfigT]) -> ConfigT:
    """Return settings of a results folder, its first ones of a class; defaults without any."""
    for section in configuration.get('settings', ()):
        if section['section'] == kind.title:
            return kind.from_mapping(section['values'])
    return kind()


def has_metres(source: Path) -> None:
    """Raise EvaluationError if a sequence has no poses of which maps could be made."""
    opened = open_graphs(str(source)) if holds_graphs(source) else open_sequence(source)
    _in_metres(opened.trajectory, source)


def _in_metres(trajectory: Trajectory | None, source: Path) -> Trajectory:
    if trajectory is None or trajectory.frame_id == PLACE_INDEX:
        raise EvaluationError(f'{source} has no poses in metres: without them nobody knows how '
                              'far a map is off')
    return trajectory


def _views(source: Path, stamps: NDArray[np.int64],
           labels: LabelConfig) -> tuple[Views, float]:
    """Return the frames to label, and their focal length, pixels; no graph is built."""
    if holds_graphs(source):
        recorded = open_graphs(str(source))
        trajectory, size, focal = recorded.trajectory, recorded.image_size, None
        graphs = chosen_graphs(recorded.graphs, stamps, str(source))
    else:
        sequence = open_sequence(source)
        trajectory, size, focal = (sequence.trajectory, sequence.image_size,
                                   sequence.focal_length_px)
        graphs = []
        missing = np.setdiff1d(stamps, sequence.stamps_ns)
        if len(missing):
            _refuse(source, missing.tolist())
    return (Views(stamps, size, _in_metres(trajectory, source), source, graphs),
            focal or labels.focal_length * size[0])


def chosen_graphs(graphs: Sequence[MultiTierGraph], stamps: NDArray[np.int64],
                  source: str) -> list[MultiTierGraph]:
    """
    Return the graphs with these stamps.

    Raises
    ------
    EvaluationError
        One is missing.

    """
    by_stamp = {graph.stamp_ns: graph for graph in graphs}
    missing = [int(stamp) for stamp in stamps if int(stamp) not in by_stamp]
    if missing:
        _refuse(source, missing)
    return [by_stamp[int(stamp)] for stamp in stamps]


def _refuse(source: Path | str, missing: Sequence[Any]) -> NoReturn:
    raise EvaluationError(f'{source} has no frame at {missing[0]} ns, and {len(missing)} such in '
                          'all: expected the sequence that was replayed')


def built_graphs(inputs: MapInputs, folder: Path,
                 progress: Progress | None = None) -> list[MultiTierGraph]:
    """Return the clean graphs of the map's frames: read, from the cache, or built."""
    builder = section_of(read_json(folder / CONFIGURATION), BuilderConfig)
    return chosen_graphs(open_graphs(inputs.source, builder, progress=progress).graphs,
                         inputs.stamp_ns, inputs.source)


def _check_same(then: Sequence[Any], now: Sequence[Any], source: str) -> None:
    """See that the ground truth says of the frames what it said when they were evaluated."""
    differing = sum(one != other for one, other in zip(then, now, strict=True))
    if differing:
        raise EvaluationError(f'{source}: the ground truth says otherwise of {differing} frames '
                              'than when they were evaluated: expected the sequence that was '
                              'replayed, and the same release')


def _declared(rows: Sequence[QueryRecord], frame: NDArray[np.int64],
              has_poster: bool) -> Declared:
    place = np.full(len(rows), -1)
    place[frame] = np.arange(len(frame))
    edges, untold, unlocated, support = [], 0, 0, []
    for record in rows:
        if not record.is_loop or record.match_frame is None:
            continue
        query, match = int(place[record.frame]), int(place[record.match_frame])
        if query < 0 or match < 0:
            unlocated += 1
        elif record.match_is in (RIGHT, ELSEWHERE):
            edges.append((query, match, record.match_is == ELSEWHERE))
            support.append(record.support)
        else:
            untold += 1
    table = np.array(edges, np.int64).reshape(-1, 3)
    return Declared(
        Pairs(table[:, 0], table[:, 1], table[:, 2].astype(bool)),
        None if not support or None in support else np.array(support, np.float64) >= 1,
        untold, unlocated, not has_poster and not any(record.nodes_moved for record in rows),
        rows[0].run)
