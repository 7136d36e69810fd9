# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings of the nodes as any reader of MCAP understands them: ``adversarial-lcd convert``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from adversarial_lcd_ros.errors import CodecError, SequenceError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.payload import payload_of
from adversarial_lcd_ros.paths import PACKAGE
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.sequences.bagfile import BagFile, BagWriter
from adversarial_lcd_ros.sequences.bags import camera_topics
from adversarial_lcd_ros.sequences.frame import JPEG, Frame
from adversarial_lcd_ros.sequences.importing import image_message
from adversarial_lcd_ros.sequences.inspection import identify_payload
from adversarial_lcd_ros.sequences.replay import payload_schemas
from adversarial_lcd_ros.sequences.sequence import Progress
from adversarial_lcd_ros.vision.views import Views

VIEW_TOPIC = '/view/compressed'
# Message to what reads it, of this and of earlier versions, and what writes it.
_CODECS: Mapping[str, tuple[Callable[[bytes], Any], Callable[[Any], bytes]]] = {
    'MultiTierGraph': (codec.decode_graph, codec.encode_graph),
    'LoopClosure': (codec.decode_loop_closure, codec.encode_loop_closure),
    'AttackReport': (codec.decode_attack_report, codec.encode_attack_report),
    'LcdQuery': (codec.decode_query, codec.encode_query),
    'LcdAnswer': (codec.decode_answer, codec.encode_answer),
    'Detections': (codec.decode_detections, codec.encode_detections)}


@dataclass(frozen=True)
class Conversion:
    """
    What a conversion has written.

    Attributes
    ----------
    path : Path
    messages : dict of str to int
        By topic.
    notes : list of str
        What was left out, and why.

    """

    path: Path
    messages: dict[str, int]
    notes: list[str]


def convert_recording(source: Path, destination: Path, frames: Path | None = None, *,
                      progress: Progress | None = None, overwrite: bool = False) -> Conversion:
    """
    Write a recording of the nodes anew: typed, with camera frames, and a picture a decision.

    Payloads become messages of their own types and of the newest version, whose definitions are
    in the bag. Where there are camera frames, each decision gets a picture on /view/compressed:
    the frame with the graph that the detector got, flipped edges red, the matched keyframe, the
    verdict and why. All other messages stay what they are.

    Parameters
    ----------
    source : Path
        A rosbag2, recorded by bag_replay or by "ros2 bag record".
    destination : Path
        Folder of the bag; it appears when it is complete, or not at all.
    frames : Path, optional
        The sequence that was replayed, where the recording has no camera frames.
    progress : callable, optional
        Called with (messages done, messages in all).
    overwrite : bool
        Replace a bag that is there.

    Raises
    ------
    SequenceError
        The source is missing, damaged, of ROS 1 or holds no payloads, or the destination exists.

    """
    with BagFile(source) as bag:
        payloads = {} if bag.is_ros1 else {
            topic: _message_of(bag, topic) for topic in bag.payload_topics()}
        if not any(payloads.values()):
            raise SequenceError(f'{source} is no recording of the nodes: expected graphs or '
                                f'decisions, found {", ".join(sorted(bag.topics)) or "nothing"}')
        cameras = camera_topics(bag)
        views = Views(attacked={'graph_clean', 'attack_report'} <= set(map(_name, payloads)))
    pictures = _Pictures(None if frames is None and not cameras else
                         source if frames is None else frames)
    with BagWriter(destination, overwrite=overwrite) as writer:
        for message, text in payload_schemas().items():
            writer.note(message, text)
        work = _Work(payloads, pictures, views, writes_frames=not cameras)
        with BagFile(source) as bag:
            work.copy(bag, writer, progress)
    return Conversion(destination, dict(work.written), work.notes())


def _name(topic: str) -> str:
    return topic.rsplit('/', 1)[-1]


