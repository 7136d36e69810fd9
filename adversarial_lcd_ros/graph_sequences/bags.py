# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Graphs into a bag, for replays without images: ``adversarial-lcd build``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
import heapq
import json
from pathlib import Path

from adversarial_lcd_ros import __version__
from adversarial_lcd_ros.config import BuilderConfig
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.graph_sequences.opening import GraphSequence, open_graphs
from adversarial_lcd_ros.messages.codec import encode_graph
from adversarial_lcd_ros.messages.payload import bag_type
from adversarial_lcd_ros.sequences.bagfile import BagWriter
from adversarial_lcd_ros.sequences.companions import companions_of
from adversarial_lcd_ros.sequences.importing import pose_messages
from adversarial_lcd_ros.sequences.part import SequencePart
from adversarial_lcd_ros.sequences.replay import payload_schemas
from adversarial_lcd_ros.sequences.sequence import Progress

# What the detector hears, and what goes to an attacker first.
GRAPH_TOPIC, CLEAN_TOPIC = '/graph', '/graph_clean'
PROVENANCE = 'adversarial_lcd_ros/build'


@dataclass(frozen=True)
class GraphBagSummary:
    """What a build has written."""

    path: Path
    graphs: GraphSequence
    poses: int
    size_bytes: int


def build_graph_bag(source: str, destination: Path, config: BuilderConfig, *,
                    cache: Path | None = None, progress: Progress | None = None,
                    overwrite: bool = False) -> GraphBagSummary:
    """
    Write the graphs of a sequence, and its ground truth, as a rosbag2 in MCAP.

    Graphs become adversarial_lcd_ros/msg/MultiTierGraph on /graph. The settings that they were
    built with, and the schemas of the payloads, go into the metadata; credits and licence files
    of a source folder, and what tells labels what its views share, go with what was made of the
    pictures.

    Parameters
    ----------
    source, config, cache, progress
        See ``open_graphs``.
    destination : Path
        Folder of the bag; it appears when it is complete, or not at all.
    overwrite : bool
        Replace a bag that is there.

    Raises
    ------
    SequenceError
        The destination exists; or see ``open_graphs``.

    """
    # Before the minutes of work, to see whether the place is free.
    with BagWriter(destination, overwrite=overwrite) as bag:
        path = SequencePart.parse(source).path
        beside = companions_of(path) if path.exists() else []
        found = open_graphs(source, config, cache, progress)
        bag.note(PROVENANCE, json.dumps({
            'source': source, 'name': found.name, 'settings': asdict(config),
            'version': __version__}))
        poses = write_graphs(bag, found)
        for file in beside:
            bag.attach(file)
    return GraphBagSummary(destination, found, poses,
                           sum(file.stat().st_size for file in destination.iterdir()))


def write_graphs(bag: BagWriter, found: GraphSequence, topic: str = GRAPH_TOPIC) -> int:
    """Write graphs, and the ground truth of their time, to a bag; return the number of poses."""
    for message, text in payload_schemas().items():
        bag.note(message, text)
    stamps = [graph.stamp_ns for graph in found.graphs]
    poses = list(pose_messages(found.trajectory, stamps[0], stamps[-1]))
    # At the same time, the pose comes first: the key sorts by nothing else.
    for name, kind, stamp_ns, cdr in heapq.merge(poses, _graph_messages(found.graphs, topic),
                                                 key=lambda row: row[2]):
        bag.write(name, kind, stamp_ns, cdr)
    return len(poses)


def _graph_messages(graphs: list[MultiTierGraph],
                    topic: str) -> Iterator[tuple[str, str, int, bytes]]:
    for graph in graphs:
        yield topic, bag_type(GRAPH_TOPIC), graph.stamp_ns, encode_graph(graph)
