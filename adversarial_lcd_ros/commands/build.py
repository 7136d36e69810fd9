# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd build: the graphs of a sequence into a bag."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from adversarial_lcd_ros.commands.common import (
    Commands,
    add_cache_option,
    add_command,
    add_source_options,
    imported_source,
    progress_bar,
    tell,
)
from adversarial_lcd_ros.config import BuilderConfig
from adversarial_lcd_ros.settings import (
    add_config_option,
    add_config_options,
    add_models_option,
    config_from_options,
)


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(
        commands, 'build', 'Build the graphs of a sequence into a bag, which replays without '
        'images.', _build)
    parser.add_argument('source', metavar='SOURCE',
                        help='bag or folder, or a folder of detections without images; '
                        'PATH@FROM:TO takes a part of its frames, PATH@0:0.5 the first half')
    parser.add_argument('destination', type=Path, metavar='DESTINATION',
                        help='bag to write (rosbag2, MCAP)')
    add_cache_option(parser)
    parser.add_argument('--overwrite', action='store_true', help='replace a bag that is there')
    add_config_option(parser, 'graph_builder')
    add_source_options(parser)
    add_models_option(parser)
    # argparse's own usage would be twenty options long before the first explanation.
    parser.usage = f'{parser.prog} SOURCE DESTINATION [OPTIONS]'
    add_config_options(parser, BuilderConfig)


def _build(options: Namespace) -> None:
    from adversarial_lcd_ros.graph_sequences.bags import build_graph_bag

    config = config_from_options(options, BuilderConfig)
    source = imported_source(options.source, options)
    with progress_bar(f'building {Path(options.source).name}') as progress:
        done = build_graph_bag(source, options.destination, config, cache=options.cache,
                               progress=progress, overwrite=options.overwrite)
    graphs = done.graphs.graphs
    empty = sum(not graph.node_count for graph in graphs)
    if empty:
        tell(f'warning: {empty} of {len(graphs)} graphs are empty: no feature and no object was '
             'found in their pictures, so nothing can be recognised by them')
    print(f'{done.path}: {len(graphs)} graphs, '
          f'{sum(graph.node_count for graph in graphs) / len(graphs):.1f} nodes and '
          f'{sum(graph.edge_count for graph in graphs) / len(graphs):.1f} edges on average, '
          f'{done.poses} poses, {done.size_bytes / 1e6:.1f} MB')
