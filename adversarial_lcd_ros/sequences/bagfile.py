# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags on disk: read with checks, written so that a half-written one never looks finished."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
import os
from pathlib import Path
import shutil
import struct
import tempfile
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal

from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag2 import StoragePlugin, Writer, WriterError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from adversarial_lcd_ros.errors import AdversarialLcdError, SequenceError
from adversarial_lcd_ros.messages.codec import typestore
from adversarial_lcd_ros.messages.payload import PAYLOAD_TYPES
from adversarial_lcd_ros.sequences.cdr import cdr_stamp_ns, join_ns
from adversarial_lcd_ros.sequences.damage import METADATA, diagnose, missing_messages
from adversarial_lcd_ros.sequences.image_files import is_hidden
from adversarial_lcd_ros.sequences.rosbag2 import Rosbag2Reader

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.typesys.store import Typestore
    from typing_extensions import Self

IMAGE, COMPRESSED_IMAGE = 'sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage'
CAMERA_INFO = 'sensor_msgs/msg/CameraInfo'
POSE = 'geometry_msgs/msg/PoseStamped'
TF = 'tf2_msgs/msg/TFMessage'
# What /tf was called before tf2, as in the bags of the TUM RGB-D benchmark.
OLD_TF = ('tf/msg/tfMessage', 'tf/msg/TFMessage')
ROS1_SUFFIX = '.bag'
ROS2_SUFFIXES = ('.mcap', '.db3')
_NS = 1_000_000_000
_BAG_VERSION: Literal[9] = 9


def is_bag(path: Path) -> bool:
    """Tell whether a path looks like a bag: ROS 1 file, rosbag2 folder, or a rosbag2's file."""
    if path.is_dir():
        return (path / METADATA).is_file() or any(
            child.suffix in ROS2_SUFFIXES and not is_hidden(child) for child in path.iterdir())
    return path.suffix in (ROS1_SUFFIX, *ROS2_SUFFIXES)


@cache
def _ros1_typestore() -> Typestore:
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg('geometry_msgs/TransformStamped[] transforms', TF))
    return store


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Turn whatever a damaged bag breaks into one SequenceError."""
    try:
        yield
    except AdversarialLcdError:
        raise
    except Exception as error:
        # A damaged bag can break anything in the reader: no list of classes is complete.
        detail = ' '.join((str(error) or type(error).__name__).split())
        raise SequenceError(f'bag {path} cannot be read: {_diagnosis(path, detail)}') from error


def _diagnosis(path: Path, detail: str) -> str:
    try:
        return diagnose(path, detail)
    except OSError as error:
        return f'{detail} ({error})'


class BagFile:
    """
    A bag of ROS 1 (.bag) or ROS 2 (folder, .mcap, .db3), open for reading.

    Only standard messages are decoded, by their published definitions: whatever else a bag
    holds, also of types unknown here, does not get in the way.

    Attributes
    ----------
    path : Path
    topics : dict of str to str
        Topic to message type (as in ROS 2: sensor_msgs/msg/Image).
    counts : dict of str to int
        Messages by topic, as the index of the bag says.
    is_ros1 : bool

    Raises
    ------
    SequenceError
        The bag is missing, truncated or damaged.

    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.exists():
            raise SequenceError(f'there is no bag {path}')
        self.is_ros1 = path.is_file() and path.suffix == ROS1_SUFFIX
        self._types = _ros1_typestore() if self.is_ros1 else typestore()
        with _explained(path):
            self._reader: Any = Reader1(path) if self.is_ros1 else Rosbag2Reader(path)
            self._reader.open()
            connections: Sequence[Connection] = self._reader.connections
            self.topics = {entry.topic: entry.msgtype for entry in connections}
            self.counts = dict.fromkeys(self.topics, 0)
            for entry in connections:
                self.counts[entry.topic] += entry.msgcount

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self._reader.close()

    @property
    def duration_s(self) -> float:
        """Time from the first message to the last, seconds; 0 without messages."""
        with _explained(self.path):
            return float(self._reader.duration) / _NS if any(self.counts.values()) else 0.0

    def of_type(self, *types: str) -> list[str]:
        """Return the topics that hold messages of these types, sorted."""
        return sorted(topic for topic, kind in self.topics.items()
                      if kind in types and self.counts[topic])

    def payload_topics(self) -> list[str]:
        """Return the topics that hold payloads, typed or as over the wire, sorted."""
        return self.of_type(*PAYLOAD_TYPES)

    def messages(self, topics: Sequence[str]) -> Iterator[tuple[str, int, bytes]]:
        """
        Yield (topic, log time in nanoseconds, bytes) of all messages of some topics.

        Raises
        ------
        SequenceError
            The bag is damaged, or holds fewer messages than its index says.

        """
        chosen = [entry for entry in self._reader.connections if entry.topic in topics]
        if not chosen:
            return
        expected, found = sum(self.counts[topic] for topic in set(topics) & set(self.counts)), 0
        with _explained(self.path):
            for connection, log_ns, wire in self._reader.messages(connections=chosen):
                found += 1
                yield connection.topic, log_ns, bytes(wire)
        if found != expected:
            raise SequenceError(missing_messages(self.path, found, expected, ', '.join(topics)))

    def decode(self, topic: str, wire: bytes) -> Any:
        """Return the message in the bytes of a topic; raises SequenceError."""
        kind = TF if self.topics[topic] in OLD_TF else self.topics[topic]
        with _explained(self.path):
            return (self._types.deserialize_ros1(wire, kind) if self.is_ros1
                    else self._types.deserialize_cdr(wire, kind))

    def stamp_ns(self, wire: bytes) -> int:
        """Return the stamp of a message that starts with a header; raises SequenceError."""
        if not self.is_ros1:
            return cdr_stamp_ns(wire)
        if len(wire) < 12:
            raise SequenceError(f'bag {self.path}: a message of {len(wire)} bytes has no header')
        _, seconds, nanoseconds = struct.unpack_from('<III', wire)
        return join_ns(seconds, nanoseconds)


