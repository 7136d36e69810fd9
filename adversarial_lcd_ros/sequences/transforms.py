# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The frames of /tf and /tf_static: chains of links, composed to the camera's trajectory."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.poses.trajectory import WORLD, Trajectory
from adversarial_lcd_ros.sequences.bagfile import OLD_TF, TF, BagFile

# A mount is published again and again: what wanders less than this stands still.
_STILL_M = 1e-4
_STILL_QUATERNION = 1e-4
_STATIC = 'tf_static'
# Like tf2, interpolate between two poses of a link however far apart they are.
_ANY_DISTANCE_NS = 2**62


@dataclass(frozen=True, eq=False)
class Link:
    """
    A frame in its parent.

    Attributes
    ----------
    parent, child : str
    poses : Trajectory
        The child in the parent.
    moves : bool
        False for a mount: its first pose holds at all times.

    """

    parent: str
    child: str
    poses: Trajectory
    moves: bool

    def at(self, stamps_ns: NDArray[np.int64]) -> tuple[NDArray[np.float64], Rotation]:
        """Return positions, (n, 3) or (3,), and rotations at stamps within the link's time."""
        if not self.moves:
            # A copy: Rotation.apply refuses read-only arrays.
            return self.poses.position[0].copy(), Rotation.from_quat(self.poses.quaternion[0])
        poses = self.poses.at(stamps_ns, _ANY_DISTANCE_NS)
        return poses.position.copy(), Rotation.from_quat(poses.quaternion)


class FrameTree:
    """
    All links of a bag by (parent, child).

    Parameters
    ----------
    bag : BagFile
    by_log : bool
        Stamp moving links with the log times.

    Raises
    ------
    SequenceError
        A transform is no pose.

    """

    def __init__(self, bag: BagFile, by_log: bool = False) -> None:
        self.topics = bag.of_type(TF, *OLD_TF)
        rows, static = _rows(bag, self.topics, by_log)
        self.links = {ends: _link(bag, ends, found, ends in static)
                      for ends, found in rows.items()}
        self._parents: defaultdict[str, list[str]] = defaultdict(list)
        for parent, child in sorted(self.links):
            self._parents[child].append(parent)

    def __contains__(self, frame: str) -> bool:
        return any(frame in ends for ends in self.links)

    def above(self, frame: str) -> list[str]:
        """Return the frames above a frame, the nearest first."""
        found: list[str] = []
        waiting = [frame]
        for at in waiting:
            for parent in self._parents[at]:
                if parent not in found and parent != frame:
                    found.append(parent)
                    waiting.append(parent)
        return found

    def chain(self, top: str, bottom: str) -> list[Link] | None:
        """Return the links from one frame down to another; None: no chain, or several."""
        if top == bottom:
            return []
        # Only what hangs below the top: whatever is climbed arrives there.
        below = {frame for frame in (bottom, *self.above(bottom)) if top in self.above(frame)}
        paths = self._climb(bottom, top, below, (bottom,))
        first, second = next(paths, None), next(paths, None)
        if first is None or second is not None:
            return None
        frames = first[::-1]
        return [self.links[ends] for ends in pairwise(frames)]

    def _climb(self, frame: str, top: str, below: set[str],
               path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
        for parent in self._parents[frame]:
            if parent == top:
                yield (*path, top)
            elif parent in below and parent not in path:
                yield from self._climb(parent, top, below, (*path, parent))

    def text(self) -> str:
        """Return all links in words."""
        return ', '.join(f'{parent} > {child}' for parent, child in sorted(self.links))


def fixed_frames(tree: FrameTree, camera: str) -> list[list[Link]]:
    """
    Return the chains to the camera that could be its trajectory, one for each motion.

    Frames with nothing but mounts between them see the same motion: the topmost stands for
    them. 'world', where it is one, is motion capture or a simulator and stands for all.
    """
    by_motion: dict[tuple[tuple[str, str], ...], list[Link]] = {}
    for top in tree.above(camera):
        chain = tree.chain(top, camera)
        motion = tuple((link.parent, link.child) for link in chain or () if link.moves)
        if chain and motion and (top == WORLD or motion not in by_motion
                                 or len(by_motion[motion]) < len(chain)):
            by_motion[motion] = chain
    chains = list(by_motion.values())
    return [chain for chain in chains if chain[0].parent == WORLD] or chains


def compose(chain: Sequence[Link]) -> Trajectory:
    """
    Return the last frame of a chain in its first one, at the stamps of the busiest link.

    Raises
    ------
    SequenceError
        Nothing moves, or the moving links have no time in common.

    """
    moving = [link.poses.stamp_ns for link in chain if link.moves]
    if not moving:
        raise SequenceError(f'{chain_text(chain)} does not move: expected a camera that does')
    stamps = max(moving, key=len)
    stamps = stamps[(stamps >= max(link[0] for link in moving))
                    & (stamps <= min(link[-1] for link in moving))]
    if not len(stamps):
        raise SequenceError(f'the moving links of {chain_text(chain)} have no time in common')
    position, turn = np.zeros((len(stamps), 3)), Rotation.identity(len(stamps))
    for link in chain:
        offset, rotation = link.at(stamps)
        position, turn = position + turn.apply(offset), turn * rotation
    return Trajectory(stamps, position, turn.as_quat(), chain[0].parent)


def chain_text(chain: Sequence[Link]) -> str:
    """Return the frames of a chain in words."""
    return ' > '.join((chain[0].parent, *(link.child for link in chain)))


Ends = tuple[str, str]


def _rows(bag: BagFile, topics: list[str], by_log: bool,
          ) -> tuple[dict[Ends, list[tuple[float, ...]]], set[Ends]]:
    """Return stamp, position and quaternion of each link, and which links are static."""
    rows: defaultdict[Ends, list[tuple[float, ...]]] = defaultdict(list)
    static: set[Ends] = set()
    for topic, log_ns, wire in bag.messages(topics):
        for link in bag.decode(topic, wire).transforms:
            ends = link.header.frame_id.strip('/'), link.child_frame_id.strip('/')
            stamp = link.header.stamp
            move, turn = link.transform.translation, link.transform.rotation
            stamp_ns = log_ns if by_log else stamp.sec * 1_000_000_000 + stamp.nanosec
            rows[ends].append((stamp_ns, move.x, move.y, move.z, turn.x, turn.y, turn.z, turn.w))
            if topic.rsplit('/', 1)[-1] == _STATIC:
                static.add(ends)
    return rows, static


def _link(bag: BagFile, ends: Ends, rows: list[tuple[float, ...]], static: bool) -> Link:
    # Several publishers share /tf, so it is in order of arrival, and a stamp may come twice.
    stamps, first = np.unique(np.array([row[0] for row in rows], np.int64), return_index=True)
    poses: NDArray[np.float64] = np.array([row[1:] for row in rows])[first]
    try:
        found = Trajectory(stamps, poses[:, :3], poses[:, 3:], ends[0])
    except SequenceError as error:
        raise SequenceError(f'bag {bag.path}, /tf, {" > ".join(ends)}: {error}') from None
    return Link(*ends, found, moves=not static and not _stands_still(found))


def _stands_still(poses: Trajectory) -> bool:
    # q and -q are the same rotation.
    same = np.sign(poses.quaternion @ poses.quaternion[0])[:, None] * poses.quaternion
    return bool(np.abs(poses.position - poses.position[0]).max() <= _STILL_M
                and np.abs(same - poses.quaternion[0]).max() <= _STILL_QUATERNION)
