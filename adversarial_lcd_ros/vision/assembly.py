# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Features and objects -> multi-tier graph, in either variant (paper, Fig. 2 c)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import ANCHORS, BuilderConfig
from adversarial_lcd_ros.edge_rule import joined_pairs
from adversarial_lcd_ros.graph import (
    DESCRIPTOR_BYTES,
    FEATURE_TIER,
    OBJECT_TIER,
    SCENE_CLASS,
    MultiTierGraph,
)
from adversarial_lcd_ros.vision.features import Features
from adversarial_lcd_ros.vision.objects import Detections


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
