"""adversarial-lcd inspect: what a bag, a payload or a results folder holds."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from adversarial_lcd_ros.commands.common import (
    Commands,
    add_command,
    add_json_option,
    make_console,
    print_json,
    print_rows,
)

if TYPE_CHECKING:
    from adversarial_lcd_ros.sequences.inspection import BagSummary


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(commands, 'inspect', 'Print what a bag, a payload or a results folder '
                         'holds.', _inspect)
    parser.add_argument('path', type=Path, help='rosbag2 folder, .mcap, .db3 or .bag file, a file '
                        'with the payload of one message, or a results folder')
    add_json_option(parser)


def _inspect(options: Namespace) -> None:
    from adversarial_lcd_ros.evaluation.kinds import is_results
    from adversarial_lcd_ros.sequences.bagfile import is_bag
    from adversarial_lcd_ros.sequences.inspection import (
        inspect_bag,
        inspect_payload,
        payload_values,
    )

    if is_results(options.path):
        _show_results(options.path, as_json=options.json)
    elif options.path.is_file() and not is_bag(options.path):
        name, content = inspect_payload(options.path)
        if options.json:
            print_json({'message': name, **payload_values(content)})
        else:
            _show_payload(name, content)
    else:
        bag = inspect_bag(options.path)
        if options.json:
            print_json({**asdict(bag), 'path': str(bag.path)})
        else:
            _show_bag(bag)


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


def _show_bag(bag: BagSummary) -> None:
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
                  f'{graph.object_count} objects, {graph.width} x {graph.height} pixels, '
                  f'sequence {graph.sequence}, stamp {graph.stamp_ns} ns, frame '
                  f'{graph.frame_id!r}', soft_wrap=True)
