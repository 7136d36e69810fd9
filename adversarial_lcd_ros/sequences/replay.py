# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Bags in and out of the pipeline, without ROS: messages stay the bytes that they are.

``Replay`` gives the frames of a bag, and the ground truth beside them, in the order and with
the stamps of a replay; ``BagRecorder`` keeps what comes of them; ``read_payloads`` reads it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
import heapq
from pathlib import Path
import threading
from types import TracebackType
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import ReplayConfig
from adversarial_lcd_ros.errors import CodecError, SequenceError
from adversarial_lcd_ros.messages.codec import MESSAGES, schema_text
from adversarial_lcd_ros.messages.payload import (
    PAYLOAD_TYPES,
    WIRE_TYPE,
    bag_type,
    payload_of,
    wrap,
)
from adversarial_lcd_ros.paths import PACKAGE
from adversarial_lcd_ros.sequences.bagfile import POSE, BagFile, BagWriter
from adversarial_lcd_ros.sequences.bags import camera_topics, described_topics
from adversarial_lcd_ros.sequences.cdr import cdr_stamp_ns, with_cdr_stamp
from adversarial_lcd_ros.sequences.sequence import check_order
from adversarial_lcd_ros.sequences.stamps import frame_stamps

if TYPE_CHECKING:
    from typing_extensions import Self

MessageT = TypeVar('MessageT')

# Graphs to replay where a bag has no images; the clean ones are what came before any attack.
GRAPH_TOPICS = ('graph_clean', 'graph')
DETECTIONS_TOPIC = 'detections'


class Replay:
    """
    The messages of one replay of a bag, in order.

    Frames are the camera images; in a bag without any, the graphs on graph_clean, else on
    graph. Of the rest poses (ground truth) and detections (of the user's own detector) are
    replayed: what the pipeline itself has published, and /clock, would meet the pipeline's own.

    Iterating gives (topic, message type, stamp in nanoseconds, CDR). The stamp is that of the
    message's header. When a replay loops, the stamps in the messages go on rising.

    Parameters
    ----------
    path : Path
        A rosbag2: its folder, or its .mcap or .db3 file.
    config : ReplayConfig
        start_s and duration_s count from the first frame; stride leaves out frames and nothing
        else.

    Attributes
    ----------
    topics : dict of str to str
        What is replayed: topic to message type, as over the wire.
    frame_topics : tuple of str
        The topic of the frames.
    frame_count : int
        Frames of the whole replay, loops included.
    first_ns : int
        Stamp of the bag's first frame.

    Raises
    ------
    SequenceError
        The bag is missing, truncated, out of order, or has no frames, or frames on several
        topics, or is one of ROS 1; or start, duration and stride leave no frame.

    """

    def __init__(self, path: Path, config: ReplayConfig) -> None:
        self._path, self._config = Path(path), config
        with BagFile(self._path) as bag:
            if bag.is_ros1:
                raise SequenceError(f'{path} is a bag of ROS 1: make one of ROS 2 with '
                                    '"adversarial-lcd import"')
            self._frame_topic = _frame_topic(bag)
            self._beside = [*bag.of_type(POSE), *(topic for topic in bag.payload_topics()
                                                  if _name(topic) == DETECTIONS_TOPIC)]
            self._types = {topic: bag.topics[topic]
                           for topic in (self._frame_topic, *self._beside)}
            self.topics = {topic: WIRE_TYPE if kind in PAYLOAD_TYPES else kind
                           for topic, kind in self._types.items()}
            self.frame_topics = (self._frame_topic,)
            stamps = _frame_stamps(bag, self._frame_topic)
        self.first_ns = int(stamps[0])
        self._select(stamps)
        self.frame_count = len(self._kept) * config.loop

    def _select(self, stamps: NDArray[np.int64]) -> None:
        config = self._config
        self._first_ns = int(stamps[0]) + round(config.start_s * 1e9)
        self._end_ns = int(stamps[-1]) + 1
        if config.duration_s:
            self._end_ns = min(self._end_ns, self._first_ns + round(config.duration_s * 1e9))
        kept = stamps[(stamps >= self._first_ns) & (stamps < self._end_ns)][::config.stride]
        if not len(kept):
            raise SequenceError(
                f'no frame of {self._path} is left: it lasts {(stamps[-1] - stamps[0]) / 1e9:g} s,'
                f' and {config.duration_s or "all"} s from {config.start_s:g} s on are asked for')
        self._kept = set(kept.tolist())
        gap_ns = int(np.median(np.diff(kept))) if len(kept) > 1 else 1_000_000_000
        self._period_ns = self._end_ns - self._first_ns + gap_ns

    def __iter__(self) -> Iterator[tuple[str, str, int, bytes]]:
        for loop in range(self._config.loop):
            for topic, stamp_ns, wire in self._once():
                kind = self.topics[topic]
                if loop:
                    stamp_ns += loop * self._period_ns
                    wire = _with_stamp(kind, wire, stamp_ns)
                yield topic, kind, stamp_ns, wire

    def _once(self) -> Iterator[tuple[str, int, bytes]]:
        # Bags are in order of arrival, a replay in order of the stamps: /clock must not go back.
        with BagFile(self._path) as bag:
            beside = [self._row(topic, wire) for topic, _, wire in bag.messages(self._beside)]
            kept = (row for row in beside if self._first_ns <= row[1] < self._end_ns)
            yield from heapq.merge(sorted(kept, key=lambda row: row[1]), self._frames(bag),
                                   key=lambda row: row[1])

    def _frames(self, bag: BagFile) -> Iterator[tuple[str, int, bytes]]:
        for topic, _, wire in bag.messages([self._frame_topic]):
            row = self._row(topic, wire)
            if row[1] in self._kept:
                yield row

    def _row(self, topic: str, wire: bytes) -> tuple[str, int, bytes]:
        """Return topic, stamp and the message as it goes over the wire."""
        kind = self._types[topic]
        typed = kind in PAYLOAD_TYPES and kind != WIRE_TYPE
        return topic, _stamp_ns(kind, wire), wrap(wire) if typed else wire


