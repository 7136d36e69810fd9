# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The graphs of a sequence: what every evaluation without ROS starts from."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
import logging
import os
from pathlib import Path
import tempfile
from typing import TypeVar

import numpy as np

from adversarial_lcd_ros.config import BuilderConfig, ReplayConfig
from adversarial_lcd_ros.errors import ConfigError, EvaluationError, SequenceError
from adversarial_lcd_ros.files.digests import digest_of
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.graph_sequences.cache import cache_key, load_graphs, save_graphs
from adversarial_lcd_ros.messages.codec import decode_graph
from adversarial_lcd_ros.paths import cache_folder
from adversarial_lcd_ros.sequences import Sequence, Trajectory, open_sequence
from adversarial_lcd_ros.sequences.bagfile import COMPRESSED_IMAGE, IMAGE, BagFile, is_bag
from adversarial_lcd_ros.sequences.bags import bag_trajectory
from adversarial_lcd_ros.sequences.detections import read_detections
from adversarial_lcd_ros.sequences.frame import NO_PICTURE
from adversarial_lcd_ros.sequences.part import SequencePart
from adversarial_lcd_ros.sequences.replay import Replay, read_messages
from adversarial_lcd_ros.sequences.sequence import Progress
from adversarial_lcd_ros.sequences.yolo_labels import convert_labels
from adversarial_lcd_ros.vision.builder import GraphBuilder

FRAMES_AT_ONCE = 2
ItemT = TypeVar('ItemT')
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class GraphSequence:
    """
    The graphs of a sequence, or of a part of it.

    Attributes
    ----------
    name : str
        Of the sequence, and which of its frames.
    graphs : list of MultiTierGraph
        In order of time. Their sequence numbers are those of the frames in the whole sequence.
    trajectory : Trajectory or None
        Ground truth of the whole sequence; None where it has none.
    image_size : (int, int)
        Width and height, pixels.
    source : Path
        What it was opened from.

    """

    name: str
    graphs: list[MultiTierGraph]
    trajectory: Trajectory | None
    image_size: tuple[int, int]
    source: Path


def open_graphs(source: str, config: BuilderConfig | None = None, cache: Path | None = None,
                progress: Progress | None = None) -> GraphSequence:
    """
    Return the graphs of a sequence: read from its bag, from the cache, or built.

    Parameters
    ----------
    source : str
        ``PATH`` or ``PATH@FROM:TO``, a part of its frames (``PATH@0:0.5`` is the first half).
        The path is anything that ``open_sequence`` opens, or a bag with graphs in place of
        images, as "adversarial-lcd build" writes it: its graphs are taken as they are, those on
        graph_clean where there are any.
    config : BuilderConfig, optional
        How graphs are built; graphs of a bag stay what they are. A sequence of detections alone
        takes the detector 'csv', and reads its own unless others are named.
    cache : Path, optional
        Folder of graphs that were built before; by default one in the user's cache. Delete it
        whenever you like.
    progress : callable, optional
        Called with (frames done, frames in all).

    Raises
    ------
    SequenceError
        The source is missing or damaged, or the part holds no frame.
    ConfigError
        The detector needs pictures, or a file that is not named.
    ModelError
        The vocabulary or the object model is missing.
    EvaluationError
        The cache cannot be written.

    """
    part = SequencePart.parse(source)
    if holds_graphs(part.path):
        return _recorded_graphs(part)
    sequence = open_sequence(part.path)
    config = for_sequence(config or BuilderConfig(), sequence)
    numbers = part.numbers(sequence.frame_count)
    folder = cache_folder() / 'graphs' if cache is None else cache
    path = folder / f'{cache_key(sequence, numbers, config)}.npz'
    graphs = _cached(path)
    if graphs is None:
        graphs = list(build_graphs(sequence, config, numbers, progress))
        save_graphs(path, graphs)
    elif progress:
        progress(len(graphs), len(graphs))
    _warn_without_objects(sequence.name, graphs, config)
    return GraphSequence(_name(sequence.name, numbers, sequence.frame_count), graphs,
                         sequence.trajectory, sequence.image_size, part.path)


def build_graphs(sequence: Sequence, config: BuilderConfig, numbers: range | None = None,
                 progress: Progress | None = None) -> Iterator[MultiTierGraph]:
    """
    Build and yield the graphs of some frames in order, two frames at once.

    Parameters
    ----------
    sequence : Sequence
    config : BuilderConfig
    numbers : range, optional
        The frames; all of them if not given.
    progress : callable, optional
        Called with (frames done, frames in all).

    """
    numbers = range(sequence.frame_count) if numbers is None else numbers
    with GraphBuilder(for_sequence(config, sequence), FRAMES_AT_ONCE) as builder:
        begun = _begun(builder, sequence, numbers)
        for done, graph in enumerate(_held_back(begun, FRAMES_AT_ONCE - 1), 1):
            yield graph()
            if progress:
                progress(done, len(numbers))


