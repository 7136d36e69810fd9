# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd convert: a recording of the nodes as any reader of MCAP understands it."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from adversarial_lcd_ros.commands.common import Commands, add_command, progress_bar, tell


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(
        commands, 'convert', 'Write a recording of the nodes anew: typed, with camera frames and '
        'a picture of each decision; config/foxglove.json shows it in Foxglove.', _convert)
    parser.add_argument('source', type=Path, metavar='OLD',
                        help='rosbag2, by bag_replay or by "ros2 bag record"')
    parser.add_argument('destination', type=Path, metavar='NEW',
                        help='bag to write (rosbag2, MCAP)')
    parser.add_argument('--frames', type=Path, metavar='SEQUENCE',
                        help='what was replayed, where the recording has no camera frames')
    parser.add_argument('--overwrite', action='store_true', help='replace a bag that is there')


def _convert(options: Namespace) -> None:
    from adversarial_lcd_ros.graph_sequences.converting import VIEW_TOPIC, convert_recording

    with progress_bar(f'converting {options.source.name}') as progress:
        done = convert_recording(options.source, options.destination, options.frames,
                                 progress=progress, overwrite=options.overwrite)
    for note in done.notes:
        tell(note)
    if VIEW_TOPIC not in done.messages:
        tell('no pictures of decisions: the recording has no frame with its graph and decision; '
             '--frames SEQUENCE brings the frames')
    print(f'{done.path}: ' + ', '.join(
        f'{count} on {topic}' for topic, count in sorted(done.messages.items())))
