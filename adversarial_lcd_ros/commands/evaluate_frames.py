# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd evaluate, with a recipe of the protocol "frames": many attacks, many seeds."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, replace
from pathlib import Path
import sys
import time
from typing import TYPE_CHECKING, Any

from adversarial_lcd_ros.commands.common import (
    add_cache_option,
    check_counts,
    is_quiet,
    make_console,
    print_json,
    print_lines,
    progress_bar,
    tell,
    worker_count,
)
from adversarial_lcd_ros.config import (
    AttackConfig,
    BuilderConfig,
    LabelConfig,
    LcdConfig,
    ReplayConfig,
)
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.settings import chosen_settings, config_from_options

if TYPE_CHECKING:
    from adversarial_lcd_ros.evaluation.frames.cells import Cell
    from adversarial_lcd_ros.evaluation.frames.run import Experiment
    from adversarial_lcd_ros.evaluation.rings.posters import Checks, PosterConfig
    from adversarial_lcd_ros.evaluation.store import Row
    from adversarial_lcd_ros.evaluation.streams import Stream
    from adversarial_lcd_ros.evaluation.workers import Run

_OPTIONS = ('jobs', 'scheduler', 'seeds', 'frames', 'only', 'cache')


def add_options(parser: ArgumentParser) -> None:
    """Declare what only recipes of the protocol "frames" have."""
    group = parser.add_argument_group('recipes of the protocol "frames"')
    group.add_argument('--jobs', type=int, metavar='N',
                       help='processes on this machine (default: one for each core)')
    group.add_argument('--scheduler', metavar='ADDRESS',
                       help='run on a Dask cluster, tcp://HOST:PORT, in place of local processes')
    group.add_argument('--seeds', type=int, metavar='N',
                       help='seeds of every attack: 42, 43, ... (default: what the recipe says)')
    group.add_argument('--frames', type=int, metavar='N',
                       help='frames with a loop, and as many at new places, for each seed '
                       '(default: what the recipe says)')
    group.add_argument('--only', action='append', metavar='PART',
                       help='a part of the recipe, alone or with others named the same way; what '
                       'is finished is not run again (default: all)')
    add_cache_option(group)


def refuse_options(options: Namespace) -> None:
    """Raise ConfigError if an option is given that only the protocol "frames" has."""
    given = [f'--{name}' for name in _OPTIONS if getattr(options, name) is not None]
    if given:
        raise ConfigError(f'{", ".join(given)} belong to recipes of the protocol "frames"; '
                          f'{options.recipe or "this"} replays a bag through the nodes')


def run(options: Namespace) -> None:
    """Run the recipe, or what is left of it, and write the report."""
    from adversarial_lcd_ros.evaluation.frames.recipe import load_cells
    from adversarial_lcd_ros.evaluation.frames.run import plan_experiment, run_experiment
    from adversarial_lcd_ros.evaluation.recipes import RINGS, read_recipe
    from adversarial_lcd_ros.evaluation.results import SUMMARY, read_json
    from adversarial_lcd_ros.evaluation.rings.posters import poster_config
    from adversarial_lcd_ros.evaluation.store import open_store

    started = time.monotonic()
    _check(options)
    lcd = config_from_options(options, LcdConfig)
    conditions = _conditions(options, lcd)
    cells = [replace(cell, conditions=conditions)
             for cell in load_cells(options.recipe, _overrides(options), options.only or ())]
    path, recipe = read_recipe(options.recipe)
    # Wrong ones are told before the hours that cells may take.
    posters = (None if recipe.get('posters') is None else
               poster_config(recipe['posters'], path))
    folder = _folder(options)
    with open_store(folder) as store:
        streams = _open(options, cells)
        experiment = plan_experiment(streams, cells, lcd, list(store.rows))
        _write_setup(folder, options, streams, [asdict(cell) for cell in cells])
        _announce(options, streams, experiment, len(store.rows) - experiment.finished)
        try:
            with _workers(options) as workers, _bar(experiment) as progress:
                rows = run_experiment(experiment, store, workers, progress)
        except KeyboardInterrupt:
            tell(f'{len(store.rows)} cells are in {store.path}; the same command goes on from '
                 'there')
            raise
        report = (_report_rings(options, folder, streams, cells, rows, posters)
                  if recipe['protocol'] == RINGS else
                  _report_frames(folder, streams, cells, rows, lcd))
    if options.json:
        print_json({'folder': str(folder), **read_json(folder / SUMMARY)})
        return
    _conclude(rows, time.monotonic() - started, report)


