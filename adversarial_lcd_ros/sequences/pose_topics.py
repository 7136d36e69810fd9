# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics of poses in a bag: what they are, and their poses."""

from __future__ import annotations

from collections.abc import Iterator
import re
from typing import Any

import numpy as np

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.poses.trajectory import Trajectory
from adversarial_lcd_ros.sequences.bagfile import POSE, BagFile
from adversarial_lcd_ros.sequences.stamps import REMEDY

POSE_COVARIANCE = 'geometry_msgs/msg/PoseWithCovarianceStamped'
ODOMETRY, PATH = 'nav_msgs/msg/Odometry', 'nav_msgs/msg/Path'
TRANSFORM = 'geometry_msgs/msg/TransformStamped'
POSE_TYPES = (POSE, POSE_COVARIANCE, ODOMETRY, TRANSFORM, PATH)
# Where a robot is sent, or told that it is, is not where it was.
_WISHES = {'goal', 'goals', 'initialpose', 'target', 'setpoint', 'waypoint', 'waypoints', 'plan',
           'planned', 'plans', 'command', 'cmd', 'desired', 'reference'}
_FEWEST = 2


def ends_of(bag: BagFile, topic: str) -> tuple[str, str]:
    """Return the frame of the poses and the frame whose poses they are, '' if not said."""
    message = bag.decode(topic, next(iter(bag.messages([topic])))[2])
    return (message.header.frame_id.strip('/'),
            str(getattr(message, 'child_frame_id', '')).strip('/'))


def reason_against(bag: BagFile, topic: str) -> str:
    """Return why a topic of poses is not taken for ground truth unless it is named; or ''."""
    if set(re.split(r'[/_\-]', topic.lower())) & _WISHES:
        return 'by its name where a robot was to be, not where it was'
    if bag.topics[topic] == PATH:
        stamps = [_stamp_ns(pose.header) for pose in _last(bag, topic).poses]
        is_past = len(stamps) >= _FEWEST and bool((np.diff(stamps) > 0).all())
        return '' if is_past else 'a path to go: its poses have no times'
    count = bag.counts[topic]
    return f'{count} pose, no trajectory' if count < _FEWEST else ''


def topic_poses(bag: BagFile, topic: str, by_log: bool) -> tuple[Trajectory, int]:
    """
    Return the poses on a topic in the frame of their headers, and how many stamps repeated.

    Motion capture repeats a stamp now and then: the first pose is kept, as from a file.

    Parameters
    ----------
    bag : BagFile
    topic : str
        Of one of POSE_TYPES.
    by_log : bool
        Stamp the poses with the log times; those of a Path have none.

    Raises
    ------
    SequenceError
        There is no pose, the poses are in several frames, zero, or out of order.

    """
    rows = list(_rows(bag, topic, by_log))
    frames = sorted({frame for frame, *_ in rows})
    if len(frames) != 1:
        raise SequenceError(f'the poses are in several frames: {", ".join(frames)}' if frames
                            else 'there is no pose')
    stamps = np.array([stamp for _, stamp, _ in rows], np.int64)
    poses = np.array([pose for _, _, pose in rows], np.float64)
    if len(stamps) > 1 and not stamps.any():
        raise SequenceError(f'all {len(stamps)} poses are stamped 0: {REMEDY}')
    kept = np.r_[True, np.diff(stamps) != 0]
    parent = frames[0].split(' > ')[0]
    try:
        return (Trajectory(stamps[kept], poses[kept, :3], poses[kept, 3:], parent),
                int((~kept).sum()))
    except SequenceError as error:
        went_back = not by_log and bool((np.diff(stamps) < 0).any())
        raise SequenceError(f'{error}{": " + REMEDY if went_back else ""}') from None


def _rows(bag: BagFile, topic: str,
          by_log: bool) -> Iterator[tuple[str, int, tuple[float, ...]]]:
    """Yield the frames, the stamp, and position and quaternion of every pose."""
    if bag.topics[topic] == PATH:
        path = _last(bag, topic)
        for pose in path.poses:
            frame = (pose.header.frame_id or path.header.frame_id).strip('/')
            yield frame, _stamp_ns(pose.header), _pose(pose.pose)
        return
    for _, log_ns, wire in bag.messages([topic]):
        message = bag.decode(topic, wire)
        child = str(getattr(message, 'child_frame_id', ''))
        frame = message.header.frame_id.strip('/') + (f' > {child}' if child else '')
        stamp_ns = log_ns if by_log else _stamp_ns(message.header)
        if hasattr(message, 'transform'):
            yield frame, stamp_ns, _transform(message.transform)
        else:
            # With covariance there is a pose in the pose.
            yield frame, stamp_ns, _pose(getattr(message.pose, 'pose', message.pose))


def _last(bag: BagFile, topic: str) -> Any:
    *_, (_, _, wire) = bag.messages([topic])
    return bag.decode(topic, wire)


def _stamp_ns(header: Any) -> int:
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def _pose(pose: Any) -> tuple[float, ...]:
    place, turn = pose.position, pose.orientation
    return place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w


def _transform(transform: Any) -> tuple[float, ...]:
    place, turn = transform.translation, transform.rotation
    return place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w
