# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Compiled code, loaded before the first message.

Else the first graph with something to compare with would wait for it, a second or more: an
attacker's deadline would pass over one query, and a frame at 30 Hz over thirty.

numba is a dependency, not an option: results must not hang on whether it is there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.graph import DESCRIPTOR_BYTES, SCENE_CLASS, MultiTierGraph
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.types import LcdAnswer
from adversarial_lcd_ros.registry import PERTURBATIONS, TARGETS

_OBJECTS = 2
# Centralities of fewer nodes come from a dense solver, not from compiled code.
_NODES = 102
_LATER_NS = 3_600_000_000_000


def load_everything(tell: Callable[[str], None] = lambda text: None) -> None:
    """
    Load, and where needed compile and keep, all compiled code: for every setting there is.

    Parameters
    ----------
    tell : callable
        Gets a few words on what comes next.

    """
    from adversarial_lcd_ros.compiled.hamming import lanes, nearest
    from adversarial_lcd_ros.lcd.flips import flip_logits
    from adversarial_lcd_ros.weisfeiler_lehman.histogram import flip_kernels, histogram

    tell('graph_builder and training')
    load_for_builder()
    nearest(lanes(_descriptor(2)), lanes(_descriptor(2)))
    graph = _graph(0)
    flip_kernels(graph, graph.label, graph.edge[:1].astype(np.int64), 1,
                 histogram(graph, graph.label, 1))
    for target in TARGETS:
        tell(f'target {target}')
        load_for_detector(LcdConfig(target=target))
        detector = LoopClosureDetector(LcdConfig(target=target, min_gap_s=0.0))
        detector.remember(graph)
        flip_logits(detector, graph, graph.edge[:2])
    for perturbation in PERTURBATIONS:
        tell(f'attack {perturbation}')
        load_for_attacker(AttackConfig(perturbation=perturbation))
    tell('attack recall')
    load_for_attacker(AttackConfig(search='recall'))


def load_for_builder() -> None:
    """Let a small vocabulary find a word."""
    from adversarial_lcd_ros.vision.vocabulary import Vocabulary

    Vocabulary(_descriptor(2), np.ones(2, np.float32), 2, 1).words(_descriptor(1))


def load_for_detector(config: LcdConfig) -> None:
    """Let a detector of its own judge a loop."""
    detector = LoopClosureDetector(replace(config, min_gap_s=0.0))
    graph = _graph(0)
    detector.remember(graph)
    for pairs in (graph.edge[:0], graph.edge[:1], graph.edge[-1:]):
        detector.judge(graph.flip(pairs))


def load_for_attacker(config: AttackConfig) -> None:
    """Let an attacker of its own attack a graph that he has seen before, with one edge more."""
    # A detector starts sooner without what an attacker needs: scikit-learn alone takes a second.
    from adversarial_lcd_ros.attack.attacker import Attacker

    attacker = Attacker(replace(config, ratio=1.5 / _NODES ** 2, deadline_ms=0.0))
    later = _graph(_LATER_NS)
    for graph in (_graph(0), later.flip(later.edge[-1:])):
        attacker.process(graph, lambda graph: LcdAnswer(
            id=0, is_loop=False, is_soft=True, probability=0.25))


def _graph(stamp_ns: int) -> MultiTierGraph:
    """Return an object, the scene, and a ring of features that hang on both, as off the wire."""
    feature = np.arange(_OBJECTS, _NODES)
    ring = np.sort(np.stack([feature, np.roll(feature, 1)], axis=1), axis=1)
    seen = np.stack(np.meshgrid(np.arange(_OBJECTS), feature, indexing='ij'), axis=-1)
    edge = np.concatenate([[(0, 1)], seen.reshape(-1, 2), ring])
    edge = edge[np.lexsort((edge[:, 1], edge[:, 0]))].astype(np.uint32)
    descriptor = np.zeros((_NODES, 32), np.uint8)
    descriptor[_OBJECTS:] = _descriptor(len(feature))
    label = np.zeros(_NODES, np.uint32)
    label[_OBJECTS - 1] = SCENE_CLASS
    position = np.stack([np.arange(_NODES)] * 2, axis=1).astype(np.float32)
    offset = position[edge[:, 0]] - position[edge[:, 1]]
    return codec.decode_graph(codec.encode_graph(MultiTierGraph(
        stamp_ns=stamp_ns, frame_id='', sequence=0, width=640, height=480,
        tier=(np.arange(_NODES) >= _OBJECTS).astype(np.uint8), label=label, position=position,
        size=np.ones((_NODES, 2), np.float32), score=np.ones(_NODES, np.float32),
        descriptor=descriptor, edge=edge, edge_length=np.hypot(*offset.T) / np.float32(800),
        word=np.zeros(1, np.uint32), word_weight=np.ones(1, np.float32))))


def _descriptor(count: int) -> NDArray[np.uint8]:
    return np.random.default_rng(0).integers(0, 256, (count, DESCRIPTOR_BYTES), np.uint8)