class BagWriter:
    """
    Writes a rosbag2 (MCAP) beside its place, and moves it there once it is complete.

    Until ``close`` there is only a hidden folder ``.<name>.*.partial`` beside the destination;
    ``abort``, or an error inside the ``with`` block, removes it.

    Raises
    ------
    SequenceError
        The destination exists (without ``overwrite`` always, with it if it is no bag), also
        where it has come into being by the time of ``close``; or it cannot be written.

    """

    def __init__(self, destination: Path, *, overwrite: bool = False) -> None:
        # What the name leads to stays a link: it is refused, and its target never replaced.
        self._destination = destination.parent.resolve() / destination.name
        self._overwrite = overwrite
        _check_free(self._destination, overwrite)
        with self._written():
            self._destination.parent.mkdir(parents=True, exist_ok=True)
            # mkdtemp makes a name of its own: two imports at once do not meet.
            self._folder = Path(tempfile.mkdtemp(
                prefix=f'.{self._destination.name}.', suffix='.partial',
                dir=self._destination.parent))
            # The MCAP file is named after its folder: the right name is one level further down.
            self._writer = Writer(self._folder / self._destination.name, version=_BAG_VERSION,
                                  storage_plugin=StoragePlugin.MCAP)
            self._writer.open()
        self._is_open = True
        self._connections: dict[str, Connection] = {}

    def write(self, topic: str, message_type: str, stamp_ns: int, cdr: bytes) -> None:
        """Write a message in CDR; its definition goes into the bag with the first of a topic."""
        with self._written():
            connection = self._connections.get(topic)
            if connection is None:
                connection = self._connections[topic] = self._writer.add_connection(
                    topic, message_type, typestore=typestore())
            self._writer.write(connection, stamp_ns, cdr)

    def note(self, key: str, text: str) -> None:
        """Put a text into the metadata (custom_data), both beside the MCAP file and inside it."""
        self._writer.set_custom_data(key, text)

    def attach(self, file: Path) -> None:
        """Put a copy of a file beside the bag's own."""
        with self._written():
            shutil.copyfile(file, self._writer.path / file.name)

    def close(self) -> None:
        """Complete the bag and move it to its place; where that fails, throw it away."""
        try:
            with self._written():
                self._stop(None)
                _check_free(self._destination, self._overwrite)
                self._move()
        except BaseException:
            self.abort()
            raise
        shutil.rmtree(self._folder)

    def _move(self) -> None:
        # Folders cannot be exchanged in one step: the old bag waits beside until the new one is
        # there, and goes back if that fails.
        replaced = self._folder.with_suffix('.replaced')
        try:
            if self._destination.exists():
                self._destination.rename(replaced)
            (self._folder / self._destination.name).rename(self._destination)
        except BaseException:
            if replaced.exists():
                replaced.rename(self._destination)
            raise
        shutil.rmtree(replaced, ignore_errors=True)

    def abort(self) -> None:
        """Throw the half-written bag away."""
        try:
            self._stop(SequenceError('the bag is thrown away'))
        finally:
            shutil.rmtree(self._folder, ignore_errors=True)

    def _stop(self, error: SequenceError | None) -> None:
        # Leaving the writer's context is what all versions of rosbags offer to stop early.
        if self._is_open:
            self._is_open = False
            self._writer.__exit__(None if error is None else type(error), error, None)

    @contextmanager
    def _written(self) -> Iterator[None]:
        try:
            yield
        except (OSError, WriterError) as error:
            raise SequenceError(f'bag {self._destination} cannot be written: {error}') from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if error is None:
            self.close()
        else:
            self.abort()


def _check_free(destination: Path, overwrite: bool) -> None:
    if destination.is_symlink():
        raise SequenceError(f'{destination} is a link to {os.readlink(destination)}: remove it, '
                            'or name the folder itself')
    if not destination.exists():
        return
    if not overwrite:
        raise SequenceError(f'{destination} exists already: remove it, give another name, or '
                            'replace it (--overwrite)')
    if not (destination / METADATA).is_file():
        raise SequenceError(f'{destination} exists and is no bag (it has no {METADATA}): it is '
                            'not overwritten')
