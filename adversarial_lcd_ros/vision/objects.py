# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects from an ONNX network (paper, Fig. 2b)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import BuilderConfig
from adversarial_lcd_ros.errors import FileError, ModelError
from adversarial_lcd_ros.files.network import NETWORK_ROOM_BYTES, bounded_memory, open_network
from adversarial_lcd_ros.files.reading import parse_json
from adversarial_lcd_ros.vision import heads

# RGB, for grey levels from 0 to 1.
IMAGENET_MEAN = np.array([0.485, 0.456, 0.406], np.float32)
IMAGENET_DEVIATION = np.array([0.229, 0.224, 0.225], np.float32)
NMS_IOU = 0.45
LETTERBOX_GREY = 114
# Boxes that suppression looks at, the most confident first: its time grows with their square.
_MOST_BOXES = 4096
# Of the network's input, pixels: no object network is so large, and memory is not endless.
_LONGEST_SIDE = 8192
_MOST_VALUES = 1 << 26
_EXPECTED = ('expected a PaddleDetection export (image, scale_factor) or one of YOLOv8 or later '
             'for detection, in float32 (of YOLOv5 to 7: export it with suppression inside, rows '
             'of x1 y1 x2 y2 score class), or write its detections as CSV for the detector "csv"')

COCO_CLASSES = (
    'person', 'bicycle', 'car', 'motorcycle', 'airplane', 'bus', 'train', 'truck', 'boat',
    'traffic light', 'fire hydrant', 'stop sign', 'parking meter', 'bench', 'bird', 'cat', 'dog',
    'horse', 'sheep', 'cow', 'elephant', 'bear', 'zebra', 'giraffe', 'backpack', 'umbrella',
    'handbag', 'tie', 'suitcase', 'frisbee', 'skis', 'snowboard', 'sports ball', 'kite',
    'baseball bat', 'baseball glove', 'skateboard', 'surfboard', 'tennis racket', 'bottle',
    'wine glass', 'cup', 'fork', 'knife', 'spoon', 'bowl', 'banana', 'apple', 'sandwich',
    'orange', 'broccoli', 'carrot', 'hot dog', 'pizza', 'donut', 'cake', 'chair', 'couch',
    'potted plant', 'bed', 'dining table', 'toilet', 'tv', 'laptop', 'mouse', 'remote',
    'keyboard', 'cell phone', 'microwave', 'oven', 'toaster', 'sink', 'refrigerator', 'book',
    'clock', 'vase', 'scissors', 'teddy bear', 'hair drier', 'toothbrush')


@dataclass(frozen=True)
class Detections:
    """
    Objects of one image, most confident first.

    Attributes
    ----------
    label : uint32, (k,)
        Class.
    box : float32, (k, 4)
        x, y of the upper left corner, width, height, pixels.
    score : float32, (k,)
        Confidence.

    """

    label: NDArray[np.uint32]
    box: NDArray[np.float32]
    score: NDArray[np.float32]

    def __len__(self) -> int:
        """Return the number of objects."""
        return len(self.score)

    def __getitem__(self, chosen: NDArray[Any]) -> Detections:
        """Return the objects with the given indices, or where a mask is true."""
        return Detections(self.label[chosen], self.box[chosen], self.score[chosen])

    @classmethod
    def none(cls) -> Detections:
        """Return no objects."""
        return cls(np.zeros(0, np.uint32), np.zeros((0, 4), np.float32), np.zeros(0, np.float32))

    @classmethod
    def of(cls, label: NDArray[Any], corners: NDArray[Any], score: NDArray[Any], width: int,
           height: int) -> Detections:
        """Return detections from x1, y1, x2, y2 corners, clipped to the image and sorted."""
        limit = np.array([width, height, width, height], np.float32)
        corners = np.clip(corners.reshape(-1, 4), 0, limit)
        box = np.concatenate([corners[:, :2], corners[:, 2:] - corners[:, :2]], axis=1)
        order = np.argsort(-score, kind='stable')
        order = order[(box[order, 2:] > 0).all(axis=1)]
        return cls(label[order].astype(np.uint32), box[order].astype(np.float32),
                   np.minimum(score[order], 1).astype(np.float32))


def filter_objects(found: Detections, width: int, height: int,
                   config: BuilderConfig) -> Detections:
    """
    Return the objects that make anchors, by size and location (paper, Fig. 2b).

    Dropped are those whose area is out of bounds or whose centre is too near the border.
    """
    area = found.box[:, 2] * found.box[:, 3] / (width * height)
    centre = (found.box[:, :2] + found.box[:, 2:] / 2) / np.array([width, height], np.float32)
    margin = config.border_margin
    kept = ((area >= config.min_object_area) & (area <= config.max_object_area)
            & (centre >= margin).all(axis=1) & (centre <= 1 - margin).all(axis=1))
    return found[np.flatnonzero(kept)[:config.max_objects]]


