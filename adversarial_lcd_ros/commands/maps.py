# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd map and render: what the closures of a replay do to the map."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
import sys
from typing import TYPE_CHECKING, Any

from adversarial_lcd_ros.commands.common import (
    Commands,
    add_command,
    add_json_option,
    check_counts,
    make_console,
    print_json,
    print_rows,
    progress_bar,
    worker_count,
)
from adversarial_lcd_ros.config import MapConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.settings import add_config_option, add_config_options, config_from_options

if TYPE_CHECKING:
    from adversarial_lcd_ros.evaluation.kinds.base import Results, ResultsKind

PREFIX = 'map-'
CLAIMS = ('essential', 'consistent')  # of evaluation/maps/cases, which is slow to import


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(
        commands, 'map', 'Make maps of the closures that a replay declared, clean and attacked, '
        'and report how far they are off.', _map)
    parser.usage = f'{parser.prog} [RESULTS ...] [OPTIONS]'
    parser.add_argument('folders', type=Path, nargs='*', default=[Path('results/latest')],
                        metavar='RESULTS', help='results folder of a replay (default: '
                        'results/latest); a folder "map" is made in it, and what is finished '
                        'there is not made again. Several, of one sequence and of detectors that '
                        'differ in a setting: their runs side by side')
    parser.add_argument('--output', type=Path, metavar='FOLDER', help='folder of the maps, in '
                        'place of "map"; several replays have to name one')
    parser.add_argument('--claims', nargs='+', default=[], choices=CLAIMS, metavar='CLAIM',
                        help='make maps by what closures may claim beside the settings, too: '
                        'essential (all by the features), consistent (false ones agree with one '
                        'another)')
    parser.add_argument('--export-g2o', type=Path, metavar='FOLDER', help='write the pose graph '
                        'of every run there, for any solver that reads g2o, and make no maps')
    parser.add_argument('--sweeps', action='store_true', help='vary the drift, add false '
                        'closures, and leave out right ones, too')
    add_json_option(parser)
    _add_shared_options(parser)


def _add_shared_options(parser: ArgumentParser) -> None:
    parser.add_argument('--sequence', metavar='SEQUENCE', help='the sequence that was replayed, '
                        'where the results do not say, or it has moved')
    parser.add_argument('--jobs', type=int, metavar='N',
                        help='processes (default: one for each core)')
    add_config_option(parser)
    add_config_options(parser, MapConfig, PREFIX)


def add_render(commands: Commands) -> None:
    """Declare the command ``render``."""
    parser = add_command(
        commands, 'render', 'Write an animation of the map of a run as it is made, frame after '
        'frame, by odometry alone and by every back end.', _render)
    parser.usage = f'{parser.prog} [RESULTS] [OPTIONS]'
    parser.add_argument('folder', type=Path, nargs='?', default=Path('results/latest'),
                        metavar='RESULTS', help='results folder of a replay (default: '
                        '%(default)s); for maps that "map" made also a folder of these')
    parser.add_argument('--output', type=Path, default=Path('map.gif'), metavar='FILE',
                        help='.gif or .mp4; .png or .svg: no '
                        'animation, the maps that "map" made (default: %(default)s)')
    parser.add_argument('--run', metavar='NAME', dest='shown', help='"clean" or the name of an '
                        'attack (default: the run with the most false closures)')
    parser.add_argument('--seconds', type=float, default=0.0, metavar='X', help='of the sequence '
                        'that are shown; 0: all (default: %(default)s)')
    parser.add_argument('--steps', type=int, default=60, metavar='N', help='pictures (default: '
                        '%(default)s)')
    _add_shared_options(parser)


def check(options: Namespace) -> None:
    """Raise ConfigError if settings are wrong, or gtsam is missing: before anything takes long."""
    from adversarial_lcd_ros.slam.library import gtsam

    config_from_options(options, MapConfig)
    gtsam()


def check_source(sequence: Path) -> None:
    """Raise EvaluationError if no maps can be made of a sequence."""
    from adversarial_lcd_ros.evaluation.maps.inputs import has_metres

    has_metres(sequence)


def _map(options: Namespace) -> None:
    check_counts(options, 'jobs')
    if options.export_g2o is not None:
        _export(options)
        return
    summary = make(options.folders, options, output=options.output, source=options.sequence,
                   sweeps=options.sweeps, claims=options.claims, jobs=options.jobs)
    if options.json:
        print_json({'folder': str(options.output or options.folders[0]), **summary})
        return
    show(options.output or options.folders[0], summary)


