# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Camera image -> multi-tier graph (paper, Fig. 2 a-c)."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import ANCHORS, BuilderConfig
from adversarial_lcd_ros.edge_rule import joined_pairs
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.graph import (
    DESCRIPTOR_BYTES,
    FEATURE_TIER,
    OBJECT_TIER,
    SCENE_CLASS,
    MultiTierGraph,
)
from adversarial_lcd_ros.paths import model_path, object_model_path
from adversarial_lcd_ros.sequences.detections import DetectionTable, read_detections
from adversarial_lcd_ros.vision.detections import class_words, given_objects, recorded_objects
from adversarial_lcd_ros.vision.features import FeatureExtractor, Features, spread, to_grey
from adversarial_lcd_ros.vision.objects import (
    Detections,
    ObjectDetector,
    filter_objects,
)
from adversarial_lcd_ros.vision.vocabulary import Vocabulary


class Building:
    """
    A graph under way: the network looks for its objects in another thread.

    Parameters
    ----------
    objects : Future of Detections
    finish : callable
        Detections -> MultiTierGraph.

    """

    def __init__(self, objects: Future[Detections],
                 finish: Callable[[Detections], MultiTierGraph]) -> None:
        self._objects = objects
        self._finish = finish

    def ready(self) -> bool:
        """Tell whether the objects are there, so that ``graph`` need not wait."""
        return self._objects.done()

    def when_ready(self, call: Callable[[], object]) -> None:
        """Call, from some thread, once the objects are there."""
        self._objects.add_done_callback(lambda _: call())

    def graph(self) -> MultiTierGraph:
        """Return the graph as soon as it is there; raises what the network raised."""
        return self._finish(self._objects.result())


class GraphBuilder:
    """
    Builds the graph of a view: objects are anchors, features hang on them and on each other.

    The network runs beside the feature extraction, in threads of its own. Same image, same
    settings, same bytes. Objects may also come from somebody else's detector: from a file, or
    with each frame. Close it, or use it as a context manager.

    Parameters
    ----------
    config : BuilderConfig
    frames_at_once : int
        Frames whose objects are looked for side by side.

    Raises
    ------
    ModelError
        The vocabulary or the object model is missing or damaged.
    ConfigError, SequenceError
        The file of detections is not named, or cannot be read.

    """

    def __init__(self, config: BuilderConfig | None = None, frames_at_once: int = 1) -> None:
        self.config = config or BuilderConfig()
        path = self.config.vocabulary
        self._vocabulary = Vocabulary.load(Path(path) if path else model_path('vocabulary.npz'))
        self._features = FeatureExtractor(self.config.detected_features,
                                          self.config.fast_threshold)
        self._objects: ObjectDetector | None = None
        if self.config.detector == 'onnx':
            model = Path(self.config.model) if self.config.model else object_model_path()
            self._objects = ObjectDetector(model, self.config.object_score, self.config.threads)
        self._table = _recorded(self.config)
        self._threads = ThreadPoolExecutor(frames_at_once, 'objects')

    def build(self, image: NDArray[np.uint8], stamp_ns: int, frame_id: str = 'camera',
              sequence: int = 0) -> MultiTierGraph:
        """
        Return the graph of an image.

        Parameters
        ----------
        image : uint8, (h, w, 3) BGR or (h, w) grey
        stamp_ns : int
            Acquisition time, nanoseconds.
        frame_id : str
        sequence : int

        Raises
        ------
        GraphError
            The image is empty or of another type.

        """
        return self.begin(image, stamp_ns, frame_id, sequence).graph()

    def begin(self, image: NDArray[np.uint8], stamp_ns: int, frame_id: str = 'camera',
              sequence: int = 0, objects: Future[Detections] | None = None) -> Building:
        """
        Begin to build the graph of an image; see ``build``. Returns with its features.

        Parameters
        ----------
        image, stamp_ns, frame_id, sequence
            See ``build``.
        objects : Future of Detections, optional
            Under the detector 'topic', and only there: what somebody else finds in the image.

        """
        grey = to_grey(image)
        coming = (self._threads.submit(self._detect, image, stamp_ns) if objects is None
                  else objects)
        height, width = grey.shape
        features = self._features.extract(grey)
        words = self._vocabulary.words(features.descriptor)
        kept = spread(features, self.config.features, width, height)
        return Building(coming, lambda objects: assemble(
            features[kept], words[kept], self._anchors(objects, width, height),
            self._vocabulary.vector(words), self.config, width=width, height=height,
            stamp_ns=stamp_ns, frame_id=frame_id, sequence=sequence))

    def build_objects(self, stamp_ns: int, width: int, height: int, frame_id: str = 'camera',
                      sequence: int = 0) -> MultiTierGraph:
        """
        Return the graph of a frame of which only the recorded detections are there.

        It has the object tier alone, or no node where nothing was found. For want of visual
        words its vBoW vector is that of the classes of its objects; see ``class_words``.

        Raises
        ------
        ConfigError
            The detector is not 'csv'.

        """
        if self._table is None:
            raise ConfigError(f'detector {self.config.detector!r} for a frame without a picture: '
                              'expected "csv", which reads its recorded detections')
        objects = self._anchors(self._detected(stamp_ns), width, height)
        return assemble(Features.none(), np.zeros(0, np.uint32), objects,
                        class_words(objects.label), self.config, width=width, height=height,
                        stamp_ns=stamp_ns, frame_id=frame_id, sequence=sequence)

    def _detect(self, image: NDArray[np.uint8], stamp_ns: int) -> Detections:
        if self.config.detector == 'topic':
            raise ConfigError('detector "topic" without detections: only the node graph_builder '
                              'has the topic; set "detector" to "csv" to read them from a file')
        if self._objects is None:
            return self._detected(stamp_ns)
        if image.ndim == 2:
            image = np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), np.uint8)
        return self._objects.detect(image)

    def _detected(self, stamp_ns: int) -> Detections:
        if self._table is None:
            return Detections.none()
        return recorded_objects(self._table, stamp_ns,
                                round(self.config.detections_tolerance_s * 1e9))

    def _anchors(self, found: Detections, width: int, height: int) -> Detections:
        if self._objects is None:
            found = given_objects(found, width, height, self.config.object_score)
        return filter_objects(found, width, height, self.config)

    def close(self) -> None:
        """Stop the threads of the network."""
        self._threads.shutdown()

    def __enter__(self) -> GraphBuilder:
        """Return the builder."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the builder."""
        self.close()


