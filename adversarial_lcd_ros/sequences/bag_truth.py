# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ground truth of a bag: which of its topics it could be, and the camera's poses from it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.poses.frame_poses import by_number, read_poses
from adversarial_lcd_ros.poses.pose_files import mounted
from adversarial_lcd_ros.poses.trajectory import PLACE_INDEX, Trajectory
from adversarial_lcd_ros.sequences.bagfile import OLD_TF, TF, BagFile
from adversarial_lcd_ros.sequences.pose_topics import (
    ODOMETRY,
    POSE_TYPES,
    ends_of,
    reason_against,
    topic_poses,
)
from adversarial_lcd_ros.sequences.stamps import LOG
from adversarial_lcd_ros.sequences.transforms import (
    FrameTree,
    Link,
    chain_text,
    compose,
    fixed_frames,
)

TRUTH_TOPIC, TRUTH_FILE = '/ground_truth', 'groundtruth.txt'
NO_TRUTH = 'none'
CAMERA_INFO = 'sensor_msgs/msg/CameraInfo'
_TF_TOPIC = '/tf'


@dataclass(frozen=True, eq=False)
class TruthOptions:
    """
    How poses become those of the camera.

    Attributes
    ----------
    fixed_frame : str or None
        Frame of /tf in which the camera moves; None: the only one that can be.
    camera_frame : str or None
        Of /tf; None: that of the images, or of their camera_info.
    body_frame : str or None
        Whose poses a topic holds that does not say it (PoseStamped); None: the camera's.
    extrinsics : float64, (4, 4), or None
        The camera's optical frame in that of the poses; None: from /tf.

    """

    fixed_frame: str | None = None
    camera_frame: str | None = None
    body_frame: str | None = None
    extrinsics: NDArray[np.float64] | None = None


@dataclass(frozen=True, eq=False)
class Truth:
    """Poses of the camera, or None, and in words where they are from or why there are none."""

    trajectory: Trajectory | None
    text: str


