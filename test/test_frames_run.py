# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Experiments: resumed, side by side, and on a cluster that loses a worker."""

from dataclasses import replace
from functools import partial
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import threading
import time

import pytest
from walk_factory import LABELS, NODES, RECIPE, builder_config, lcd_config, walk_folder

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.frames import run as run_module
from adversarial_lcd_ros.evaluation.frames.recipe import load_cells
from adversarial_lcd_ros.evaluation.frames.run import (
    kinds_of_cells,
    plan_experiment,
    run_experiment,
    run_task,
)
from adversarial_lcd_ros.evaluation.paper.summaries import summarise_cells
from adversarial_lcd_ros.evaluation.store import open_store
from adversarial_lcd_ros.evaluation.streams import load_stream_graphs, open_streams
from adversarial_lcd_ros.evaluation.workers import dask_workers, local_workers
from adversarial_lcd_ros.graph_sequences.bags import build_graph_bag

TIMES = ('query_s', 'search_s', 'judge_s', 'duration_s')


def nothing(*_):
    """Take progress and do nothing with it."""


@pytest.fixture
def streams(tmp_path, vocabulary):
    return open_streams([str(walk_folder(tmp_path / 'walk'))], [NODES],
                        builder_config(vocabulary), LABELS, tmp_path / 'cache', nothing)


@pytest.fixture
def cells(tmp_path):
    path = tmp_path / 'recipe.yaml'
    path.write_text(RECIPE)
    return load_cells(str(path), {})


@pytest.fixture
def lcd(lcd_model):
    return lcd_config(lcd_model)


def test_cells_meet_graphs_that_their_targets_can_judge(tmp_path, vocabulary, cells, lcd):
    cells = [replace(cells[0], target=target, asked_target=target, seeds=1)
             for target in ('wl', 'symbio')]
    walk = str(walk_folder(tmp_path / 'walk'))
    streams = [stream for variant in ('', 'anchors') for stream in open_streams(
        [walk], [NODES], builder_config(vocabulary), LABELS, tmp_path / 'cache', nothing,
        variant=variant)]
    tasks = plan_experiment(streams, cells, replace(lcd, model='')).tasks
    assert [(task.graphs.builder.graph_variant, [cell.target for cell in task.cells])
            for task in tasks] == [('tiers', ['wl']), ('anchors', ['symbio'])]
    assert [graph.has_scene for task in tasks
            for graph in load_stream_graphs(task.graphs)[:1]] == [False, True]


def test_graphs_without_a_scene_are_refused_before_the_work(tmp_path, vocabulary):
    config = builder_config(vocabulary)
    built = build_graph_bag(str(walk_folder(tmp_path / 'walk')), tmp_path / 'graphs', config)
    with pytest.raises(EvaluationError, match='without a node for the scene'):
        open_streams([str(built.path)], [NODES], config, LABELS, tmp_path / 'cache', nothing,
                     variant='anchors')


def untimed(rows):
    return [{name: value for name, value in row.items() if name not in TIMES} for row in rows]


def run_cells(folder, streams, cells, lcd, run=map, progress=nothing):
    with open_store(folder) as store:
        experiment = plan_experiment(streams, cells, lcd, list(store.rows))
        return run_experiment(experiment, store, run, progress)


def test_an_experiment_gives_a_row_for_every_cell_and_seed(tmp_path, streams, cells, lcd):
    shares = []
    rows = run_cells(tmp_path / 'out', streams, cells, lcd,
                     progress=lambda *now: shares.append(now))
    assert len(rows) == 2 * len(cells) == 10
    assert shares[-1] == (10, pytest.approx(1.0))
    assert {row['frames'] for row in rows} == {4}
    assert {row['seed'] for row in rows} == {42, 43}
    assert len({frame['stamp'] for row in rows for frame in row['frame_results']}) > 4
    assert len(summarise_cells(rows)) == len(cells)
    assert sum(frames for _, frames, _ in kinds_of_cells(rows)) == 40
    assert rows[0]['balanced_clean'] is not None


def test_a_broken_experiment_goes_on_where_it_was(tmp_path, streams, cells, lcd, monkeypatch):
    whole = run_cells(tmp_path / 'whole', streams, cells, lcd)
    monkeypatch.setattr(run_module, '_TASK_S', 0.0)

    def broken(function, tasks):
        for task in tasks[:4]:
            yield function(task)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_cells(tmp_path / 'out', streams, cells, lcd, broken)
    kept = (tmp_path / 'out' / 'cells.jsonl').read_bytes()
    assert kept.count(b'\n') == 4

    ran = []
    rows = run_cells(tmp_path / 'out', streams, cells, lcd, lambda function, tasks: (
        ran.append(len(task.cells)) or function(task) for task in tasks))
    assert sum(ran) == 6
    assert (tmp_path / 'out' / 'cells.jsonl').read_bytes().startswith(kept)
    assert untimed(rows) == untimed(whole)
    assert run_cells(tmp_path / 'out', streams, cells, lcd, lambda function, tasks: iter(
        [1 / len(tasks)] if tasks else [])) == rows