def _message_of(bag: BagFile, topic: str) -> str:
    """Return the message of msg_schemas on a topic; empty: none."""
    first = next(iter(bag.messages([topic])))[2]
    try:
        return identify_payload(payload_of(bag.topics[topic], first))[0]
    except CodecError:
        return ''


class _Pictures:
    """The frames of a sequence by their stamps, which are asked for in order."""

    def __init__(self, source: Path | None) -> None:
        self._frames: Iterator[Frame] = iter(())
        self._stamps: set[int] = set()
        if source is not None:
            sequence = open_sequence(source, ground_truth='none')
            self._stamps, self._frames = set(sequence.stamps_ns.tolist()), sequence.frames()

    def up_to(self, stamp_ns: int) -> Iterator[Frame]:
        """Yield the frames that were not asked for yet, up to that of a stamp."""
        if stamp_ns not in self._stamps:
            return
        for frame in self._frames:
            self._stamps.discard(frame.stamp_ns)
            yield frame
            if frame.stamp_ns == stamp_ns:
                return


class _Work:
    """Copies message by message, and adds what a reader would look for."""

    def __init__(self, payloads: Mapping[str, str], pictures: _Pictures, views: Views, *,
                 writes_frames: bool) -> None:
        self._payloads, self._pictures, self._writes_frames = payloads, pictures, writes_frames
        self._views = views
        self.written: Counter[str] = Counter()
        self._left_out: Counter[str] = Counter()
        self._last_ns = -1

    def copy(self, bag: BagFile, writer: BagWriter, progress: Progress | None) -> None:
        """Write all that is in a bag."""
        total = sum(bag.counts.values())
        for done, (topic, log_ns, wire) in enumerate(bag.messages([*bag.topics]), 1):
            for row in self._rows(topic, bag.topics[topic], log_ns, wire):
                self._write(writer, *row)
            if progress:
                progress(done, total)

    def _write(self, writer: BagWriter, topic: str, kind: str, log_ns: int, cdr: bytes) -> None:
        # What is added comes at the time of what it belongs to, in order.
        self._last_ns = max(log_ns, self._last_ns + 1)
        try:
            writer.write(topic, kind, self._last_ns, cdr)
        except KeyError:
            self._left_out[f'{topic} (of type {kind}, whose definition is not known here)'] += 1
            return
        self.written[topic] += 1

    def _rows(self, topic: str, kind: str, log_ns: int,
              wire: bytes) -> Iterator[tuple[str, str, int, bytes]]:
        message = self._payloads.get(topic, '')
        if not message:
            if topic != VIEW_TOPIC:
                yield topic, kind, log_ns, wire
            return
        decode, encode = _CODECS[message]
        try:
            content = decode(payload_of(kind, wire))
        except CodecError:
            self._left_out[f'{topic} (unreadable)'] += 1
            return
        yield from self._frame_rows(content, log_ns)
        yield topic, f'{PACKAGE}/msg/{message}', log_ns, encode(content)
        view = self._view(_name(topic), content)
        if view is not None:
            added, kind, _, cdr = image_message(view, VIEW_TOPIC)
            yield added, kind, log_ns, cdr

    def _frame_rows(self, content: Any, log_ns: int) -> Iterator[tuple[str, str, int, bytes]]:
        """Yield the frames up to that of a graph, before it."""
        if not isinstance(content, MultiTierGraph):
            return
        for frame in self._pictures.up_to(content.stamp_ns):
            self._views.note_frame(frame)
            if self._writes_frames:
                topic, kind, _, cdr = image_message(frame.compressed(JPEG))
                yield topic, kind, log_ns, cdr

    def _view(self, name: str, content: Any) -> Frame | None:
        if name == 'graph_clean':
            return self._views.note_clean(content)
        if name == 'graph':
            return self._views.note_graph(content)
        if name == 'attack_report':
            return self._views.note_report(content)
        return self._views.note_decision(content) if name == 'loop_closures' else None

    def notes(self) -> list[str]:
        """Return what was left out."""
        return [f'left out: {count} messages on {what}'
                for what, count in sorted(self._left_out.items())]
