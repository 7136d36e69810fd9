# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a bag or a single payload holds."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
import math
from pathlib import Path
from typing import Any

import numpy as np

from adversarial_lcd_ros.errors import CodecError, FileError
from adversarial_lcd_ros.files.reading import read_bytes
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.payload import PAYLOAD_TYPES, payload_of
from adversarial_lcd_ros.sequences.bagfile import BagFile
from adversarial_lcd_ros.sequences.opening import open_sequence
from adversarial_lcd_ros.sequences.replay import decoded

_DECODERS: Mapping[str, Callable[[bytes], Any]] = {
    'MultiTierGraph': codec.decode_graph,
    'LoopClosure': codec.decode_loop_closure,
    'LcdQuery': codec.decode_query,
    'LcdAnswer': codec.decode_answer,
    'AttackReport': codec.decode_attack_report,
    'Detections': codec.decode_detections,
}


@dataclass(frozen=True)
class GraphSizes:
    """
    Sizes of graphs.

    Attributes
    ----------
    nodes, edges, objects : (float, float, float)
        Least, mean and largest number of nodes n, undirected edges m, and tier-0 nodes.

    """

    nodes: tuple[float, float, float]
    edges: tuple[float, float, float]
    objects: tuple[float, float, float]

    @classmethod
    def of(cls, graphs: Iterable[MultiTierGraph]) -> GraphSizes:
        """Return the statistics of at least one graph; none of them is kept."""
        sizes = np.array([(graph.node_count, graph.edge_count, graph.found_objects)
                          for graph in graphs], np.float64)
        spans = np.stack([sizes.min(0), sizes.mean(0), sizes.max(0)], axis=1).tolist()
        return cls(*(tuple(span) for span in spans))


@dataclass(frozen=True)
class TopicSummary:
    """
    One topic of a bag.

    Attributes
    ----------
    payload : str
        Message of msg_schemas that its byte arrays hold; '' if none.
    graphs : GraphSizes or None
        Of all graphs of the topic, where it carries graphs.

    """

    name: str
    type: str
    count: int
    payload: str = ''
    graphs: GraphSizes | None = None


@dataclass(frozen=True)
class BagSummary:
    """Topics of a bag and its duration, seconds."""

    path: Path
    duration_s: float
    topics: tuple[TopicSummary, ...]


def inspect_bag(path: Path) -> BagSummary:
    """
    Return what is in a ROS 1 bag, a rosbag2 folder, or a single .mcap or .db3 file.

    Raises
    ------
    SequenceError
        There is no such bag, or it is truncated or damaged.
    CodecError
        A topic that starts with a graph goes on with something else.

    """
    with BagFile(path) as bag:
        return BagSummary(path, bag.duration_s,
                          tuple(_topic(bag, name) for name in sorted(bag.topics)))


def inspect_sequence(path: Path, **options: Any) -> dict[str, str]:
    """
    Return what an import of a recording would give, in words.

    Parameters
    ----------
    path : Path
    **options
        See ``open_sequence``.

    Raises
    ------
    SequenceError
        It cannot be opened.

    """
    sequence = open_sequence(path, **options)
    stamps = sequence.stamps_ns
    gap_s = np.diff(stamps) / 1e9
    width, height = sequence.image_size
    words = {'frames': f'{sequence.frame_count} of {width} x {height} pixels',
             'time': f'{float(stamps[-1] - stamps[0]) / 1e9:.1f} s'}
    if len(gap_s):
        words['between frames'] = f'{np.median(gap_s):.3f} s (longest {gap_s.max():.3f} s)'
    return {**words, 'ground truth': str(sequence.coverage)}


def _topic(bag: BagFile, name: str) -> TopicSummary:
    kind, count = bag.topics[name], bag.counts[name]
    if kind not in PAYLOAD_TYPES or not count:
        return TopicSummary(name, kind, count)
    payload, _ = identify_payload(next(_payloads(bag, name)))
    if payload != 'MultiTierGraph':
        return TopicSummary(name, kind, count, payload)
    statistics = GraphSizes.of(decoded(bag.path, name, _payloads(bag, name), codec.decode_graph))
    return TopicSummary(name, kind, count, payload, statistics)


def _payloads(bag: BagFile, name: str) -> Iterator[bytes]:
    for topic, _, wire in bag.messages([name]):
        yield payload_of(bag.topics[topic], wire)


def identify_payload(data: bytes) -> tuple[str, Any]:
    """Return which message of msg_schemas a payload is, and what it says; ('', None) if none."""
    for name, decode in _DECODERS.items():
        try:
            return name, decode(data)
        except CodecError:
            continue
    return '', None


def inspect_payload(path: Path) -> tuple[str, Any]:
    """
    Return which message of msg_schemas a file holds, and what it says.

    Raises
    ------
    CodecError
        The file cannot be read, is too large, or is none of the messages.

    """
    try:
        name, content = identify_payload(read_bytes(path, codec.MAX_PAYLOAD_BYTES))
    except FileError as error:
        raise CodecError(str(error)) from error
    if not name:
        raise CodecError(f'{path} is neither a bag nor a payload of '
                         f'{", ".join(codec.MESSAGES)}{_nearly(path.read_bytes())}')
    return name, content


def payload_values(content: Any) -> dict[str, Any]:
    """Return what a payload says, ready for JSON; of a graph its sizes, of descriptors nothing."""
    if isinstance(content, MultiTierGraph):
        return {'nodes': content.node_count, 'edges': content.edge_count,
                'objects': content.found_objects, 'has_scene': content.has_scene,
                'width': content.width, 'height': content.height, 'sequence': content.sequence,
                'stamp_ns': content.stamp_ns, 'frame_id': content.frame_id}
    values = {entry.name: getattr(content, entry.name) for entry in fields(content)}
    return {name: payload_values(value) if isinstance(value, MultiTierGraph)
            else value.tolist() if isinstance(value, np.ndarray)
            # JSON has no word for the log odds of certainty.
            else None if value in (math.inf, -math.inf) else value
            for name, value in values.items()}


def _nearly(data: bytes) -> str:
    """Tell why the message was refused whose layout the data have, if they have one's."""
    for name, decode in _DECODERS.items():
        try:
            decode(data)
        except CodecError as error:
            if error.cause not in (CodecError.cause, 'version', 'counts'):
                return f'; read as {name}: {error}'
    return ''