def _recorded(config: BuilderConfig) -> DetectionTable | None:
    if config.detector != 'csv':
        if config.detections:
            raise ConfigError(f'detections {config.detections} are named, but the detector is '
                              f'"{config.detector}", which does not look at them: set the '
                              'detector to "csv"')
        return None
    if not config.detections:
        raise ConfigError('detector "csv" without a file: name it by the setting "detections"')
    return read_detections(Path(config.detections))


def assemble(features: Features, words: NDArray[np.uint32], objects: Detections,
             bow: tuple[NDArray[np.uint32], NDArray[np.float32]], config: BuilderConfig, *,
             width: int, height: int, stamp_ns: int, frame_id: str, sequence: int
             ) -> MultiTierGraph:
    """
    Return the multi-tier graph of features and objects.

    Edges by ``edge_rule.joined_pairs``; lengths are distances over the image diagonal. In the
    variant 'anchors' one object more, the last, is the whole scene.

    Parameters
    ----------
    features : Features
        k of them.
    words : uint32, (k,)
    objects : Detections
    bow : (uint32, float32)
        Words of the whole frame and their weights.
    config : BuilderConfig
        Its variant and neighbours.
    width, height, stamp_ns, frame_id, sequence
        Of the frame.

    """
    has_scene = config.graph_variant == ANCHORS
    if has_scene:
        objects = _with_scene(objects, width, height)
    first = len(objects)
    centre = objects.box[:, :2] + objects.box[:, 2:] / 2
    position = np.concatenate([centre, features.position]).astype(np.float32)
    size = np.concatenate([objects.box[:, 2:], np.repeat(features.size[:, None], 2, axis=1)])
    edge = joined_pairs(position, size, first, config.feature_neighbours, has_scene=has_scene)
    diagonal = np.float32(np.hypot(width, height))
    offset = position[edge[:, 0]] - position[edge[:, 1]]
    return MultiTierGraph(
        stamp_ns=stamp_ns, frame_id=frame_id, sequence=sequence, width=width, height=height,
        tier=np.repeat([OBJECT_TIER, FEATURE_TIER], [first, len(features)]).astype(np.uint8),
        label=np.concatenate([objects.label, words]).astype(np.uint32),
        position=position,
        size=size,
        score=np.concatenate([objects.score, features.score]),
        descriptor=np.concatenate(
            [np.zeros((first, DESCRIPTOR_BYTES), np.uint8), features.descriptor]),
        edge=edge,
        edge_length=(np.hypot(offset[:, 0], offset[:, 1]) / diagonal).astype(np.float32),
        word=bow[0], word_weight=bow[1])


def in_variant(graph: MultiTierGraph, config: BuilderConfig) -> MultiTierGraph:
    """
    Return a graph in the variant of some settings: what a builder of these makes of the frame.

    Features and objects are the same in both variants, edges follow from them, and no picture is
    looked at.

    Parameters
    ----------
    graph : MultiTierGraph
        Of a builder with the same settings but for the variant.
    config : BuilderConfig
        Its variant and neighbours.

    """
    has_scene = config.graph_variant == ANCHORS
    if graph.has_scene == has_scene:
        return graph
    place = graph.found_objects
    scene: dict[str, Any] = {
        'tier': OBJECT_TIER, 'label': SCENE_CLASS, 'score': 1, 'descriptor': 0,
        'position': (graph.width / 2, graph.height / 2), 'size': (graph.width, graph.height)}
    none: NDArray[np.uint32] = np.zeros((0, 2), np.uint32)
    other = replace(graph, edge=none, edge_length=np.zeros(0, np.float32), **{
        name: (np.insert(getattr(graph, name), place, value, axis=0) if has_scene else
               np.delete(getattr(graph, name), place, axis=0)) for name, value in scene.items()})
    edge = joined_pairs(other.position, other.size, other.object_count,
                        config.feature_neighbours, has_scene)
    return other.with_edges(edge, other.length_between(edge))


def _with_scene(objects: Detections, width: int, height: int) -> Detections:
    """Return the objects and, last, one of a class of its own that is the whole image."""
    return Detections(np.r_[objects.label, np.uint32(SCENE_CLASS)],
                      np.r_[objects.box, np.array([[0, 0, width, height]], np.float32)],
                      np.r_[objects.score, np.float32(1)])
