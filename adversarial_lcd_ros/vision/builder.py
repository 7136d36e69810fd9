# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Camera image -> multi-tier graph (paper, Fig. 2 a-c)."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import BuilderConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.paths import model_path, object_model_path
from adversarial_lcd_ros.sequences.detections import DetectionTable, read_detections
from adversarial_lcd_ros.vision.assembly import assemble
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