class BagTruth:
    """
    Finds the ground truth of one bag.

    Parameters
    ----------
    bag : BagFile
    stamps_ns : int64, (n,)
        Of the frames.
    camera : (str, str)
        Topic of the images, and the frame in their headers.
    options : TruthOptions
    stamps : str or None
        'log': poses have the log times, as the frames have.

    """

    def __init__(self, bag: BagFile, stamps_ns: NDArray[np.int64], camera: tuple[str, str],
                 options: TruthOptions | None = None, stamps: str | None = None) -> None:
        self._bag, self._frames_ns = bag, stamps_ns
        self._options = options or TruthOptions()
        self._images = camera
        self._by_log = stamps == LOG

    @cached_property
    def _tree(self) -> FrameTree:
        # Minutes of /tf take seconds to read: only where they are looked at.
        return FrameTree(self._bag, self._by_log)

    @cached_property
    def _camera(self) -> str:
        """Return the camera's frame: as asked for, that of the images, or of camera_info."""
        topic, of_images = self._images
        chosen = (self._options.camera_frame or of_images).strip('/')
        if self._options.camera_frame or chosen in self._tree:
            return chosen
        infos = [name for name in self._bag.of_type(CAMERA_INFO)
                 if topic.startswith(name.rsplit('/', 1)[0] + '/')]
        for name in sorted(infos, key=len, reverse=True):
            frame = ends_of(self._bag, name)[0]
            if frame in self._tree:
                return frame
        return chosen

    def find(self, ground_truth: Path | str | None) -> Truth:
        """
        Return the ground truth that was asked for, or the only one there is.

        Parameters
        ----------
        ground_truth : Path, str or None
            A topic, a file, or 'none'; None: a groundtruth.txt beside a single-file bag, else
            /ground_truth, else the only topic or chain of /tf that can be it.

        Raises
        ------
        SequenceError
            What was asked for is no ground truth, or several topics can be.

        """
        if ground_truth == NO_TRUTH:
            return Truth(None, 'none was asked for')
        if ground_truth is not None:
            return self._named(str(ground_truth))
        beside = self._bag.path.parent / TRUTH_FILE
        if self._bag.path.is_file() and beside.exists():
            return self._file(beside)
        if TRUTH_TOPIC in self._bag.of_type(*POSE_TYPES):
            return self._topic(TRUTH_TOPIC)
        return self._only()

    def _named(self, name: str) -> Truth:
        topic = name if name in self._bag.topics else '/' + name.strip('/')
        kind = self._bag.topics.get(topic)
        if topic == _TF_TOPIC or kind in (TF, *OLD_TF):
            return self._tf(self._tf_chains())
        if kind is None:
            if Path(name).is_file():
                return self._file(Path(name))
            raise SequenceError(f'there is neither a topic nor a file {name!r}; bag '
                                f'{self._bag.path} has {self._there()}')
        if kind in POSE_TYPES and self._bag.counts[topic]:
            return self._topic(topic)
        raise SequenceError(f'bag {self._bag.path}: {topic} is {kind}, '
                            f'{self._bag.counts[topic]} messages; poses are on {self._there()}')

    def _there(self) -> str:
        topics = self._bag.of_type(*POSE_TYPES, TF, *OLD_TF)
        return ', '.join(f'{topic} ({self._kind(topic)})' for topic in topics) or 'no poses'

    def _kind(self, topic: str) -> str:
        return self._bag.topics[topic].rsplit('/', 1)[-1]

    def _only(self) -> Truth:
        """Return the only source there is, or say why there is none."""
        refused = {topic: reason for topic in self._bag.of_type(*POSE_TYPES)
                   if (reason := reason_against(self._bag, topic))}
        topics = [topic for topic in self._bag.of_type(*POSE_TYPES) if topic not in refused]
        chains = self._tf_chains()
        found = [f'{topic} ({self._kind(topic)})' for topic in topics]
        if chains and not self._is_odometry(topics, chains):
            found += [f'/tf ({chain_text(chain)})' for chain in chains]
        if len(found) > 1:
            tf = (' (and --fixed-frame ' + ' or '.join(chain[0].parent for chain in chains) + ')'
                  if len(chains) > 1 else '')
            raise SequenceError(
                f'bag {self._bag.path} has poses on {", ".join(found)}: name the topic of the '
                f'ground truth, such as --ground-truth {found[0].split()[0]}{tf}, a file, or '
                f'"{NO_TRUTH}"')
        if topics:
            mount = self._mount(topics[0])
            if isinstance(mount, str):
                return Truth(None, mount)
            return self._topic(topics[0])
        if chains:
            return self._tf(chains)
        return Truth(None, self._why_none(refused))

    def _why_none(self, refused: dict[str, str]) -> str:
        reasons = [f'{topic} ({self._kind(topic)}) is {reason}'
                   for topic, reason in refused.items()]
        if self._tree.links:
            above = ', '.join(self._tree.above(self._camera))
            reasons.append(
                f'/tf has {self._tree.text()}: the camera {self._camera!r} '
                + (f'does not move in {above}' if above else 'hangs from no frame there'))
        return (f'{"; ".join(reasons) or "the bag has no poses"}; give a topic or a file with '
                '--ground-truth')

    def _is_odometry(self, topics: list[str], chains: list[list[Link]]) -> bool:
        """Tell whether the one motion in /tf is what the one topic says, too."""
        if len(topics) != 1 or len(chains) != 1:
            return False
        parent, child = ends_of(self._bag, topics[0])
        moving = [(link.parent, link.child) for link in chains[0] if link.moves]
        return bool(child) and (parent, child) in moving and len(moving) == 1

    # poses on a topic ----------------------------------------------------------------------

    def _mount(self, topic: str) -> list[Link] | str:
        """Return the links from the frame of a topic's poses to the camera, or what is missing."""
        body = ends_of(self._bag, topic)[1] or self._options.body_frame
        if not body or self._options.extrinsics is not None:
            return []
        chain = self._tree.chain(body.strip('/'), self._camera)
        if chain is not None:
            return chain
        known = f'/tf has {self._tree.text()}' if self._tree.links else 'the bag has no /tf'
        return (f'{topic} ({self._kind(topic)}) has poses of {body!r}, and there is no single '
                f'chain from it to the camera {self._camera!r} ({known}): give the camera in that '
                'frame with --extrinsics TX TY TZ QX QY QZ QW, or "--extrinsics identity" if they '
                'are the same, or another --camera-frame')

    def _topic(self, topic: str) -> Truth:
        try:
            poses, repeated = topic_poses(self._bag, topic, self._by_log)
            poses, parent = by_number(poses, self._frames_ns, topic), poses.frame_id
            mount = [] if parent == PLACE_INDEX else self._mount(topic)
            if isinstance(mount, str):
                raise SequenceError(mount)
            body = Link(parent, ends_of(self._bag, topic)[1] or 'camera', poses, moves=True)
            chain = [*self._above(parent), body, *mount]
            trajectory = compose(chain) if len(chain) > 1 else poses
        except SequenceError as error:
            where = '' if topic in str(error) else f', {topic}'
            raise SequenceError(f'bag {self._bag.path}{where}: {error}') from None
        text = f'{topic} ({self._kind(topic)}), {chain_text(chain)}'
        if self._bag.topics[topic] == ODOMETRY:
            text += '; odometry drifts, and labels with it'
        if repeated:
            text += f'; left out: {repeated} with the stamp of the pose before'
        return self._mounted(Truth(trajectory, text))

    def _above(self, parent: str) -> list[Link]:
        fixed = self._options.fixed_frame
        if not fixed or fixed.strip('/') == parent:
            return []
        chain = self._tree.chain(fixed.strip('/'), parent)
        if chain is None:
            raise SequenceError(f'/tf has no single chain from the fixed frame {fixed!r} to '
                                f'{parent!r}; it has {self._tree.text() or "no frames"}')
        return chain

    # /tf and files --------------------------------------------------------------------------

    def _tf_chains(self) -> list[list[Link]]:
        fixed = self._options.fixed_frame
        if fixed is None:
            return fixed_frames(self._tree, self._camera)
        chain = self._tree.chain(fixed.strip('/'), self._camera)
        return [chain] if chain else []

    def _tf(self, chains: list[list[Link]]) -> Truth:
        where = f'bag {self._bag.path}: /tf'
        if not chains:
            raise SequenceError(
                f'{where} has no single moving chain from '
                f'{self._options.fixed_frame or "a fixed frame"} to the camera {self._camera!r}; '
                f'it has {self._tree.text() or "no frames"}; give --fixed-frame, --camera-frame, '
                f'another source with --ground-truth, or "{NO_TRUTH}"')
        if len(chains) > 1:
            raise SequenceError(f'{where} has the camera in '
                                f'{", ".join(chain[0].parent for chain in chains)}: name one with '
                                '--fixed-frame')
        try:
            trajectory = compose(chains[0])
        except SequenceError as error:
            raise SequenceError(f'{where}: {error}') from None
        return self._mounted(Truth(trajectory, f'/tf, {chain_text(chains[0])}'))

    def _file(self, path: Path) -> Truth:
        return self._mounted(Truth(read_poses(path, self._frames_ns), str(path)))

    def _mounted(self, truth: Truth) -> Truth:
        mount = self._options.extrinsics
        if mount is None or truth.trajectory is None:
            return truth
        return Truth(mounted(truth.trajectory, mount), f'{truth.text}, with the extrinsics given')
