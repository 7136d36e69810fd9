# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd key: a new key for graph_builder and lcd."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from adversarial_lcd_ros.commands.common import Commands, add_command


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(
        commands, 'key', 'Make a key by which graph_builder seals graphs and lcd knows them '
        '(their parameter "key").', _key)
    parser.add_argument('file', type=Path, help='new file, readable by its owner only')


def _key(options: Namespace) -> None:
    from adversarial_lcd_ros.files.keys import make_key

    make_key(options.file)
    print(options.file)