def _frame_topic(bag: BagFile) -> str:
    cameras = camera_topics(bag)
    if len(cameras) > 1:
        raise SequenceError(f'bag {bag.path} has images on {", ".join(cameras)}: make a bag of '
                            'one with "adversarial-lcd import"')
    if cameras:
        return cameras[0]
    graphs = {_name(topic): topic for topic in bag.payload_topics()}
    for name in GRAPH_TOPICS:
        if name in graphs:
            return graphs[name]
    raise SequenceError(f'bag {bag.path} has neither images of a camera nor graphs to replay; it '
                        f'has {described_topics(bag)}')


def _frame_stamps(bag: BagFile, topic: str) -> NDArray[np.int64]:
    kind = bag.topics[topic]
    rows = [(_stamp_ns(kind, wire), log_ns) for _, log_ns, wire in bag.messages([topic])]
    headers = [stamp for stamp, _ in rows]
    if kind in PAYLOAD_TYPES:
        # What the pipeline recorded itself may be faster than its stamps.
        return check_order(headers, bag.path)
    return frame_stamps(headers, [log for _, log in rows], bag.path)


def _name(topic: str) -> str:
    return topic.rsplit('/', 1)[-1]


def _stamp_ns(message_type: str, wire: bytes) -> int:
    return cdr_stamp_ns(_payload(message_type, wire) if message_type in PAYLOAD_TYPES else wire)


def _with_stamp(message_type: str, wire: bytes, stamp_ns: int) -> bytes:
    if message_type != WIRE_TYPE:
        return with_cdr_stamp(wire, stamp_ns)
    return wrap(with_cdr_stamp(_payload(message_type, wire), stamp_ns))