def _report_frames(folder: Path, streams: list[Stream], cells: list[Cell], rows: list[Row],
                   lcd: LcdConfig) -> Path:
    """Draw attacked frames, and why attacks work where they do; write the report."""
    from adversarial_lcd_ros.evaluation.frames.pictures import attacked_pictures
    from adversarial_lcd_ros.evaluation.frames.why import explain
    from adversarial_lcd_ros.evaluation.frames.why_picture import write_why
    from adversarial_lcd_ros.evaluation.paper.report import write_paper_report
    from adversarial_lcd_ros.evaluation.pictures import write_pictures

    write_pictures(folder, attacked_pictures(streams, cells, rows, lcd))
    write_why(folder, explain(streams, cells, rows, lcd))
    return write_paper_report(folder, rows)


def _report_rings(options: Namespace, folder: Path, streams: list[Stream], cells: list[Cell],
                  rows: list[Row], posters: tuple[PosterConfig, Checks] | None) -> Path:
    """Hang the posters of a recipe, measure what defences cost, write the page."""
    from adversarial_lcd_ros.evaluation.pictures import write_pictures
    from adversarial_lcd_ros.evaluation.rings.pictures import ring_pictures
    from adversarial_lcd_ros.evaluation.rings.posters import PairTask, poster_streams
    from adversarial_lcd_ros.evaluation.rings.report import write_rings
    from adversarial_lcd_ros.evaluation.rings.run import measured_prices, run_posters

    lcd = config_from_options(options, LcdConfig)
    labels = config_from_options(options, LabelConfig)
    declared: list[Row] = []
    tasks: list[PairTask] = []
    if posters is not None:
        with _workers(options) as workers, progress_bar('posters') as progress:
            declared, tasks = run_posters(folder, poster_streams(streams), *posters, lcd, labels,
                                          workers, progress)
    write_pictures(folder, ring_pictures(streams, cells, rows, lcd, declared, tasks))
    return write_rings(folder, rows, declared, measured_prices(streams, cells, lcd))


def _check(options: Namespace) -> None:
    for name in ('rebuild', 'keep_recordings', 'sweep_labels', 'map'):
        if getattr(options, name):
            raise ConfigError(f'--{name.replace("_", "-")} belongs to recipes that replay a bag; '
                              f'{options.recipe} attacks a sample of frames without recording')
    if chosen_settings(options, ReplayConfig):
        raise ConfigError('settings of the replay are given, but nothing is replayed: name a '
                          'part of a sequence as PATH@FROM:TO')
    check_counts(options, 'jobs', 'seeds', 'frames')
    if options.jobs is not None and options.scheduler is not None:
        raise ConfigError('--jobs and --scheduler: expected one of them; the cluster has its own '
                          'number of workers')


def _overrides(options: Namespace) -> dict[str, Any]:
    """Return what the command line says about the attacks, in the words of a recipe."""
    values = chosen_settings(options, AttackConfig)
    if 'seed' in values:
        raise ConfigError('--seed is for a single attack: here --seeds says how many there are')
    lcd, builder = (chosen_settings(options, config) for config in (LcdConfig, BuilderConfig))
    values |= {name: lcd[name] for name in ('target', 'threshold') if name in lcd}
    if 'hard_answers' in lcd:
        values['oracle'] = 'hard' if lcd['hard_answers'] else 'soft'
    if 'features' in builder:
        values['nodes'] = builder['features']
    values |= {name: getattr(options, name) for name in ('seeds', 'frames')
               if getattr(options, name) is not None}
    return values


def _conditions(options: Namespace, lcd: LcdConfig) -> str:
    """Return settings that no column of the tables has and that are not the default."""
    return ', '.join(filter(None, (
        lcd.changed('target', 'threshold', 'hard_answers', 'model'),
        config_from_options(options, BuilderConfig).changed(
            'features', 'model', 'vocabulary', 'detections'),
        config_from_options(options, LabelConfig).changed())))


def _folder(options: Namespace) -> Path:
    output: Path = options.output
    return output / Path(options.recipe).stem if output == Path('results') else output


def _open(options: Namespace, cells: list[Cell]) -> list[Stream]:
    from adversarial_lcd_ros.evaluation.frames.recipe import load_labels
    from adversarial_lcd_ros.evaluation.streams import open_streams

    builder = config_from_options(options, BuilderConfig)
    labels = config_from_options(options, LabelConfig)
    own_labels = load_labels(options.recipe, chosen_settings(options, LabelConfig))
    streams: list[Stream] = []
    with progress_bar('graphs') as progress:
        for variant in dict.fromkeys(cell.variant_needed for cell in cells):
            nodes = sorted({cell.nodes for cell in cells if cell.variant_needed == variant})
            streams += open_streams(
                options.sources, nodes, builder, labels, options.cache, progress, own_labels,
                variant)
    return streams


