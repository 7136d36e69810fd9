# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd labels: what a sequence's labels are, before anything is evaluated."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
import sys
from typing import Any

from adversarial_lcd_ros.commands.common import (
    Commands,
    add_command,
    add_source_options,
    imported_source,
    progress_bar,
)
from adversarial_lcd_ros.config import LabelConfig
from adversarial_lcd_ros.settings import add_config_option, add_config_options, config_from_options


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(
        commands, 'labels', 'Show which frames of a sequence are loops and new places, and by '
        'what that is told.', _labels)
    parser.usage = f'{parser.prog} SEQUENCE [OPTIONS]'
    parser.add_argument('source', metavar='SEQUENCE',
                        help='bag, folder or bag of graphs with ground truth; PATH@FROM:TO takes '
                        'a part of its frames')
    parser.add_argument('--output', type=Path, default=Path('results/labels'), metavar='FOLDER',
                        help='counts, path and pairs to look at are written there (default: '
                        '%(default)s)')
    parser.add_argument('--check', action='store_true',
                        help='hold the audit, or the rule that is chosen, against the exact '
                        'co-visibility beside the sequence')
    add_config_option(parser)
    add_source_options(parser)
    add_config_options(parser, LabelConfig, 'label-')


def _labels(options: Namespace) -> None:
    from adversarial_lcd_ros.evaluation.labels.run import write_labels

    config = config_from_options(options, LabelConfig)
    source = imported_source(options.source, options)
    with progress_bar('views compared') as progress:
        summary = write_labels(source, options.output, config, check=options.check,
                               command_line=sys.argv, progress=progress)
    row = summary['rows'][0]
    _print(row)
    if options.check:
        print('held against exact co-visibility:')
        _print(row['check'])
    print(f'{row["positive"]} frames with a loop and {row["negative"]} at a new place, of '
          f'{row["frames"]}, will be scored; look at the pairs before you believe a figure')
    print(f'report: {options.output / "report.html"}')


def _print(values: dict[str, Any]) -> None:
    for name, value in values.items():
        if not isinstance(value, dict):
            shown = f'{value:.4f}' if isinstance(value, float) else value
            print(f'  {name.replace("_", " ")}: {shown}')
