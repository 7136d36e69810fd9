# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reading rosbag2: whatever wrote its MCAP, whatever its metadata say of quality of service."""

from __future__ import annotations

from collections.abc import Collection, Generator
from pathlib import Path
from typing import IO, Any
from urllib.parse import quote

from mcap.reader import SeekingReader
from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
)
from rosbags.rosbag2 import Reader, ReaderError
from rosbags.rosbag2.metadata import ReaderMetadata
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from adversarial_lcd_ros.sequences.damage import unfinished_log

CDR = 'cdr'
# Messages do not hang on their topic's quality of service, nor on a hash of their type.
_PLAIN = ConnectionExtRosbag2(CDR, [])
_NO_DEFINITION = MessageDefinition(MessageDefinitionFormat.NONE, '')
_Messages = Generator[tuple[Connection, int, bytes], None, None]


class _SqliteStorage(Sqlite3Reader):
    """
    The storage of rosbags, which puts the path into a URI: a # or % in it would end it.

    Opened as it is, a database without its log would lack messages, and nothing would tell.
    """

    def __init__(self, path: Any) -> None:
        super().__init__(Path(quote(str(path.absolute()))))
        self._file = path

    def open(self) -> None:
        if unfinished_log(self._file) is not None:
            raise ReaderError('a part of it is in its log')
        super().open()


class _ForeignMcap:
    """
    An MCAP of another tool: without the profile ros2, or with channels that are not of ROS.

    The reader of rosbags refuses such files as a whole. Here, channels in another encoding than
    CDR are kept under a type that says so, and get in nobody's way.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.connections: list[Connection] = []
        self.metadata = ReaderMetadata(0, 2**63 - 1, 0, 0, None, None, None, None)

    def open(self) -> None:
        self._file: IO[bytes] = self.path.open('rb')
        self._reader = SeekingReader(self._file, validate_crcs=True,
                                     record_size_limit=self.path.stat().st_size)
        summary = self._reader.get_summary()
        # Without chunks that are indexed the library would sort by holding all in memory.
        self._is_indexed = summary is not None and bool(summary.chunk_indexes)
        if summary is None or summary.statistics is None or not summary.channels:
            self._scan()
            return
        statistics = summary.statistics
        self._describe(statistics.message_start_time, statistics.message_end_time, [
            (channel, summary.schemas.get(channel.schema_id),
             statistics.channel_message_counts.get(channel.id, 0))
            for channel in summary.channels.values()])

    def _scan(self) -> None:
        channels: dict[int, tuple[Any, Any]] = {}
        counts: dict[int, int] = {}
        first_ns, last_ns = 2**63 - 1, 0
        for schema, channel, message in self._reader.iter_messages(log_time_order=False):
            channels[channel.id] = channel, schema
            counts[channel.id] = counts.get(channel.id, 0) + 1
            first_ns = min(first_ns, message.log_time)
            last_ns = max(last_ns, message.log_time)
        self._describe(first_ns, last_ns, [
            (channel, schema, counts[key]) for key, (channel, schema) in channels.items()])

    def _describe(self, first_ns: int, last_ns: int,
                  channels: list[tuple[Any, Any, int]]) -> None:
        for channel, schema, count in channels:
            kind = 'no schema' if schema is None else schema.name
            if channel.message_encoding != CDR:
                kind = f'{kind} in {channel.message_encoding or "an unnamed encoding"}'
            self.connections.append(Connection(channel.id, channel.topic, kind, _NO_DEFINITION,
                                               '', count, _PLAIN, self))
        total = sum(entry.msgcount for entry in self.connections)
        self.metadata = ReaderMetadata(last_ns + 1 - first_ns if total else 0, first_ns,
                                       last_ns + 1, total, None, None, None, None)

    def messages(self, connections: Collection[Connection], start: int | None = None,
                 stop: int | None = None) -> _Messages:
        chosen = {entry.id: entry for entry in connections}
        for _, channel, message in self._reader.iter_messages(
                {entry.topic for entry in connections}, starting_at=start, ending_before=stop,
                log_time_order=self._is_indexed):
            if channel.id in chosen:
                yield chosen[channel.id], message.log_time, message.data

    def close(self) -> None:
        self._file.close()


class _McapStorage:
    """An MCAP, read by rosbags, or, where it is none of ROS alone, by MCAP's own library."""

    def __init__(self, path: Any) -> None:
        self._storage: McapReader | _ForeignMcap = McapReader(path)
        self.path = path

    def open(self) -> None:
        try:
            self._storage.open()
        except (KeyError, ReaderError) as error:
            # rosbags looks foreign schema encodings up in a table that lacks them.
            if isinstance(error, ReaderError) and 'rofile' not in str(error):
                raise
            self._storage = _ForeignMcap(self.path)
            self._storage.open()
        self.connections = self._storage.connections
        self.metadata = self._storage.metadata

    def messages(self, connections: Collection[Connection], start: int | None = None,
                 stop: int | None = None) -> _Messages:
        return self._storage.messages(connections, start, stop)

    def close(self) -> None:
        self._storage.close()


class _Folder(DirectoryReader):
    """
    A folder of files with metadata.yaml.

    rosbags takes only what both describe alike, down to the quality of service, which people
    edit and which two publishers of a topic have each of its own. Here, topic and type decide.
    Messages are counted in the files; where the metadata promise more, that number stays, so
    that what is missing is noticed.
    """

    STORAGE_PLUGINS = {'mcap': _McapStorage, 'sqlite3': _SqliteStorage}

    def open(self) -> None:
        super().open()
        promised: dict[tuple[str, str], int] = {}
        for entry in self.connections:
            key = entry.topic, entry.msgtype
            promised[key] = promised.get(key, 0) + entry.msgcount
        counts: dict[tuple[str, str], int] = dict.fromkeys(promised, 0)
        for storage in self.storages:
            storage.connections = [entry._replace(ext=_PLAIN, digest='')
                                   for entry in storage.connections]
            for entry in storage.connections:
                key = entry.topic, entry.msgtype
                counts[key] = counts.get(key, 0) + entry.msgcount
        self.connections = [
            Connection(number, topic, kind, _NO_DEFINITION, '',
                       max(count, promised.get((topic, kind), 0)), _PLAIN, self)
            for number, ((topic, kind), count) in enumerate(counts.items(), 1)]


class Rosbag2Reader(Reader):
    """The reader of rosbags, with the storages above."""

    STORAGE_PLUGINS = {'dir': _Folder, '.mcap': _McapStorage,
                       '.db3': _SqliteStorage}
