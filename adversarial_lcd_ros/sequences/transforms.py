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
    if not any(parent == WORLD for parent, _ in links):
        return None
    chain = _chain(set(links), camera_frame.strip('/'), bag)
    moving, *mount = [_trajectory(links[link]) for link in chain]
    turn, position = Rotation.from_quat(moving.quaternion), moving.position.copy()
    for (_, frame), link in zip(chain[1:], mount, strict=True):
        _check_still(frame, link, bag)
        # A copy: Rotation.apply refuses read-only arrays.
        position = position + turn.apply(link.position[0].copy())
        turn = turn * Rotation.from_quat(link.quaternion[0])
    return Trajectory(moving.stamp_ns, position, turn.as_quat(), WORLD)


def _links(bag: BagFile) -> dict[tuple[str, str], list[tuple[float, ...]]]:
    """Return stamp, position and quaternion of each link (parent, child) in /tf."""
    rows: defaultdict[tuple[str, str], list[tuple[float, ...]]] = defaultdict(list)
    for topic, _, wire in bag.messages(bag.of_type(TF, *OLD_TF)):
        for link in bag.decode(topic, wire).transforms:
            stamp = link.header.stamp
            move, turn = link.transform.translation, link.transform.rotation
            rows[link.header.frame_id.strip('/'), link.child_frame_id.strip('/')].append(
                (stamp.sec * 1_000_000_000 + stamp.nanosec, move.x, move.y, move.z,
                 turn.x, turn.y, turn.z, turn.w))
    return rows


def _trajectory(rows: list[tuple[float, ...]]) -> Trajectory:
    # Several publishers share /tf, so it is in order of arrival, and a stamp may come twice.
    stamps, first = np.unique(np.array([row[0] for row in rows], np.int64), return_index=True)
    poses: NDArray[np.float64] = np.array([row[1:] for row in rows])[first]
    return Trajectory(stamps, poses[:, :3], poses[:, 3:])


def _chain(links: set[tuple[str, str]], camera_frame: str,
           bag: BagFile) -> list[tuple[str, str]]:
    """Return the links from world to the camera."""
    chain: list[tuple[str, str]] = []
    frame = camera_frame
    while frame != WORLD:
        above = sorted(link for link in links if link[1] == frame)
        # On a robot the camera may hang from its odometry as well: motion capture wins.
        link = (WORLD, frame) if (WORLD, frame) in above else above[0] if len(above) == 1 else None
        if link is None or link in chain:
            known = ', '.join(f'{parent} > {child}' for parent, child in sorted(links))
            raise SequenceError(
                f'bag {bag.path}: /tf has no single chain from {WORLD} to the camera frame '
                f'{camera_frame!r}; it has {known}; give the ground truth as a file, or "none"')
        chain.append(link)
        frame = link[0]
    return chain[::-1]


def _check_still(frame: str, link: Trajectory, bag: BagFile) -> None:
    # q and -q are the same rotation.
    same = np.sign(link.quaternion @ link.quaternion[0])[:, None] * link.quaternion
    if (np.abs(link.position - link.position[0]).max() > _STILL_M
            or np.abs(same - link.quaternion[0]).max() > _STILL_QUATERNION):
        raise SequenceError(
            f'bag {bag.path}: in /tf the frame {frame} moves in {WORLD} and in its parent: only '
            'a rigid mount can be composed; give the ground truth as a file, or "none"')