def make(folders: Sequence[Path], options: Namespace, *, output: Path | None = None,
         source: str | None = None, sweeps: bool = False, claims: Sequence[str] = (),
         jobs: int | None = None) -> dict[str, Any]:
    """Make the maps of results folders, and their report; return their summary."""
    from adversarial_lcd_ros.evaluation.maps.report import FOLDER, report_maps
    from adversarial_lcd_ros.evaluation.maps.run import make_maps
    from adversarial_lcd_ros.evaluation.workers import local_workers

    opened = [_open_replay(folder) for folder in folders]
    if output is None and len(folders) > 1:
        raise ConfigError(f'{len(folders)} replays: name a folder for their maps with --output')
    with _Bars() as bars, local_workers(worker_count(jobs)) as workers:
        summary = make_maps(folders, config_from_options(options, MapConfig), workers,
                            output=output, source=source, sweeps=sweeps, claims=claims,
                            command_line=sys.argv, progress=bars)
    report_maps(output or folders[0] / FOLDER)
    if output is None:
        for kind, results in opened:
            kind.report(results)
    return summary


def _open_replay(folder: Path) -> tuple[ResultsKind, Results]:
    from adversarial_lcd_ros.evaluation.kinds import open_results
    from adversarial_lcd_ros.evaluation.kinds.replay import ReplayResults

    kind, results = open_results(folder)
    if kind.name != ReplayResults.name:
        raise ConfigError(f'{folder} has results of the kind "{kind.name}": maps are made of '
                          f'the kind "{ReplayResults.name}", every frame of a sequence')
    return kind, results


def _render(options: Namespace) -> None:
    from adversarial_lcd_ros.evaluation.kinds import open_results
    from adversarial_lcd_ros.evaluation.maps.animation import FORMATS, animate
    from adversarial_lcd_ros.evaluation.maps.report import FOLDER, STILLS, draw_still
    from adversarial_lcd_ros.evaluation.maps.summary import KIND
    from adversarial_lcd_ros.evaluation.workers import local_workers

    check_counts(options, 'jobs')
    if options.steps < 1 or options.seconds < 0:
        raise ConfigError(f'--steps {options.steps}, --seconds {options.seconds:g}: expected 1 or '
                          'more, and 0 or more')
    if options.output.suffix not in (*FORMATS, *STILLS):
        raise ConfigError(f'--output {options.output}: expected a name that ends in '
                          f'{", ".join((*FORMATS, *STILLS))}')
    is_map = options.output.suffix in STILLS and open_results(options.folder)[0].name == KIND
    if not is_map:
        _open_replay(options.folder)
    if options.output.suffix in STILLS:
        draw_still(options.folder if is_map else options.folder / FOLDER, options.output)
        print(options.output)
        return
    with _Bars() as bars, local_workers(worker_count(options.jobs)) as workers:
        animate(options.folder, options.output, config_from_options(options, MapConfig), workers,
                run=options.shown, steps=options.steps, seconds=options.seconds,
                source=options.sequence, progress=bars)
    print(options.output)


class _Bars(ExitStack):
    """One bar after the other, each shown once there is something to show."""

    def __init__(self) -> None:
        super().__init__()
        self._shown = ''

    def __call__(self, what: str) -> Callable[[int, int], None]:
        """Return what is called with the work done and the whole."""
        def tell(done: int, total: int) -> None:
            if self._shown != what:
                self.close()
                self._shown, self._tell = what, self.enter_context(progress_bar(what))
            self._tell(done, total)
        return tell


def show(folder: Path, summary: dict[str, Any]) -> None:
    """Print the tables of maps."""
    from adversarial_lcd_ros.evaluation.maps.tables import all_tables

    for title, rows in all_tables(summary):
        print_rows(title, rows)
    make_console().print(f'report: {folder / "report.html"}', soft_wrap=True)


def show_runs(summary: dict[str, Any]) -> None:
    """Print the errors of the runs alone."""
    from adversarial_lcd_ros.evaluation.maps.tables import run_tables

    for title, rows in run_tables(summary):
        print_rows(title, rows)


def _export(options: Namespace) -> None:
    from adversarial_lcd_ros.evaluation.maps.run import export_g2o

    with _Bars() as bars:
        paths = list(export_g2o(options.folders, options.export_g2o,
                                config_from_options(options, MapConfig),
                                source=options.sequence, progress=bars))
    for path in paths:
        print(path)
