# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd certify: decisions that no few flips can turn over."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from adversarial_lcd_ros.commands.common import (
    Commands,
    add_command,
    add_json_option,
    add_work_options,
    check_counts,
    print_json,
    print_lines,
    progress_bar,
    tell,
)
from adversarial_lcd_ros.config import BuilderConfig, LabelConfig, LcdConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.registry import NONE
from adversarial_lcd_ros.settings import (
    add_config_options,
    add_models_option,
    chosen_settings,
    config_from_options,
)

if TYPE_CHECKING:
    from adversarial_lcd_ros.evaluation.certificates.run import CertificateTask
    from adversarial_lcd_ros.evaluation.store import CellStore
    from adversarial_lcd_ros.evaluation.streams import Stream

_DEFAULT_TARGETS, _DEFAULT_DEFENCES = ('edges', 'wl', 'symbio'), (NONE, 'length_check')
_CONFIGS = ((BuilderConfig, 'builder-'), (LcdConfig, 'lcd-'), (LabelConfig, 'label-'))


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(commands, 'certify', 'Prove which decisions no few edge flips can turn '
                         'over, whoever chooses them.', _certify)
    parser.usage = f'{parser.prog} SEQUENCE [SEQUENCE ...] [OPTIONS]'
    parser.add_argument('sources', nargs='+', metavar='SEQUENCE',
                        help='bag, folder or bag of graphs with ground truth; PATH@FROM:TO takes '
                        'a part of its frames')
    parser.add_argument('--output', type=Path, default=Path('results/certificates'),
                        metavar='FOLDER', help='frames that are there are not certified again '
                        '(default: %(default)s)')
    parser.add_argument('--targets', nargs='+', default=_DEFAULT_TARGETS, metavar='NAME',
                        help=f'(default: {" ".join(_DEFAULT_TARGETS)})')
    parser.add_argument('--defences', nargs='+', default=_DEFAULT_DEFENCES, metavar='NAMES',
                        help='each a value of --lcd-defences; a row each (default: '
                        f'{" ".join(_DEFAULT_DEFENCES)})')
    parser.add_argument('--budget', type=int, default=27, metavar='N',
                        help='most flips; the default is floor(r n^2) at 300 nodes and r = 3e-4')
    parser.add_argument('--frames', type=int, default=60, metavar='N',
                        help='most loops and most new places of a sequence, spread over it '
                        '(default: %(default)s)')
    add_work_options(parser)
    add_json_option(parser)
    add_models_option(parser)
    for config, prefix in _CONFIGS:
        add_config_options(parser, config, prefix)


def _certify(options: Namespace) -> None:
    from adversarial_lcd_ros.evaluation.certificates.page import write_page
    from adversarial_lcd_ros.evaluation.certificates.run import KIND, SCHEMA
    from adversarial_lcd_ros.evaluation.certificates.summaries import summarise
    from adversarial_lcd_ros.evaluation.certificates.tables import terminal_lines
    from adversarial_lcd_ros.evaluation.results import SUMMARY, ResultsFolder, summary_document
    from adversarial_lcd_ros.evaluation.store import open_store

    detectors = _detectors(options)
    with open_store(options.output) as store:
        streams = _streams(options)
        tasks = _tasks(options, streams, detectors)
        results = ResultsFolder(options.output)
        results.write_setup([config_from_options(options, config) for config, _ in _CONFIGS],
                            sys.argv, 0, {'targets': list(options.targets),
                                          'defences': list(options.defences)})
        _run(options, tasks, store)
        summary = summary_document(KIND, SCHEMA, summarise(tasks, store.rows))
        results.write_json(SUMMARY, summary)
    page = write_page(options.output, summary['rows'], sys.argv)
    if options.json:
        print_json({'folder': str(options.output), **summary})
        return
    print_lines('Balanced accuracy that no so many flips can lower',
                terminal_lines(summary['rows']))
    print(f'frames, classes, intervals: {page}')


def _run(options: Namespace, tasks: list[CertificateTask], store: CellStore) -> None:
    """Run what is left of the tasks."""
    from adversarial_lcd_ros.evaluation.certificates.run import CELL_COLUMNS, run_certificates
    from adversarial_lcd_ros.evaluation.workers import local_workers

    store.check([task.key for task in tasks], CELL_COLUMNS)
    left = [task for task in tasks if task.key not in store.rows]
    frames, done = sum(len(task.frames) for task in left), 0
    tell(f'{frames} of {sum(len(task.frames) for task in tasks)} certificates to make')
    with local_workers(options.jobs) as run, progress_bar('certificates') as progress:
        progress(0, frames)
        for key, cell in run(run_certificates, left):
            store.add(key, cell)
            done += len(cell['frames'])
            progress(done, frames)


def _detectors(options: Namespace) -> list[LcdConfig]:
    from adversarial_lcd_ros.lcd.certificates import check_provable

    check_counts(options, 'budget', 'frames', 'jobs')
    for name, instead in (('target', 'targets'), ('defences', 'defences')):
        if name in chosen_settings(options, LcdConfig):
            raise ConfigError(f'setting {name} of the detector: here --{instead} says which, one '
                              'or several')
    lcd = config_from_options(options, LcdConfig)
    detectors = [replace(lcd, target=target, defences=defences)
                 for target in dict.fromkeys(options.targets)
                 for defences in dict.fromkeys(options.defences)]
    for config in detectors:
        check_provable(config)
    return detectors


def _streams(options: Namespace) -> list[Stream]:
    """Return the sequences, each in the variants of graphs that the targets need."""
    from adversarial_lcd_ros.evaluation.streams import open_streams
    from adversarial_lcd_ros.lcd.targets import needed_variant

    builder = config_from_options(options, BuilderConfig)
    labels = config_from_options(options, LabelConfig)
    streams: list[Stream] = []
    with progress_bar('graphs') as progress:
        for variant in dict.fromkeys(map(needed_variant, options.targets)):
            streams += open_streams(
                options.sources, [builder.features], builder, labels, options.cache, progress,
                variant=variant)
    return streams


def _tasks(options: Namespace, streams: list[Stream], detectors: list[LcdConfig]
           ) -> list[CertificateTask]:
    from adversarial_lcd_ros.evaluation.certificates.run import certificate_tasks
    from adversarial_lcd_ros.lcd.targets import needed_variant

    return [task for name in dict.fromkeys(stream.name for stream in streams)
            for lcd in detectors for stream in streams
            if (stream.name, stream.variant) == (name, needed_variant(lcd.target))
            for task in certificate_tasks(stream, lcd, options.budget, options.frames)]
