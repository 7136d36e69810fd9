"""Objects from an ONNX network (paper, Fig. 2b)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
import onnxruntime

from adversarial_lcd_ros.config import BuilderConfig
from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.paths import cache_folder

IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_DEVIATION = (0.229, 0.224, 0.225)
NMS_IOU = 0.45
LETTERBOX_GREY = 114

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


def default_model_path() -> Path:
    """Return where "adversarial-lcd fetch-model" puts the object model."""
    return cache_folder() / 'models' / 'picodet_s_coco.onnx'


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
                   score[order].astype(np.float32))


def filter_objects(found: Detections, width: int, height: int,
                   config: BuilderConfig) -> Detections:
    """
    Return the objects that make anchors, by size and location (paper, Fig. 2b).

    Dropped are those whose area is out of bounds or whose centre is too near the border.
    """
    area = found.box[:, 2] * found.box[:, 3] / (width * height)
    centre = (found.box[:, :2] + found.box[:, 2:] / 2) / np.float32([width, height])
    margin = config.border_margin
    kept = ((area >= config.min_object_area) & (area <= config.max_object_area)
            & (centre >= margin).all(axis=1) & (centre <= 1 - margin).all(axis=1))
    return found[np.flatnonzero(kept)[:config.max_objects]]


class ObjectDetector:
    """
    Runs an object model whose kind it reads off the model's inputs and outputs.

    Understood are PaddleDetection exports (inputs image and scale_factor; rows of class, score,
    x1, y1, x2, y2) and exports of the YOLO family: a raw head (1, 4 + classes, boxes), or
    (1, boxes, 6) with suppression inside (rows of x1, y1, x2, y2, score, class).

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
        The model is missing, damaged, or of none of these kinds.

    """

    def __init__(self, model: Path, score: float, threads: int = 0) -> None:
        self._score = score
        if not model.is_file():
            raise ModelError(f'no object model at {model}: run "adversarial-lcd fetch-model", or '
                             'name one by the setting "model", or set "detector" to "none"')
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.log_severity_level = 3
        # Spinning threads would take a core from the feature extraction that runs beside.
        options.add_session_config_entry('session.intra_op.allow_spinning', '0')
        try:
            self._session = onnxruntime.InferenceSession(
                str(model), options, providers=['CPUExecutionProvider'])
        except Exception as error:  # onnxruntime's own classes are private
            raise ModelError(f'{model} cannot be loaded as ONNX: {error}') from error
        self._inputs = {entry.name: entry.shape for entry in self._session.get_inputs()}
        self._output = self._session.get_outputs()[0]
        self._run = self._recognise(model)

    def detect(self, image: NDArray[np.uint8]) -> Detections:
        """Return the objects of a BGR image, uint8 (h, w, 3), above the least confidence."""
        return self._run(image)

    def _recognise(self, model: Path) -> Callable[[NDArray[np.uint8]], Detections]:
        shape = self._output.shape
        if 'scale_factor' in self._inputs and 'image' in self._inputs:
            self._size = self._input_size('image', model)
            return self._paddle
        if len(self._inputs) == 1 and len(shape) == 3:
            self._name = next(iter(self._inputs))
            self._size = self._input_size(self._name, model)
            return self._yolo_end_to_end if shape[2] == 6 else self._yolo_raw
        raise ModelError(f'{model}: found inputs {self._inputs} and output {shape}; expected '
                         'a PaddleDetection or a YOLO export')

    def _input_size(self, name: str, model: Path) -> tuple[int, int]:
        shape = self._inputs[name]
        if len(shape) != 4 or not all(isinstance(side, int) for side in shape[2:]):
            raise ModelError(f'{model}: input {name} has shape {shape}; expected a fixed '
                             '(batch, 3, height, width)')
        return int(shape[3]), int(shape[2])

    def _paddle(self, image: NDArray[np.uint8]) -> Detections:
        height, width = image.shape[:2]
        columns, rows = self._size
        resized = cv2.resize(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), self._size,
                             interpolation=cv2.INTER_CUBIC)
        scale = 1 / (255 * np.float32(IMAGENET_DEVIATION))
        offset = np.float32(IMAGENET_MEAN) / np.float32(IMAGENET_DEVIATION)
        tensor = (resized * scale - offset).transpose(2, 0, 1)[None]
        rows_found = self._session.run(None, {
            'image': np.ascontiguousarray(tensor, np.float32),
            'scale_factor': np.float32([[rows / height, columns / width]])})[0]
        found = rows_found[rows_found[:, 1] >= self._score]
        return Detections.of(found[:, 0], found[:, 2:6], found[:, 1], width, height)

    def _letterboxed(self, image: NDArray[np.uint8]) -> tuple[NDArray[np.float32], float, float,
                                                              float]:
        """Return the output for an image scaled with its aspect kept, the scale and offset."""
        height, width = image.shape[:2]
        columns, rows = self._size
        scale = min(columns / width, rows / height)
        resized = cv2.resize(image, (round(width * scale), round(height * scale)))
        left, top = (columns - resized.shape[1]) // 2, (rows - resized.shape[0]) // 2
        canvas = np.full((rows, columns, 3), LETTERBOX_GREY, np.uint8)
        canvas[top:top + resized.shape[0], left:left + resized.shape[1]] = resized
        tensor = cv2.dnn.blobFromImage(canvas, 1 / 255, swapRB=True)
        return self._session.run(None, {self._name: tensor})[0][0], scale, left, top

    def _yolo_raw(self, image: NDArray[np.uint8]) -> Detections:
        head, scale, left, top = self._letterboxed(image)
        scores = head[4:]
        label = scores.argmax(axis=0)
        score = scores.max(axis=0)
        sure = np.flatnonzero(score >= self._score)
        centre, size = head[:2, sure].T, head[2:4, sure].T
        box = np.concatenate([centre - size / 2, size], axis=1)
        kept = np.asarray(cv2.dnn.NMSBoxesBatched(
            box.tolist(), score[sure].tolist(), label[sure].tolist(), self._score, NMS_IOU),
            np.int64).ravel()
        corners = np.concatenate([box[:, :2], box[:, :2] + box[:, 2:]], axis=1)[kept]
        return self._unboxed(label[sure][kept], corners, score[sure][kept], image, scale,
                             (left, top))

    def _yolo_end_to_end(self, image: NDArray[np.uint8]) -> Detections:
        rows, scale, left, top = self._letterboxed(image)
        rows = rows[rows[:, 4] >= self._score]
        return self._unboxed(rows[:, 5], rows[:, :4], rows[:, 4], image, scale, (left, top))

    @staticmethod
    def _unboxed(label: NDArray[Any], corners: NDArray[Any], score: NDArray[Any],
                 image: NDArray[np.uint8], scale: float,
                 offset: tuple[float, float]) -> Detections:
        """Return detections in pixels of the image that was letterboxed."""
        corners = (corners.reshape(-1, 4) - np.tile(np.float32(offset), 2)) / scale
        return Detections.of(label, corners, score, image.shape[1], image.shape[0])