def test_graphs_that_have_changed_are_refused(tmp_path, streams, cells, lcd):
    source = streams[0].graphs
    with pytest.raises(EvaluationError, match='other graphs'):
        load_stream_graphs(type(source)(source.source, source.builder, source.cache, 'another'))


def test_processes_side_by_side_give_the_same(tmp_path, streams, cells, lcd):
    expected = run_cells(tmp_path / 'one', streams, cells, lcd)
    with local_workers(2) as run:
        rows = run_cells(tmp_path / 'two', streams, cells, lcd, run)
    assert untimed(rows) == untimed(expected)


def end_worker(task):
    """Kill the process that works on the task."""
    os.kill(os.getpid(), signal.SIGKILL)


def interrupt_parent(folder, task):
    """Leave a note of the process, press Ctrl-C, and wait to be ended."""
    (Path(folder) / str(os.getpid())).touch()
    os.kill(os.getppid(), signal.SIGINT)
    threading.Event().wait()


def test_a_process_that_dies_is_told():
    with pytest.raises(EvaluationError, match='fewer --jobs'), local_workers(1) as run:
        list(run(end_worker, [1]))


def test_an_interruption_ends_the_processes_at_once(tmp_path):
    with pytest.raises(KeyboardInterrupt), local_workers(1) as run:
        list(run(partial(interrupt_parent, str(tmp_path)), [1, 2, 3]))
    process = int(next(tmp_path.iterdir()).name)
    until(lambda: not Path(f'/proc/{process}').exists())


def until(condition, deadline_s=60.0):
    end_s = time.monotonic() + deadline_s
    while not condition():
        assert time.monotonic() < end_s, 'the condition did not come true in time'
        threading.Event().wait(0.02)


def run_once_killed(marker, task):
    """Do a task; the first process to come here waits to be killed instead."""
    try:
        descriptor = os.open(marker, os.O_CREAT | os.O_EXCL | os.O_WRONLY)
    except FileExistsError:
        return run_task(task)
    os.write(descriptor, str(os.getpid()).encode())
    os.close(descriptor)
    return threading.Event().wait()


@pytest.fixture
def cluster(tmp_path):
    """Return the address of a Dask scheduler on loopback with two workers of one thread each."""
    pytest.importorskip('distributed',
                        reason='distributed is not installed: pip install ".[cluster]"')
    file = tmp_path / 'scheduler.json'
    here = Path(__file__).parent
    environment = {**os.environ, 'DASK_DISTRIBUTED__DASHBOARD__LINK': '',
                   'PYTHONPATH': os.pathsep.join([str(here), str(here.parent)])}
    command = [sys.executable, '-m', 'dask']
    processes = [subprocess.Popen(
        [*command, *arguments, '--scheduler-file', str(file), '--host', '127.0.0.1',
         '--no-dashboard'], env=environment, cwd=tmp_path, stderr=subprocess.DEVNULL)
        for arguments in (['scheduler', '--port', '0'],
                          ['worker', '--nworkers', '1', '--nthreads', '1', '--no-nanny'],
                          ['worker', '--nworkers', '1', '--nthreads', '1', '--no-nanny'])]
    until(lambda: file.exists() and file.read_text().endswith('}'))
    yield json.loads(file.read_text())['address']
    for process in processes:
        process.kill()
        process.wait()


def test_a_cluster_that_loses_a_worker_loses_no_cell(tmp_path, streams, cells, lcd, cluster,
                                                    monkeypatch):
    monkeypatch.setattr(run_module, '_TASK_S', 0.0)
    expected = run_cells(tmp_path / 'one', streams, cells, lcd)
    marker, finished = tmp_path / 'marker', []

    def kill_then_go_on(cell_count, share):
        finished.append(cell_count)
        if len(finished) == 1:
            until(lambda: marker.exists() and marker.read_text())
            os.kill(int(marker.read_text()), signal.SIGKILL)

    with dask_workers(cluster) as run:
        rows = run_cells(tmp_path / 'two', streams, cells, lcd,
                         lambda function, tasks: run(partial(run_once_killed, str(marker)), tasks),
                         kill_then_go_on)
    assert untimed(rows) == untimed(expected)
    assert finished == list(range(1, 11))


def test_a_scheduler_that_is_not_there_is_told(monkeypatch):
    pytest.importorskip('distributed')
    monkeypatch.setattr('adversarial_lcd_ros.evaluation.workers._CONNECT_S', 0.2)
    with pytest.raises(EvaluationError, match='no Dask scheduler'), \
            dask_workers('tcp://127.0.0.1:9'):
        pass