def _write_setup(folder: Path, options: Namespace, streams: list[Stream],
                 cells: list[dict[str, Any]]) -> None:
    from adversarial_lcd_ros.environment import environment
    from adversarial_lcd_ros.evaluation.frames.run import FIRST_SEED, versions_digest
    from adversarial_lcd_ros.evaluation.results import ENVIRONMENT, ResultsFolder

    results = ResultsFolder(folder)
    results.write_setup(
        [config_from_options(options, config) for config in
         (BuilderConfig, LcdConfig, LabelConfig)], sys.argv, FIRST_SEED,
        {'cells': cells, 'sequences': [
            {'source': stream.graphs.source, 'name': stream.name, 'nodes': stream.nodes,
             'nodes_mean': stream.nodes_mean, 'frames': len(stream.labels.kind),
             'labels_by': stream.labels.told_by, 'digest': stream.digest} for stream in streams]})
    # Rows name the releases that made them; a later run must not take away what that means.
    results.write_json(f'{Path(ENVIRONMENT).stem}-{versions_digest()}.json', environment())


def _announce(options: Namespace, streams: list[Stream], experiment: Experiment,
              others: int) -> None:
    for stream in {stream.name: stream for stream in streams}.values():
        tell(f'{stream.name}: {stream.labels.count("positive")} frames with a loop, '
             f'{stream.labels.count("negative")} at new places, of {len(stream.labels.kind)}; '
             f'labels by {stream.labels.told_by}')
    if others:
        tell('cells finished earlier that are of other settings, graphs, models or code: '
             f'{others}; kept, but not in the report')
    left = len(experiment.keys) - experiment.finished
    minutes, jobs = experiment.cost_s / 60, worker_count(options.jobs)
    where = (f'the workers of {options.scheduler}: {minutes:.0f} min of one core'
             if options.scheduler else f'{jobs} processes: about {minutes / jobs:.0f} min')
    tell(f'{left} of {len(experiment.keys)} cells to run on {where}' if left else
         f'all {len(experiment.keys)} cells are finished')


def _workers(options: Namespace) -> AbstractContextManager[Run]:
    from adversarial_lcd_ros.evaluation.workers import dask_workers, local_workers

    if options.scheduler:
        return dask_workers(options.scheduler)
    return local_workers(worker_count(options.jobs))


@contextmanager
def _bar(experiment: Experiment) -> Iterator[Callable[[float, float], None]]:
    """Show cells and time left; the time by the expected costs, the cells as they are counted."""
    if is_quiet():
        yield lambda cells, share: None
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.progress import TimeRemainingColumn as TimeLeftColumn

    count = TextColumn('{task.fields[cells]} of {task.fields[all]} cells')
    with Progress(count, BarColumn(), TextColumn('{task.percentage:.0f} %'), TimeElapsedColumn(),
                  TextColumn('left'), TimeLeftColumn(), console=make_console(stderr=True),
                  speed_estimate_period=600) as bar:
        task = bar.add_task('', total=1.0, cells=experiment.finished, all=len(experiment.keys))
        yield lambda cells, share: bar.update(task, completed=share, cells=cells)


def _conclude(rows: list[Row], spent_s: float, report: Path) -> None:
    from adversarial_lcd_ros.evaluation.frames.run import kinds_of_cells
    from adversarial_lcd_ros.evaluation.paper.summaries import summarise_cells
    from adversarial_lcd_ros.evaluation.terminal import experiment_lines

    console = make_console()
    # Whoever is refused deceives nobody: he is in the report, and no strongest attack.
    open_wire = [row for row in rows if not row['sealed']]
    tables, finding = experiment_lines(summarise_cells(open_wire or rows))
    for title, lines in tables:
        print_lines(title, lines)
    console.print(finding)
    if not is_quiet():
        print_lines('Processor time a frame, ms', [
            {'attack': kind, 'frames': str(frames), 'queries': f'{1e3 * queries:.1f}',
             'search': f'{1e3 * search:.1f}', 'judging': f'{1e3 * judging:.1f}'}
            for kind, frames, (queries, search, judging) in kinds_of_cells(rows)])
    releases = sorted({row['versions'] for row in rows})
    if len(releases) > 1:
        console.print(f'The cells were made with several releases of the libraries: '
                      f'{", ".join(releases)} (environment-*.json).', soft_wrap=True)
    console.print(f'{spent_s:.0f} s; report: {report}', soft_wrap=True)
