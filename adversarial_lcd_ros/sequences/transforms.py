"""The camera's trajectory from /tf, as in the ROS 1 bags of the TUM RGB-D benchmark."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.sequences.bagfile import OLD_TF, TF, BagFile
from adversarial_lcd_ros.sequences.trajectory import WORLD, Trajectory

# A mount is published again and again: what wanders less than this stands still.
_STILL_M = 1e-4
_STILL_QUATERNION = 1e-4


def tf_trajectory(bag: BagFile, camera_frame: str) -> Trajectory | None:
    """
    Return the poses of a camera in the frame 'world', or None if /tf does not know that frame.

    The chain from world to the camera is composed. Its first link (motion capture to marker
    set) moves and gives the stamps; the links behind it (the mount) stand still.

    Raises
    ------
    SequenceError
        The camera has no chain to world, or a link behind the first moves as well.

    """
    links = _links(bag)
    if not any(parent == WORLD for parent, _ in links.values()):
        return None
    chain = _chain(links, camera_frame, bag)
    first, *mount = [links[frame][1] for frame in chain]
    turn, position = Rotation.from_quat(first.quaternion), first.position.copy()
    for frame, link in zip(chain[1:], mount, strict=True):
        _check_still(frame, link, bag)
        # A copy: Rotation.apply refuses read-only arrays.
        position = position + turn.apply(link.position[0].copy())
        turn = turn * Rotation.from_quat(link.quaternion[0])
    return Trajectory(first.stamp_ns, position, turn.as_quat(), WORLD)


def _links(bag: BagFile) -> dict[str, tuple[str, Trajectory]]:
    """Return the parent of each frame, and its poses in the parent."""
    rows: defaultdict[str, list[tuple[float, ...]]] = defaultdict(list)
    parents: dict[str, str] = {}
    for topic, _, wire in bag.messages(bag.of_type(TF, *OLD_TF)):
        for link in bag.decode(topic, wire).transforms:
            child, parent = link.child_frame_id.strip('/'), link.header.frame_id.strip('/')
            if parents.setdefault(child, parent) != parent:
                raise SequenceError(f'bag {bag.path}: in /tf the frame {child} hangs from both '
                                    f'{parents[child]} and {parent}')
            stamp, move, turn = link.header.stamp, link.transform.translation, \
                link.transform.rotation
            rows[child].append((stamp.sec * 1_000_000_000 + stamp.nanosec, move.x, move.y, move.z,
                                turn.x, turn.y, turn.z, turn.w))
    return {child: (parent, _trajectory(rows[child])) for child, parent in parents.items()}


def _trajectory(rows: list[tuple[float, ...]]) -> Trajectory:
    # Several publishers share /tf, so it is in order of arrival, and a stamp may come twice.
    stamps, first = np.unique(np.array([row[0] for row in rows], np.int64), return_index=True)
    poses: NDArray[np.float64] = np.array([row[1:] for row in rows])[first]
    return Trajectory(stamps, poses[:, :3], poses[:, 3:])


def _chain(links: dict[str, tuple[str, Trajectory]], camera_frame: str,
           bag: BagFile) -> list[str]:
    """Return the frames from the one below world to the camera's."""
    chain: list[str] = []
    frame = camera_frame.strip('/')
    while frame != WORLD and frame in links and frame not in chain:
        chain.append(frame)
        frame = links[frame][0]
    if frame != WORLD or not chain:
        raise SequenceError(
            f'bag {bag.path}: /tf has no chain from {WORLD} to the camera frame '
            f'{camera_frame!r} (it knows {", ".join(sorted(links))}); give the ground truth as a '
            'file, or "none"')
    return chain[::-1]


def _check_still(frame: str, link: Trajectory, bag: BagFile) -> None:
    # q and -q are the same rotation.
    same = np.sign(link.quaternion @ link.quaternion[0])[:, None] * link.quaternion
    if (np.abs(link.position - link.position[0]).max() > _STILL_M
            or np.abs(same - link.quaternion[0]).max() > _STILL_QUATERNION):
        raise SequenceError(
            f'bag {bag.path}: in /tf the frame {frame} moves in {WORLD} and in its parent: only '
            'a rigid mount can be composed; give the ground truth as a file, or "none"')
