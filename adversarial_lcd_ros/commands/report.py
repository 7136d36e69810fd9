# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd report: the report of a results folder anew."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from adversarial_lcd_ros.commands.common import Commands, add_command


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(commands, 'report', 'Write the report of a results folder anew.', _report)
    parser.add_argument('folder', type=Path, nargs='?', default=Path('results/latest'),
                        help='results folder (default: %(default)s)')


def _report(options: Namespace) -> None:
    from adversarial_lcd_ros.evaluation.kinds import open_results

    kind, results = open_results(options.folder)
    print(kind.report(results))
