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
    progress_bar,
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

RESULTS, TABLE, PICTURE = 'certificates.json', 'certificates.md', 'certificates.svg'
_DEFAULT_TARGETS, _DEFAULT_DEFENCES = ('edges', 'wl'), (NONE, 'length_check')


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(commands, 'certify', 'Prove which decisions no few edge flips can turn '
                         'over, whoever chooses them.', _certify)
    parser.usage = f'{parser.prog} SEQUENCE [SEQUENCE ...] [OPTIONS]'
    parser.add_argument('sources', nargs='+', metavar='SEQUENCE',
                        help='bag, folder or bag of graphs with ground truth; PATH@FROM:TO takes '
                        'a part of its frames')
    parser.add_argument('--output', type=Path, default=Path('results/certificates'),
                        metavar='FOLDER', help='(default: %(default)s)')
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
    for config, prefix in ((BuilderConfig, 'builder-'), (LcdConfig, 'lcd-'),
                           (LabelConfig, 'label-')):
        add_config_options(parser, config, prefix)


def _certify(options: Namespace) -> None:
    from adversarial_lcd_ros.evaluation.certificates.run import KIND, SCHEMA, run_certificates
    from adversarial_lcd_ros.evaluation.certificates.tables import (
        certificate_table,
        draw_certificates,
    )
    from adversarial_lcd_ros.evaluation.results import summary_document
    from adversarial_lcd_ros.evaluation.workers import local_workers
    from adversarial_lcd_ros.files.writing import write_bytes, write_json, write_text

    tasks = _tasks(options)
    options.output.mkdir(parents=True, exist_ok=True)
    rows = []
    with local_workers(options.jobs) as run, progress_bar('certificates') as progress:
        progress(0, len(tasks))
        for row in run(run_certificates, tasks):
            rows.append(row)
            progress(len(rows), len(tasks))
    order = {(task.stream.name, task.lcd.target, task.lcd.defences): place
             for place, task in enumerate(tasks)}
    rows.sort(key=lambda row: order[row['sequence'], row['target'], row['defences']])
    summary = summary_document(KIND, SCHEMA, rows, {'command_line': sys.argv})
    write_json(options.output / RESULTS, summary)
    table = certificate_table(rows)
    write_text(options.output / TABLE, table)
    write_bytes(options.output / PICTURE, draw_certificates(rows))
    if options.json:
        print_json({'folder': str(options.output), **summary})
        return
    print(table, end='')
    print(options.output / PICTURE)


def _tasks(options: Namespace) -> list[CertificateTask]:
    from adversarial_lcd_ros.evaluation.certificates.run import CertificateTask
    from adversarial_lcd_ros.evaluation.streams import open_streams
    from adversarial_lcd_ros.lcd.certificates import check_provable

    check_counts(options, 'budget', 'frames', 'jobs')
    for name, instead in (('target', 'targets'), ('defences', 'defences')):
        if name in chosen_settings(options, LcdConfig):
            raise ConfigError(f'setting {name} of the detector: here --{instead} says which, one '
                              'or several')
    lcd = config_from_options(options, LcdConfig)
    detectors = [replace(lcd, target=target, defences=defences)
                 for target in options.targets for defences in options.defences]
    for config in detectors:
        check_provable(config)
    builder = config_from_options(options, BuilderConfig)
    labels = config_from_options(options, LabelConfig)
    with progress_bar('graphs') as progress:
        streams = open_streams(options.sources, [builder.features], builder, labels,
                               options.cache, lambda _, done, total: progress(done, total))
    return [CertificateTask(stream, config, options.budget, options.frames)
            for stream in streams for config in detectors]
