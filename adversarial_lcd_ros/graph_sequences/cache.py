# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Graphs on disk, under a digest of everything that they were made of.

Pictures, settings, vocabulary, object model, code and the releases of libraries. A damaged file is
built anew, and that is said.
"""

from __future__ import annotations

from collections.abc import Sequence as Several
from dataclasses import asdict
import json
from pathlib import Path

import cv2
import numba
import numpy as np
import onnxruntime
import scipy

from adversarial_lcd_ros.config import BuilderConfig
from adversarial_lcd_ros.environment import code_digest
from adversarial_lcd_ros.errors import CodecError, EvaluationError, FileError, ModelError
from adversarial_lcd_ros.files.arrays import read_npz
from adversarial_lcd_ros.files.digests import digest_of_parts
from adversarial_lcd_ros.files.network import MAX_NETWORK_BYTES
from adversarial_lcd_ros.files.reading import read_bytes
from adversarial_lcd_ros.files.writing import replacing
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages.codec import decode_graph, encode_graph, schema_text
from adversarial_lcd_ros.paths import VOCABULARY, model_path, object_model_path
from adversarial_lcd_ros.sequences import Sequence

# What decides on the bytes of a graph: libraries, and code of this package.
_LIBRARIES = (np, scipy, cv2, onnxruntime, numba)
_CODE = ('vision', 'graph', 'edge_rule', 'compiled', 'messages', 'sequences/frame',
         'sequences/detections')
_MAX_CACHE_BYTES = 1 << 33
# Threads change how long a graph takes, not what it is.
_IRRELEVANT = ('threads',)


def cache_key(sequence: Sequence, numbers: range, config: BuilderConfig) -> str:
    """
    Return a digest of all that the graphs of some frames are made of, hexadecimal.

    The source and its stamps, its first picture as recorded, the settings, the bytes of the
    files that the settings name, the code that builds graphs, and the libraries below it.

    Parameters
    ----------
    sequence : Sequence
    numbers : range
        The frames.
    config : BuilderConfig

    """
    settings = {name: value for name, value in asdict(config).items() if name not in _IRRELEVANT}
    first = next(sequence.frames(numbers.start, numbers.start + 1))
    parts = [
        json.dumps({
            'source': str(sequence.source.resolve()), 'frames': [numbers.start, numbers.stop],
            'image_size': sequence.image_size, 'settings': settings,
            'libraries': [library.__version__ for library in _LIBRARIES]},
            sort_keys=True).encode(),
        sequence.stamps_ns[numbers.start:numbers.stop].tobytes(), first.data,
        schema_text('MultiTierGraph').encode(),
        code_digest(*_CODE).encode(), *(_bytes(path) for path in _named_files(config))]
    return digest_of_parts(parts)


def _named_files(config: BuilderConfig) -> list[Path]:
    files = [Path(config.vocabulary) if config.vocabulary else model_path(VOCABULARY)]
    if config.detector == 'onnx':
        files.append(Path(config.model) if config.model else object_model_path())
    if config.detector == 'csv' and config.detections:
        files.append(Path(config.detections))
    return files


def _bytes(path: Path) -> bytes:
    try:
        return read_bytes(path, MAX_NETWORK_BYTES)
    except FileError as error:
        raise ModelError(f'{error}; leave the settings "model" and "vocabulary" empty for '
                         'those that ship') from error


def save_graphs(path: Path, graphs: Several[MultiTierGraph]) -> None:
    """
    Write graphs as npz: their payloads one after the other, and the length of each.

    The file appears under its name when it is complete, or not at all.

    Raises
    ------
    EvaluationError
        The place cannot be written.

    """
    payloads = [encode_graph(graph) for graph in graphs]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as stream:
            np.savez(stream, payload=np.frombuffer(b''.join(payloads), np.uint8),
                     length=np.array([len(payload) for payload in payloads], np.int64))
    except (OSError, FileError) as error:
        raise EvaluationError(f'graphs cannot be kept in {path.parent} ({error}): name another '
                              'folder, or set ADVERSARIAL_LCD_CACHE') from error


def load_graphs(path: Path) -> list[MultiTierGraph]:
    """
    Read graphs that ``save_graphs`` wrote; every array is checked anew.

    Raises
    ------
    EvaluationError
        The file is damaged, or something else.

    """
    try:
        # The checksums of the archive find what was damaged; the codec, what never was a graph.
        arrays = read_npz(path, ('payload', 'length'), limit=_MAX_CACHE_BYTES, ratio=1)
        payload, length = arrays['payload'].tobytes(), arrays['length']
        ends = np.cumsum(length)
        if len(ends) and (length.min() < 0 or ends[-1] != len(payload)):
            raise ValueError(f'{len(payload)} bytes for graphs of {ends[-1]}')
        return [decode_graph(payload[end - size:end])
                for size, end in zip(length.tolist(), ends.tolist(), strict=True)]
    except (FileError, CodecError, TypeError, ValueError) as error:
        raise EvaluationError(f'{path} holds no graphs: {error}; delete it') from error