class ObjectDetector:
    """
    Runs an object model whose kind it reads off the model's inputs and outputs.

    Understood are PaddleDetection exports (inputs image and scale_factor; rows of class, score,
    x1, y1, x2, y2) and exports of the YOLO family, version 8 and later: a raw head
    (1, 4 + classes, boxes), or (1, boxes, 6) with suppression inside (rows of x1, y1, x2, y2,
    score, class). The size of the input must be fixed, or be named in the model's metadata.
    Shapes alone do not tell these from heads that mean something else by the same numbers:
    what scores, classes and boxes cannot be is refused.

    Parameters
    ----------
    model : Path
        ONNX file.
    score : float
        Least confidence.
    threads : int
        Threads of the network, 0: as many as cores.

    Raises
    ------
    ModelError
        The model is missing, damaged, or of none of these kinds, by shape or by values.

    """

    def __init__(self, model: Path, score: float, threads: int = 0) -> None:
        self._model = model
        self._score = score
        if not model.is_file():
            raise ModelError(f'no object model at {model}: leave the setting "model" empty for '
                             'the one that ships, or set "detector" to "none"')
        try:
            self._session = open_network(model, threads)
        except FileError as error:
            raise ModelError(f'{error}; leave the setting "model" empty for the one that '
                             'ships') from error
        self._run = self._recognise()
        # A model that cannot run says so now, and the first frame finds it warm.
        with bounded_memory(NETWORK_ROOM_BYTES):
            self.detect(np.zeros((*self._size[::-1], 3), np.uint8))

    def detect(self, image: NDArray[np.uint8]) -> Detections:
        """
        Return the objects of an image above the least confidence.

        Parameters
        ----------
        image : uint8, (h, w, 3)
            BGR.

        Raises
        ------
        ModelError
            The network fails, or its output has another shape than its kind has, or values that
            its kind cannot have.

        """
        return self._run(image)

    def _recognise(self) -> Callable[[NDArray[np.uint8]], Detections]:
        """Return the method that runs models of this kind."""
        inputs = {entry.name: entry for entry in self._session.get_inputs()}
        outputs = self._session.get_outputs()
        self._output = outputs[0].name
        shape = outputs[0].shape
        floats = all(entry.type == 'tensor(float)' for entry in inputs.values())
        if floats and set(inputs) == {'image', 'scale_factor'}:
            self._size = self._input_size(inputs['image'].shape)
            grey = np.arange(256, dtype=np.uint8)[:, None]
            self._normalised = (grey * (1 / (255 * IMAGENET_DEVIATION))
                                - IMAGENET_MEAN / IMAGENET_DEVIATION).astype(np.float32)
            return self._paddle
        if floats and len(inputs) == len(outputs) == 1 and len(shape) == 3:
            (self._input, entry), = inputs.items()
            self._size = self._input_size(entry.shape)
            if shape[2] == 6 and not heads.is_grid(shape[1], self._size):
                return self._yolo_end_to_end
            # Older heads, (1, boxes, 5 + classes), are the other way round.
            rows, columns = shape[1:]
            if isinstance(rows, int) and rows > 4 and (
                    not isinstance(columns, int) or columns > rows):
                return self._yolo_raw
        found = ', '.join(f'{entry.name} {entry.type}{entry.shape}'
                          for entry in (*inputs.values(), *outputs))
        raise ModelError(f'{self._model}: found {found}; {_EXPECTED}')

    def _check(self, *problems: str) -> None:
        """Refuse a model whose numbers have a problem."""
        found = next(filter(None, problems), '')
        if found:
            raise ModelError(f'{self._model}: output {self._output} has {found}: it is a head of '
                             f'another kind; {_EXPECTED}')

    def _input_size(self, shape: list[int | str]) -> tuple[int, int]:
        """Return width and height of the network's input, from its shape or its metadata."""
        sides: Any = shape[2:]
        if not _are_sides(sides):
            named = self._session.get_modelmeta().custom_metadata_map.get('imgsz', '')
            try:
                sides = parse_json(named, 'imgsz')
            except FileError:
                sides = None
        if len(shape) != 4 or shape[1] != 3 or not _are_sides(sides):
            raise ModelError(f'{self._model}: the input has shape {shape}; expected (batch, 3, '
                             f'height, width) of at most {_LONGEST_SIDE}: export the model '
                             'with a fixed size')
        return int(sides[1]), int(sides[0])

    def _infer(self, feed: dict[str, NDArray[np.float32]],
               shape: tuple[int | None, ...]) -> NDArray[np.float32]:
        """Return the first output, whose shape is checked; None stands for any number."""
        try:
            found: NDArray[np.float32] = self._session.run([self._output], feed)[0]
        except Exception as error:  # onnxruntime's own classes are private
            raise ModelError(f'{self._model} fails on an image: {error}') from error
        if found.ndim != len(shape) or not all(
                expected in (None, side)
                for side, expected in zip(found.shape, shape, strict=True)):
            raise ModelError(f'{self._model}: output {self._output} of shape {found.shape}; '
                             f'expected {shape}')
        if found.size > _MOST_VALUES:
            raise ModelError(f'{self._model}: output {self._output} has {found.size} values; '
                             f'expected at most {_MOST_VALUES}')
        return found

    def _paddle(self, image: NDArray[np.uint8]) -> Detections:
        height, width = image.shape[:2]
        columns, rows = self._size
        planes = cv2.split(cv2.resize(image, self._size, interpolation=cv2.INTER_CUBIC))
        # BGR to RGB, and each grey level to its normalised value, in one table look-up.
        tensor = np.stack([cv2.LUT(plane, self._normalised[:, channel])
                           for channel, plane in enumerate(reversed(planes))])
        found = self._infer({'image': tensor[None], 'scale_factor': np.array(
            [[rows / height, columns / width]], np.float32)}, (None, 6))
        # A row of class -1 stands for "nothing found".
        found = found[~(found[:, 0] < 0)]
        self._check(heads.wrong_scores(found[:, 1]))
        found = found[found[:, 1] >= self._score]
        self._check(heads.wrong_classes(np.floor(found[:, 0])), heads.not_finite(found[:, 2:6]))
        return Detections.of(found[:, 0], found[:, 2:6], found[:, 1], width, height)

    def _letterboxed(self, image: NDArray[np.uint8], shape: tuple[int | None, ...]
                     ) -> tuple[NDArray[np.float32], float, tuple[int, int]]:
        """Return the output for an image scaled with its aspect kept, the scale and offset."""
        height, width = image.shape[:2]
        columns, rows = self._size
        scale = min(columns / width, rows / height)
        resized = cv2.resize(image, (max(round(width * scale), 1),
                                     max(round(height * scale), 1)))
        left, top = (columns - resized.shape[1]) // 2, (rows - resized.shape[0]) // 2
        canvas = np.full((rows, columns, 3), LETTERBOX_GREY, np.uint8)
        canvas[top:top + resized.shape[0], left:left + resized.shape[1]] = resized
        tensor = cv2.dnn.blobFromImage(canvas, 1 / 255, swapRB=True)
        return self._infer({self._input: tensor}, shape)[0], scale, (left, top)

    def _yolo_raw(self, image: NDArray[np.uint8]) -> Detections:
        head, scale, offset = self._letterboxed(image, (1, None, None))
        label, score = head[4:].argmax(axis=0), head[4:].max(axis=0)
        self._check(heads.wrong_scores(head[4:].ravel()))
        sure = np.flatnonzero(score >= self._score)
        label, score = label[sure], score[sure]
        centre, size = head[:2, sure].T, head[2:4, sure].T
        self._check(heads.wrong_pixels(np.hstack([centre, size])))
        # Classes lie side by side, too far apart to overlap: one is not suppressed by another.
        apart = centre - size / 2 + 2 * max(self._size) * label[:, None]
        kept = np.asarray(cv2.dnn.NMSBoxes(np.hstack([apart, size]).tolist(), score.tolist(), 0.0,
                                           NMS_IOU, top_k=_MOST_BOXES), np.int64).ravel()
        corners = np.hstack([centre - size / 2, centre + size / 2])
        return self._unboxed(label[kept], corners[kept], score[kept], image, scale, offset)

    def _yolo_end_to_end(self, image: NDArray[np.uint8]) -> Detections:
        rows, scale, offset = self._letterboxed(image, (1, None, 6))
        self._check('a row for each cell' if heads.is_grid(len(rows), self._size) else '',
                    heads.wrong_scores(rows[:, 4]))
        rows = rows[rows[:, 4] >= self._score]
        self._check(heads.wrong_classes(rows[:, 5]), heads.wrong_corners(rows[:, :4]))
        return self._unboxed(np.round(rows[:, 5]), rows[:, :4], rows[:, 4], image, scale, offset)

    @staticmethod
    def _unboxed(label: NDArray[Any], corners: NDArray[Any], score: NDArray[Any],
                 image: NDArray[np.uint8], scale: float,
                 offset: tuple[int, int]) -> Detections:
        """Return detections in pixels of the image that was letterboxed."""
        corners = (corners - np.tile(offset, 2)) / scale
        return Detections.of(label, corners, score, image.shape[1], image.shape[0])


def _are_sides(sides: Any) -> bool:
    return isinstance(sides, list) and len(sides) == 2 and all(
        type(side) is int and 0 < side <= _LONGEST_SIDE for side in sides)
