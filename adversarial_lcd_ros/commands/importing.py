# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd import: a recorded sequence into a bag."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from adversarial_lcd_ros.commands.common import (
    Commands,
    add_command,
    add_source_options,
    progress_bar,
    source_options,
    tell,
)


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(commands, 'import', 'Turn a recorded sequence into a bag.', _import)
    parser.add_argument('source', type=Path, help='TUM RGB-D or Bonn folder, EuRoC, '
                        'TUM-VI, KITTI odometry, OpenLORIS, Replica, ScanNet, 7-Scenes, folder of '
                        'images or of walks, video, ROS 1 bag, or rosbag2')
    parser.add_argument('destination', type=Path, help='bag to write (rosbag2, MCAP)')
    parser.add_argument('--raw-as', choices=('jpeg', 'png'), default='jpeg', help='how frames '
                        'that come uncompressed are stored (default: %(default)s)')
    parser.add_argument('--overwrite', action='store_true', help='replace a bag that is there')
    add_source_options(parser)


def _import(options: Namespace) -> None:
    from adversarial_lcd_ros.files.text import printable
    from adversarial_lcd_ros.sequences import import_sequence

    with progress_bar(f'importing {options.source.name}') as progress:
        done = import_sequence(
            options.source, options.destination, progress=progress, overwrite=options.overwrite,
            raw_as=options.raw_as, **source_options(options))
    for note in done.notes:
        print(printable(note))
    width, height = done.image_size
    print(f'{printable(str(done.path))}: {done.frames} frames of {width} x {height} pixels, '
          f'{done.poses} poses, {done.duration_s:.1f} s, {done.size_bytes / 1e6:.1f} MB')
    print(done.coverage)
    tell(f'next: adversarial-lcd {"labels" if done.poses else "evaluate"} {done.path}')
