# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd compile: compiled code, made once."""

from __future__ import annotations

from argparse import Namespace
import time

from adversarial_lcd_ros.commands.common import Commands, add_command, tell
from adversarial_lcd_ros.errors import ConfigError


def add(commands: Commands) -> None:
    """Declare the command."""
    add_command(
        commands, 'compile', 'Compile once what nodes and evaluations need: whoever starts '
        'afterwards loads it. Without it, the first to need something compiles it.', _compile)


def _compile(options: Namespace) -> None:
    from adversarial_lcd_ros.compiled.caching import code_folder
    from adversarial_lcd_ros.preloading import load_everything

    folder = code_folder()
    if folder is None:
        raise ConfigError('compiled code can be kept nowhere: set NUMBA_CACHE_DIR to a folder '
                          'that can be written, here and where the nodes run')
    began_s = time.monotonic()
    load_everything(tell)
    print(f'{folder}: compiled code in {time.monotonic() - began_s:.0f} s')
