# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Labels of a sequence by the best evidence that there is (docs/labels.md)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import LabelConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.ground_truth import audit, audit_cache
from adversarial_lcd_ros.ground_truth.covisibility import find_covisibility, read_covisibility
from adversarial_lcd_ros.ground_truth.depth import DepthImages, find_depth, shares_of
from adversarial_lcd_ros.ground_truth.evidence import Evidence, from_shares
from adversarial_lcd_ros.ground_truth.focal import Focal, measure_focal
from adversarial_lcd_ros.ground_truth.labels import (
    FrameLabels,
    count_old_enough,
    label_frames,
    likely_loops,
    located_poses,
)
from adversarial_lcd_ros.ground_truth.motion_depth import Camera
from adversarial_lcd_ros.ground_truth.overlap import rotations, visible_points
from adversarial_lcd_ros.ground_truth.view_features import (
    ViewFeatures,
    from_graphs,
    from_pictures,
)
from adversarial_lcd_ros.sequences import PLACE_INDEX, Frame, open_sequence
from adversarial_lcd_ros.sequences import Sequence as CameraSequence
from adversarial_lcd_ros.sequences.bagfile import COMPRESSED_IMAGE, IMAGE, BagFile, is_bag
from adversarial_lcd_ros.sequences.frame import NO_PICTURE
from adversarial_lcd_ros.sequences.sequence import Progress

if TYPE_CHECKING:
    from adversarial_lcd_ros.sequences import Trajectory

# Views with fewer features than this show nothing: whether they share anything is told by poses
# alone, and only if they cannot at any of these depths, metres.
_LEAST_FEATURES = 50
_ANY_DEPTH_M = (0.3, 0.6, 1.0, 2.0, 4.0, 8.0, 16.0, 64.0)


@dataclass(frozen=True, eq=False)
class Views:
    """
    The frames to label.

    Attributes
    ----------
    stamp_ns : int64, (n,)
        Strictly ascending.
    image_size : (int, int)
        Width and height, pixels.
    trajectory : Trajectory
        Ground truth.
    source : Path
        What the sequence was opened from: evidence is looked for in it, or beside it.
    graphs : sequence of MultiTierGraph
        One a frame, or none. Their features are looked at only where the source has no pictures.

    """

    stamp_ns: NDArray[np.int64]
    image_size: tuple[int, int]
    trajectory: Trajectory
    source: Path
    graphs: Sequence[MultiTierGraph] = ()

    @cached_property
    def pictures(self) -> CameraSequence | None:
        """The sequence that the pictures of the frames are in; None where there are none."""
        if is_bag(self.source):
            with BagFile(self.source) as bag:
                if not bag.of_type(IMAGE, COMPRESSED_IMAGE):
                    return None
        sequence = open_sequence(self.source)
        return None if sequence.detections else sequence


@dataclass(frozen=True, eq=False)
class Labelled:
    """
    Labels, and what they were made of.

    Attributes
    ----------
    labels : FrameLabels
    focal_length : float
        Over the image width.
    focal_from : str
        Where it is from, in words.

    """

    labels: FrameLabels
    focal_length: float
    focal_from: str


def label_graphs(graphs: Sequence[MultiTierGraph], trajectory: Trajectory, source: Path,
                 config: LabelConfig, progress: Progress | None = None) -> FrameLabels:
    """Return the labels of the frames that some graphs, at least one, are of."""
    views = Views(np.array([graph.stamp_ns for graph in graphs], np.int64),
                  (graphs[0].width, graphs[0].height), trajectory, source, graphs)
    return label_views(views, config, progress).labels


def label_views(views: Views, config: LabelConfig, progress: Progress | None = None) -> Labelled:
    """
    Label the frames of a sequence by the best evidence that there is.

    Parameters
    ----------
    views : Views
    config : LabelConfig
    progress : callable, optional
        Called with frames done and to do.

    Raises
    ------
    EvaluationError
        The evidence is damaged or of another sequence; or see ``label_frames``.

    """
    told_by, evidence, focal = None, None, Focal(config.focal_length, 'setting')
    if views.trajectory.frame_id != PLACE_INDEX and config.rule in ('auto', 'audit'):
        path = find_covisibility(views.source) if config.rule == 'auto' else None
        depth = find_depth(views.source) if config.rule == 'auto' and path is None else None
        if path is not None:
            told_by = 'co-visibility'
            evidence = from_shares(read_covisibility(path).shares(views.stamp_ns), config)
        elif depth is not None:
            told_by = 'depth images'
            evidence, focal = _by_depth(views, depth, config)
        else:
            told_by = 'audit'
            evidence, focal = _by_audit(views, config, progress)
    labels = label_frames(views.trajectory, views.stamp_ns, views.image_size, config, evidence)
    return Labelled(replace(labels, told_by=told_by or labels.told_by), focal.share, focal.source)


