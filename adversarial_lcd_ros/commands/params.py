# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd params: the ROS parameter file with the defaults."""

from __future__ import annotations

from adversarial_lcd_ros.commands.common import Commands, add_command
from adversarial_lcd_ros.settings import render_parameters


def add(commands: Commands) -> None:
    """Declare the command."""
    add_command(
        commands, 'params', 'Print the ROS parameter file of all nodes, with the defaults.',
        lambda _: print(render_parameters(), end=''))
