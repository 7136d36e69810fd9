# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Experiments: the cells of a recipe on several sequences with many seeds, side by side, resumable.

A task is some cells of one sequence and seed, walked together (``attacked``). Tasks know nothing
of each other; finished rows go to cells.jsonl at once, and what is there is not run again.

Tasks take about 15 s each and go seed by seed: broken off, an experiment is a whole table with
fewer seeds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
import hashlib
import json

from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from adversarial_lcd_ros.attack.oracle import edit_budget
from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.environment import environment
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.frames.attacked import attack_frames
from adversarial_lcd_ros.evaluation.frames.cells import Cell, cell_key
from adversarial_lcd_ros.evaluation.frames.rows import ROW_COLUMNS, are_frames, make_row
from adversarial_lcd_ros.evaluation.frames.samples import SAMPLES, FrameSample
from adversarial_lcd_ros.evaluation.methods import method_of
from adversarial_lcd_ros.evaluation.store import CellStore, Row
from adversarial_lcd_ros.evaluation.streams import GraphSource, Stream, load_stream_graphs
from adversarial_lcd_ros.evaluation.workers import Run
from adversarial_lcd_ros.lcd.targets import decision_path
from adversarial_lcd_ros.registry import SEARCHES, TARGETS, YARDSTICKS
from adversarial_lcd_ros.training.model_folder import trained_on

FIRST_SEED = 42
# A task returns all its rows at its end: short enough to lose, long enough to share a walk.
_TASK_S = 15.0
# Seconds on one core (docs/results_folder.md), of a frame and of a walk; classes say the rest.
# They only tell how long an experiment may take.
_FRAME_S, _WALK_S, _NODES = 0.03, 0.5, 300


@dataclass(frozen=True, eq=False)
class Task:
    """
    Cells of one stream and seed, to be walked together.

    Attributes
    ----------
    sequence : str
        Name.
    graphs : GraphSource
    sample : FrameSample
    cells : tuple of Cell
    keys : tuple of str
        Of the cells.
    lcd : LcdConfig
    seed : int
    cost_s : float
        Expected time on one core.

    """

    sequence: str
    graphs: GraphSource
    sample: FrameSample
    cells: tuple[Cell, ...]
    keys: tuple[str, ...]
    lcd: LcdConfig
    seed: int
    cost_s: float


@dataclass(frozen=True, eq=False)
class Experiment:
    """
    What there is to do, and what is done already.

    Attributes
    ----------
    keys : tuple of str
        Of all cells, in the order of the recipe.
    tasks : tuple of Task
        With the cells that are not finished.
    finished : int
        Cells that are.

    """

    keys: tuple[str, ...]
    tasks: tuple[Task, ...] = field(repr=False)
    finished: int

    @property
    def cost_s(self) -> float:
        """Expected time of all tasks on one core."""
        return sum(task.cost_s for task in self.tasks)


def plan_experiment(streams: Sequence[Stream], cells: Sequence[Cell], lcd: LcdConfig,
                    finished: Sequence[str] = (), first_seed: int = FIRST_SEED) -> Experiment:
    """
    Cut an experiment into tasks.

    Seed by seed, so that an experiment that is broken off has all sequences and attacks with fewer
    seeds.

    Parameters
    ----------
    streams : sequence of Stream
        From ``open_streams``.
    cells : sequence of Cell
        From a recipe.
    lcd : LcdConfig
        Of the detectors, but for what the cells say.
    finished : sequence of str
        Keys of the cells that are not to be run.
    first_seed : int
        Seeds are this one and those after it.

    """
    keys: list[str] = []
    tasks: list[Task] = []
    done = set(finished)
    for seed in range(first_seed, first_seed + max(cell.seeds for cell in cells)):
        for stream in sorted(streams, key=lambda stream: stream.nodes):
            here = [cell for cell in cells
                    if (cell.nodes, cell.variant_needed) == (stream.nodes, stream.variant)
                    and seed < first_seed + cell.seeds]
            named = [(cell_key(cell, seed, stream.pairs_digest if cell.judged == 'pairs'
                               else stream.digest, lcd), cell) for cell in here]
            keys += [key for key, _ in named]
            tasks += _tasks(stream, [entry for entry in named if entry[0] not in done], lcd, seed)
    return Experiment(tuple(keys), tuple(tasks), sum(key in done for key in keys))


def _tasks(stream: Stream, named: Sequence[tuple[str, Cell]], lcd: LcdConfig,
           seed: int) -> Iterator[Task]:
    for judged, per_kind in dict.fromkeys((cell.judged, cell.frames) for _, cell in named):
        sample = SAMPLES[judged](stream.labels, per_kind, seed)
        part: list[tuple[str, Cell]] = []
        cost_s = _WALK_S
        for entry in (entry for entry in named
                      if (entry[1].judged, entry[1].frames) == (judged, per_kind)):
            extra_s = len(sample.frame) * _expected_s(entry[1], stream.nodes_mean)
            if part and cost_s + extra_s > _TASK_S:
                yield _task(stream, sample, part, lcd, seed, cost_s)
                part, cost_s = [], _WALK_S
            part.append(entry)
            cost_s += extra_s
        if part:
            yield _task(stream, sample, part, lcd, seed, cost_s)