def _by_depth(views: Views, images: DepthImages, config: LabelConfig) -> tuple[Evidence, Focal]:
    camera, focal = _camera(views, config), _known_focal(views)
    if focal is None:
        focal = _measured_focal(_features(views), camera, config)
    return from_shares(shares_of(images, views.stamp_ns, camera.turn, camera.centre,
                                 focal.share), config), focal


def _by_audit(views: Views, config: LabelConfig, progress: Progress | None
              ) -> tuple[Evidence, Focal]:
    stamps, size = views.stamp_ns, views.image_size
    rows, located = located_poses(views.trajectory, stamps, config)
    candidates = count_old_enough(stamps, config.min_gap_s)
    known = _known_focal(views)
    key = audit_cache.cache_key(views.source, rows, candidates, located, _first_bytes(views),
                                known or Focal(config.focal_length, 'setting'))
    found = audit_cache.load(key)
    if found is None:
        features, camera = _features(views), _camera(views, config)
        focal = known or _measured_focal(features, camera, config)
        camera = replace(camera, focal=focal.share * size[0])
        found = audit_cache.Audit(audit.look(features, camera, candidates, progress), focal)
        audit_cache.save(key, found)
    measured = replace(config, focal_length=found.focal.share)
    likely, left = likely_loops(rows, size, measured)
    evidence = audit.evidence(found.sightings, (stamps - stamps[0]) / 1e9, candidates, likely,
                              left)
    blind = found.sightings.features < _LEAST_FEATURES
    if blind.any():
        evidence = _without_sight(evidence, blind, visible_points(
            rows.position, rows.quaternion, size, found.focal.share, _ANY_DEPTH_M))
    return evidence, found.focal


def _camera(views: Views, config: LabelConfig) -> Camera:
    rows, located = located_poses(views.trajectory, views.stamp_ns, config)
    width, height = views.image_size
    return Camera((views.stamp_ns - views.stamp_ns[0]) / 1e9, rotations(rows.quaternion),
                  rows.position, located, float(width), float(height),
                  config.focal_length * width)


def _features(views: Views) -> ViewFeatures:
    if views.pictures is None:
        return from_graphs(views.graphs, len(views.stamp_ns))
    return from_pictures(_frames_at(views.pictures, views.stamp_ns))


def _first_bytes(views: Views) -> bytes:
    if views.pictures is None:
        return b''.join(graph.node_digest for graph in views.graphs)
    return next(_frames_at(views.pictures, views.stamp_ns[:1])).data


def _known_focal(views: Views) -> Focal | None:
    pictures = views.pictures
    if pictures is None or pictures.focal_length_px is None:
        return None
    return Focal(pictures.focal_length_px / pictures.image_size[0], 'calibration in the recording')


def _measured_focal(features: ViewFeatures, camera: Camera, config: LabelConfig) -> Focal:
    measured = measure_focal(features, camera)
    if measured is None:
        return Focal(config.focal_length, 'setting: matches do not tell it')
    return Focal(measured, 'measured: matches under the true poses agree with it best')


def _without_sight(evidence: Evidence, blind: NDArray[np.bool_],
                   seen: NDArray[np.uint8]) -> Evidence:
    pair = blind[:, None] | blind[None, :]
    apart = (seen == 0) & (seen.T == 0)
    return replace(evidence, elsewhere=np.where(pair, apart, evidence.elsewhere))


def _frames_at(sequence: CameraSequence, stamps: NDArray[np.int64]) -> Iterator[Frame]:
    number = np.searchsorted(sequence.stamps_ns, stamps)
    number = np.minimum(number, sequence.frame_count - 1)
    if (sequence.stamps_ns[number] != stamps).any():
        raise EvaluationError(f'{sequence.source} has no frame at {stamps[0]} ns and the like: '
                              'expected the frames that the graphs were built from')
    wanted = set(number.tolist())
    frames = sequence.frames(int(number[0]), int(number[-1]) + 1)
    for at, frame in enumerate(frames, int(number[0])):
        if at in wanted and frame.encoding != NO_PICTURE:
            yield frame
