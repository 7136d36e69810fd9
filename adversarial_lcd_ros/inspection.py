"""What a bag or a single payload holds."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.rosbag1 import ReaderError as Rosbag1Error
from rosbags.rosbag2 import ReaderError as Rosbag2Error

from adversarial_lcd_ros import codec
from adversarial_lcd_ros.errors import CodecError, SequenceError
from adversarial_lcd_ros.graph import MultiTierGraph

PAYLOAD_TYPE = 'std_msgs/msg/UInt8MultiArray'
BAG_SUFFIXES = ('.bag', '.mcap', '.db3')
_DECODERS: Mapping[str, Callable[[bytes], Any]] = {
    'MultiTierGraph': codec.decode_graph,
    'LoopClosure': codec.decode_loop_closure,
    'LcdQuery': codec.decode_query,
    'LcdAnswer': codec.decode_answer,
    'AttackReport': codec.decode_attack_report,
}


@dataclass(frozen=True)
class GraphStatistics:
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
    def of(cls, graphs: Iterable[MultiTierGraph]) -> GraphStatistics:
        """Return the statistics of at least one graph; none of them is kept."""
        sizes = np.array([(graph.node_count, graph.edge_count, graph.object_count)
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
    graphs : GraphStatistics or None
        Of all graphs of the topic, where it carries graphs.

    """

    name: str
    type: str
    count: int
    payload: str = ''
    graphs: GraphStatistics | None = None


@dataclass(frozen=True)
class BagSummary:
    """Topics of a bag and its duration, seconds."""

    path: Path
    duration_s: float
    topics: tuple[TopicSummary, ...]


def is_bag(path: Path) -> bool:
    """Tell whether a path looks like a bag, and not like a payload."""
    return path.is_dir() or path.suffix in BAG_SUFFIXES


def inspect_bag(path: Path) -> BagSummary:
    """
    Return what is in a ROS 1 bag, a rosbag2 folder, or a single .mcap or .db3 file.

    Raises
    ------
    SequenceError
        There is no such bag, or it is damaged.
    CodecError
        A topic that starts with a graph goes on with something else.

    """
    if not path.exists():
        raise SequenceError(f'{path} does not exist: expected a bag')
    try:
        with AnyReader([path], default_typestore=codec.typestore()) as reader:
            topics = tuple(_topic(reader, name) for name in sorted(reader.topics))
            return BagSummary(path, reader.duration / 1e9 if reader.message_count else 0.0, topics)
    except (AnyReaderError, Rosbag1Error, Rosbag2Error) as error:
        raise SequenceError(f'{path} is no readable bag: {error}') from error


def _topic(reader: AnyReader, name: str) -> TopicSummary:
    info = reader.topics[name]
    kind = str(info.msgtype)
    if kind != PAYLOAD_TYPE or not info.msgcount:
        return TopicSummary(name, kind, info.msgcount)
    payload, _ = identify_payload(next(_payloads(reader, name)))
    if payload != 'MultiTierGraph':
        return TopicSummary(name, kind, info.msgcount, payload)
    statistics = GraphStatistics.of(codec.decode_graph(data) for data in _payloads(reader, name))
    return TopicSummary(name, kind, info.msgcount, payload, statistics)


def _payloads(reader: AnyReader, name: str) -> Iterator[bytes]:
    connections = [c for c in reader.connections if c.topic == name]
    for connection, _, raw in reader.messages(connections):
        message: Any = reader.deserialize(raw, connection.msgtype)
        yield message.data.tobytes()


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
        size = path.stat().st_size
        if size > codec.MAX_PAYLOAD_BYTES:
            raise CodecError(f'{path} has {size} bytes: a payload has at most '
                             f'{codec.MAX_PAYLOAD_BYTES}; bags end in {", ".join(BAG_SUFFIXES)}')
        name, content = identify_payload(path.read_bytes())
    except OSError as error:
        raise CodecError(f'{path} cannot be read: {error.strerror}') from error
    if not name:
        raise CodecError(f'{path} is neither a bag nor a payload of '
                         f'{", ".join(codec.MESSAGES)}')
    return name, content