def _payload(message_type: str, wire: bytes) -> bytes:
    try:
        return payload_of(message_type, wire)
    except CodecError as error:
        raise SequenceError(str(error)) from error


def read_payloads(path: Path, topic: str) -> Iterator[tuple[int, bytes]]:
    """
    Yield (log time in nanoseconds, payload) of a topic of payloads, typed or as over the wire.

    A missing slash in front of the topic does not matter.

    Raises
    ------
    SequenceError
        The bag is missing or truncated, or has no such topic.

    """
    with BagFile(Path(path)) as bag:
        name = f'/{topic.strip("/")}'
        if bag.topics.get(name) not in PAYLOAD_TYPES:
            there = ', '.join(bag.payload_topics()) or 'none'
            raise SequenceError(f'bag {path} has no payloads on {name}; topics with payloads: '
                                f'{there}')
        for _, log_ns, wire in bag.messages([name]):
            yield log_ns, _payload(bag.topics[name], wire)


def read_messages(path: Path, topic: str,
                  decode: Callable[[bytes], MessageT]) -> list[MessageT]:
    """
    Return what a function makes of all payloads of a topic.

    Raises
    ------
    SequenceError
        As ``read_payloads``.
    CodecError
        The function refuses a payload; the bag and the message are named.

    """
    return list(decoded(path, topic, (payload for _, payload in read_payloads(path, topic)),
                        decode))


def decoded(path: Path, topic: str, payloads: Iterable[bytes],
            decode: Callable[[bytes], MessageT]) -> Iterator[MessageT]:
    """Yield what a function makes of payloads; its CodecError names the message, too."""
    for number, payload in enumerate(payloads):
        try:
            message = decode(payload)
        except CodecError as error:
            where = f'bag {path}, message {number} on {topic}'
            raise CodecError(f'{where}: {error}', cause=error.cause) from error
        yield message


def payload_schemas() -> dict[str, str]:
    """Return the .msg texts of the payloads by their names, for the metadata of a bag."""
    return {f'{PACKAGE}/msg/{message}': schema_text(message) for message in MESSAGES}


class BagRecorder:
    """
    Writes messages to a rosbag2 (MCAP), from any thread; the bag appears on ``close``.

    Log times ascend: a message whose stamp does not follow the last one is logged one
    nanosecond after it, so that a bag reads in the order in which it was written. Payloads are
    written as messages of their own types, and the .msg texts with their comments go into the
    metadata: a recording explains itself, years later too.

    Raises
    ------
    SequenceError
        The bag exists already, or the place cannot be written.

    """

    def __init__(self, path: Path) -> None:
        schemas = payload_schemas()
        writer = BagWriter(Path(path))
        for message, text in schemas.items():
            writer.note(message, text)
        self._writer: BagWriter | None = writer
        self._lock = threading.Lock()
        self._last_ns = -1

    def write(self, topic: str, message_type: str, stamp_ns: int, cdr: bytes) -> None:
        """
        Write one message in CDR, as it goes over the wire.

        Raises
        ------
        SequenceError
            The recorder is closed, or a payload is wrapped in something else.

        """
        with self._lock:
            if self._writer is None:
                raise SequenceError(f'{topic}: the recording is closed')
            if message_type == WIRE_TYPE and bag_type(topic) != WIRE_TYPE:
                message_type, cdr = bag_type(topic), _payload(message_type, cdr)
            self._last_ns = max(stamp_ns, self._last_ns + 1)
            self._writer.write(f'/{topic.strip("/")}', message_type, self._last_ns, cdr)

    def close(self) -> None:
        """Complete the bag; closing twice does nothing."""
        with self._lock:
            writer, self._writer = self._writer, None
            if writer is not None:
                writer.close()

    def abort(self) -> None:
        """Throw the recording away."""
        with self._lock:
            writer, self._writer = self._writer, None
            if writer is not None:
                writer.abort()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if error is None:
            self.close()
        else:
            self.abort()