def _begun(builder: GraphBuilder, sequence: Sequence,
           numbers: range) -> Iterator[Callable[[], MultiTierGraph]]:
    for number, frame in zip(numbers, sequence.frames(numbers.start, numbers.stop), strict=True):
        if frame.encoding == NO_PICTURE:
            yield partial(builder.build_objects, frame.stamp_ns, frame.width, frame.height,
                          sequence=number)
        else:
            yield builder.begin(frame.image(), frame.stamp_ns, sequence=number).graph


def _held_back(items: Iterable[ItemT], count: int) -> Iterator[ItemT]:
    """Yield an item only when so many after it have been taken, too."""
    waiting: deque[ItemT] = deque()
    for item in items:
        waiting.append(item)
        if len(waiting) > count:
            yield waiting.popleft()
    yield from waiting


def for_sequence(config: BuilderConfig, sequence: Sequence) -> BuilderConfig:
    """
    Return the settings with the detections of the sequence, where these are asked for.

    Raises
    ------
    ConfigError
        The frames have no pictures, but a network is to look at them.
    SequenceError
        No frame has detections: they are those of another sequence.

    """
    if sequence.detections and config.detector != 'csv':
        raise ConfigError(f'{sequence.source} has no pictures, only {sequence.detections.name}: '
                          f'expected the detector "csv", found "{config.detector}"')
    if config.detector != 'csv':
        return config
    if not config.detections and sequence.detections:
        return replace(config, detections=str(sequence.detections))
    if not config.detections:
        return config
    if Path(config.detections).is_dir():
        config = replace(config, detections=str(_converted(Path(config.detections), sequence)))
    _check_detections(config, sequence)
    return config


def _converted(labels: Path, sequence: Sequence) -> Path:
    """Return the labels of YOLO in a folder as CSV, which is named by its content."""
    folder = cache_folder() / 'detections'
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix='.labels-', dir=folder) as hidden:
            work = Path(hidden) / 'detections.csv'
            convert_labels(labels, sequence, work)
            path = folder / f'{digest_of(work.read_bytes())}.csv'
            os.replace(work, path)
    except OSError as error:
        raise EvaluationError(f'detections cannot be kept in {folder} ({error}): set '
                              'ADVERSARIAL_LCD_CACHE to another folder') from error
    return path


def _warn_without_objects(name: str, graphs: list[MultiTierGraph], config: BuilderConfig) -> None:
    if config.detector != 'none' and not any(graph.found_objects for graph in graphs):
        _log.warning('%s: the detector "%s" found no object in any of %d frames; look at the '
                     'settings model, object_score and min_object_area, or choose another '
                     'detector', name, config.detector, len(graphs))


def _check_detections(config: BuilderConfig, sequence: Sequence) -> None:
    table = read_detections(Path(config.detections))
    tolerance_ns = round(config.detections_tolerance_s * 1e9)
    near = [table.rows_near(stamp, tolerance_ns) for stamp in sequence.stamps_ns.tolist()]
    if not any(rows.stop > rows.start for rows in near):
        raise SequenceError(
            f'{config.detections} has no detection within {config.detections_tolerance_s:g} s of '
            f'any of the {sequence.frame_count} frames of {sequence.source}: is it that of '
            'another sequence?')


def _cached(path: Path) -> list[MultiTierGraph] | None:
    if not path.exists():
        return None
    try:
        return load_graphs(path)
    except EvaluationError as error:
        _log.warning('%s; building the graphs again', error)
        return None


def _name(name: str, numbers: range, count: int) -> str:
    if len(numbers) == count:
        return name
    return f'{name}, frames {numbers[0]} to {numbers[-1]} of {count}'


def holds_graphs(path: Path) -> bool:
    """Tell whether a path is a bag that has graphs, or other payloads, and no images."""
    if not is_bag(path):
        return False
    with BagFile(path) as bag:
        return not bag.of_type(IMAGE, COMPRESSED_IMAGE) and bool(bag.payload_topics())


def _recorded_graphs(part: SequencePart) -> GraphSequence:
    """Return the graphs of a bag without images."""
    topic, = Replay(part.path, ReplayConfig()).frame_topics
    graphs = read_messages(part.path, topic, decode_graph)
    sizes = sorted({(graph.width, graph.height) for graph in graphs})
    if len(sizes) != 1:
        raise SequenceError(f'bag {part.path} has graphs of images of several sizes on {topic}: '
                            f'{sizes}; a sequence has one image size')
    numbers = part.numbers(len(graphs))
    return GraphSequence(_name(part.path.resolve().stem, numbers, len(graphs)),
                         graphs[numbers.start:numbers.stop],
                         bag_trajectory(part.path, np.array([g.stamp_ns for g in graphs]),
                                        graphs[0].frame_id), sizes[0], part.path)
