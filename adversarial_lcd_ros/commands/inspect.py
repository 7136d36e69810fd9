# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd inspect: what a bag, a payload or a results folder holds."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from adversarial_lcd_ros.commands.common import (
    Commands,
    add_command,
    add_json_option,
    add_source_options,
    make_console,
    print_json,
    print_rows,
    source_options,
)
from adversarial_lcd_ros.errors import CodecError, SequenceError

if TYPE_CHECKING:
    from adversarial_lcd_ros.sequences.inspection import BagSummary

IMAGES = ('sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage')


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(commands, 'inspect', 'Print what a recording, a payload or a results '
                         'folder holds.', _inspect)
    parser.add_argument('path', type=Path, help='recording of any form that "import" reads, a '
                        'file with the payload of one message, or a results folder')
    add_json_option(parser)
    add_source_options(parser)


def _inspect(options: Namespace) -> None:
    from adversarial_lcd_ros.errors import SequenceError
    from adversarial_lcd_ros.evaluation.kinds import is_results
    from adversarial_lcd_ros.sequences.bagfile import is_bag

    path, given = options.path, source_options(options)
    if not path.exists():
        raise SequenceError(f'there is no file or folder {path}')
    if is_results(path):
        _show_results(path, as_json=options.json)
    elif is_bag(path):
        _show_bag(path, given, as_json=options.json)
    elif path.is_file():
        _show_file(path, given, as_json=options.json)
    else:
        _show_sequence(path, given, as_json=options.json)


def _show_results(folder: Path, *, as_json: bool) -> None:
    from adversarial_lcd_ros.evaluation.kinds import open_results

    kind, results = open_results(folder)
    if as_json:
        print_json({'folder': str(folder), **results.summary,
                    'configuration': results.configuration, 'environment': results.environment})
        return
    print(f'{folder}: results of the kind "{kind.name}", {len(results.rows)} rows, by '
          f'{results.environment.get("code")}, {results.environment.get("time_utc")}')
    for table in kind.tables(results):
        print_rows(table.title, table.rows)


def _show_bag(path: Path, given: Mapping[str, Any], *, as_json: bool) -> None:
    from adversarial_lcd_ros.sequences.inspection import inspect_bag, inspect_sequence

    bag, frames = inspect_bag(path), {}
    if any(topic.type in IMAGES for topic in bag.topics):
        try:
            frames = inspect_sequence(path, **given)
        except SequenceError as error:
            # What the bag holds is shown: this is what an import would say.
            frames = {'import': str(error)}
    if as_json:
        print_json({**asdict(bag), 'path': str(bag.path), **frames})
        return
    _print_bag(bag)
    _print_words(frames)


def _show_file(path: Path, given: Mapping[str, Any], *, as_json: bool) -> None:
    from adversarial_lcd_ros.sequences.inspection import inspect_payload, payload_values

    try:
        name, content = inspect_payload(path)
    except CodecError:
        # A film, perhaps; where it is no sequence either, what it is no payload of is said.
        try:
            _show_sequence(path, given, as_json=as_json)
        except SequenceError:
            pass
        else:
            return
        raise
    if as_json:
        print_json({'message': name, **payload_values(content)})
    else:
        _show_payload(name, content)


def _show_sequence(path: Path, given: Mapping[str, Any], *, as_json: bool) -> None:
    from adversarial_lcd_ros.sequences.inspection import inspect_sequence

    words = inspect_sequence(path, **given)
    if as_json:
        print_json({'path': str(path), **words})
        return
    print(path)
    _print_words(words)


def _print_words(words: Mapping[str, str]) -> None:
    for what, text in words.items():
        print(f'{what}: {text}')


def _print_bag(bag: BagSummary) -> None:
    from rich.table import Table

    console = make_console()
    topics = Table('topic', 'type', 'messages', 'payload')
    graphs = Table('topic', 'nodes n', 'edges m', 'objects',
                   title='graphs: mean (least to largest)', title_justify='left')
    for topic in bag.topics:
        topics.add_row(topic.name, topic.type, str(topic.count), topic.payload)
        if topic.graphs:
            sizes = (topic.graphs.nodes, topic.graphs.edges, topic.graphs.objects)
            graphs.add_row(topic.name, *(f'{mean:.1f} ({least:.0f} to {largest:.0f})'
                                         for least, mean, largest in sizes))
    # The title of a table would be broken into lines, and a path be of no use.
    print(f'{bag.path}: {bag.duration_s:.1f} s')
    console.print(topics)
    if graphs.row_count:
        console.print(graphs)


def _show_payload(name: str, content: Any) -> None:
    from adversarial_lcd_ros.graph import MultiTierGraph

    console = make_console()
    graph = content if isinstance(content, MultiTierGraph) else getattr(content, 'graph', None)
    if graph is None:
        console.print(content, soft_wrap=True)
        return
    number = f' {content.id}' if graph is not content else ''
    console.print(f'{name}{number}: n = {graph.node_count}, m = {graph.edge_count}, '
                  f'{graph.found_objects} objects{" and the scene" if graph.has_scene else ""}, '
                  f'{graph.width} x {graph.height} pixels, '
                  f'sequence {graph.sequence}, stamp {graph.stamp_ns} ns, frame '
                  f'{graph.frame_id!r}', soft_wrap=True)