def _task(stream: Stream, sample: FrameSample, named: Sequence[tuple[str, Cell]], lcd: LcdConfig,
          seed: int, cost_s: float) -> Task:
    keys, cells = zip(*named, strict=True)
    return Task(stream.name, stream.graphs, sample, cells, keys, lcd, seed, cost_s)


def _expected_s(cell: Cell, nodes: float) -> float:
    """Return about how long a frame takes on one core, if the attack spends its budget."""
    edits = edit_budget(round(nodes), cell.attack.ratio)
    if cell.search in YARDSTICKS:
        flip_s: float = TARGETS[cell.target].flip_s
        return _FRAME_S + edits * nodes * nodes / 2 * flip_s
    queries = min(edits * cell.attack.queries_per_edit, cell.attack.max_queries)
    asked = float(queries) if cell.attack.mode == 'query' else 0.0
    share: float = SEARCHES[cell.search].query_share
    query_s: float = TARGETS[cell.asked_target].query_s
    return _FRAME_S + asked * share * query_s * nodes / _NODES


def run_experiment(experiment: Experiment, store: CellStore, run: Run,
                   progress: Callable[[float, float], None]) -> list[Row]:
    """
    Run the tasks of an experiment; return the rows of all cells, those of earlier runs, too.

    Parameters
    ----------
    experiment : Experiment
    store : CellStore
        Gets each row as it comes.
    run : callable
        From ``local_workers`` or ``dask_workers``.
    progress : callable
        Called with cells finished and the share of the expected time that is done.

    Raises
    ------
    EvaluationError
        A worker was lost, an attack overspent its budget, or the rows cannot be written.

    """
    _check_rows(experiment, store)
    done_s, finished = 0.0, experiment.finished
    whole_s = experiment.cost_s or 1.0
    for rows, cost_s in run(run_task, experiment.tasks):
        for key, row in rows:
            store.add(key, row)
        done_s, finished = done_s + cost_s, finished + len(rows)
        progress(finished, done_s / whole_s)
    return [store.rows[key] for key in experiment.keys]


def _check_rows(experiment: Experiment, store: CellStore) -> None:
    store.check(experiment.keys, ROW_COLUMNS)
    for key in experiment.keys:
        if key in store.rows and not are_frames(store.rows[key]['frame_results']):
            raise EvaluationError(f'{store.path}, cell {key}: frame_results are not of frames: '
                                  'delete the line, and its cell runs again')


def run_task(task: Task) -> tuple[list[tuple[str, Row]], float]:
    """Return key and row of the cells of a task, and the task's expected time."""
    # Workers share the cores; a library that takes them all for itself slows down the others.
    with threadpool_limits(1):
        graphs = load_stream_graphs(task.graphs)
        found = attack_frames(graphs, task.sample, task.cells, task.lcd, task.seed)
    rows = [(key, {**make_row(cell, task.seed, task.sequence, results),
                   'trained_on': trained_on(decision_path(task.lcd.model, cell.target),
                                            task.graphs.source),
                   'told_by': task.sample.told_by, 'versions': versions_digest()})
            for key, cell, results in zip(task.keys, task.cells, found, strict=True)]
    return rows, task.cost_s


@lru_cache(1)
def versions_digest() -> str:
    """Return a short digest of the releases of Python and of the libraries here."""
    here = environment()
    text = json.dumps([here['python'], here['versions']], sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=4).hexdigest()


def kinds_of_cells(rows: Sequence[Row]) -> list[tuple[str, int, list[float]]]:
    """
    Return where the time went: what, frames, and seconds a frame for queries, search, judging.

    One entry for each search, or perturbation and surrogate, by mode, target asked and size of
    graph, the most expensive first; frames that cannot be attacked do not count.

    """
    frames: Counter[str] = Counter()
    spent: dict[str, Counter[str]] = {name: Counter() for name in ('query_s', 'search_s',
                                                                   'judge_s')}
    for row in (row for row in rows if row['frames'] > row['unattackable']):
        kind = ', '.join(filter(None, (method_of(row), row['surrogate'], row['mode'],
                                       row['asked_target'], f'{row["nodes"]} features')))
        frames[kind] += row['frames'] - row['unattackable']
        for name, seconds in spent.items():
            seconds[kind] += row[name]
    order = sorted(frames, key=lambda kind: -sum(seconds[kind] for seconds in spent.values()))
    return [(kind, frames[kind], [seconds[kind] / frames[kind] for seconds in spent.values()])
            for kind in order]
