# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The node map_builder: decisions of lcd and odometry in, the map that they make out.

It believes what it is sent, as a back end does that asks nobody: in RViz or Foxglove one sees what
forged closures do to it. A closure claims that the camera is where it was.
"""

from __future__ import annotations

from adversarial_lcd_ros.start import run_node_process

if __name__ == '__main__':  # before the other imports: they take a second, and Ctrl-C may come
    raise SystemExit(run_node_process('map_builder'))

from bisect import bisect_left
from collections import deque
from collections.abc import Sequence
import importlib
import importlib.util
import math
import time
from typing import Any

from geometry_msgs.msg import PoseStamped, TransformStamped
from nav_msgs.msg import Odometry, Path
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from std_msgs.msg import Header, UInt8MultiArray

from adversarial_lcd_ros.config import MapBuilderNodeConfig, MapConfig
from adversarial_lcd_ros.errors import CodecError, EvaluationError
from adversarial_lcd_ros.messages.checks import checked_stamp_ns
from adversarial_lcd_ros.messages.codec import decode_loop_closure
from adversarial_lcd_ros.messages.payload import unwrap
from adversarial_lcd_ros.messages.types import LoopClosure
from adversarial_lcd_ros.nodes.endpoints import MirroredSubscription
from adversarial_lcd_ros.nodes.runtime import Manual, PipelineNode, run_node
from adversarial_lcd_ros.poses.trajectory import NORM_TOLERANCE
from adversarial_lcd_ros.settings import NODE_CONFIGS
from adversarial_lcd_ros.slam.growing import GrowingMap
from adversarial_lcd_ros.slam.odometry import drifting

TF = '/tf'
# Odometry that waits for decisions, and decisions that wait for odometry.
_MOST_POSES, _MOST_DECISIONS = 20_000, 1000


class MapBuilderNode(PipelineNode):
    """Runs a GrowingMap on topics."""

    default_name = 'map_builder'
    configs = NODE_CONFIGS['map_builder']
    manual = Manual(
        'the map that loop closures and odometry make, frame by frame',
        subscribes=('loop_closures (std_msgs/UInt8MultiArray, LoopClosure)',
                    'odom (nav_msgs/Odometry), or, with odometry:=truth, ground_truth '
                    '(geometry_msgs/PoseStamped)'),
        publishes=('path (nav_msgs/Path): the whole map, after each decision',
                   '/tf (tf2_msgs/TFMessage): map to odom, where tf2_msgs is installed',
                   '/diagnostics (diagnostic_msgs/DiagnosticArray): counts, poses, latency'))

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        config, self._limits = self.settings
        self._config: MapBuilderNodeConfig = config
        self._odometry = Waiting(round(config.odometry_tolerance_s * 1e9))
        self._drift = Drift(config) if config.odometry == 'truth' else None
        self._pending: deque[LoopClosure] = deque(maxlen=_MOST_DECISIONS)
        self._odom_frame = config.odom_frame
        self._begin()
        self._path = self.create_publisher(Path, 'path', 10)
        self._transforms = _transform_publisher(self)
        MirroredSubscription(self, UInt8MultiArray, 'loop_closures', 'loop closure',
                             self._on_decision, raw=True)
        if self._drift:
            MirroredSubscription(self, PoseStamped, 'ground_truth', 'pose', self._on_truth)
        else:
            MirroredSubscription(self, Odometry, 'odom', 'odometry', self._on_odometry)
        self.diagnostics.gauges['poses'] = lambda: len(self.map)
        self.diagnostics.gauges['closures'] = lambda: self.map.closures
        self.say_ready(f'back end {config.back_end}, odometry from {config.odometry}'
                       + ('' if self._transforms else '; no /tf, tf2_msgs is not installed'))

    def _begin(self) -> None:
        config = self._config
        self.map = GrowingMap(
            config.back_end, _sigma(config.step_rotation_deg, config.step_translation_m),
            _sigma(config.closure_rotation_deg, config.closure_translation_m), MapConfig())
        self._stamps: list[int] = []
        self._session = 0

    def _on_odometry(self, message: Any) -> None:
        self.diagnostics.count('received odometry')
        self._odom_frame = message.header.frame_id or self._config.odom_frame
        self._odometry.add(_stamp_ns(message.header), _matrix(message.pose.pose))
        self._work()

    def _on_truth(self, message: Any) -> None:
        self.diagnostics.count('received poses')
        assert self._drift is not None
        stamp_ns, pose = _stamp_ns(message.header), _matrix(message.pose)
        self._odometry.add(stamp_ns, self._drift.after(pose))
        self._work()

    def _on_decision(self, wire: bytes) -> None:
        self.diagnostics.count('received loop closures')
        decision = decode_loop_closure(unwrap(wire, self._limits.max_payload_bytes))
        if len(self._pending) == self._pending.maxlen:
            self.diagnostics.worry('without odometry', 'decisions wait for odometry: the oldest '
                                   'one is left out')
        self._pending.append(decision)
        self._work()

    def _work(self) -> None:
        """Take the decisions that have their odometry, or will never have it."""
        while self._pending:
            decision = self._pending[0]
            if not self._odometry.has_come_to(decision.stamp_ns):
                return
            self._pending.popleft()
            pose = self._odometry.at(decision.stamp_ns)
            if pose is None:
                self.diagnostics.worry('without odometry', 'no odometry within '
                                       f'{self._config.odometry_tolerance_s:g} s of a decision')
            else:
                self._add(decision, pose)

    def _add(self, decision: LoopClosure, odometry: NDArray[np.float64]) -> None:
        began_s = time.perf_counter()
        has_restarted = decision.session != self._session and bool(self._stamps)
        if has_restarted or (self._stamps and decision.stamp_ns <= self._stamps[-1]):
            self.diagnostics.worry('maps begun anew', 'time went back, or lcd was started again')
            self._begin()
        if len(self.map) >= self._config.max_poses:
            self.diagnostics.worry('without room', f'the map has {len(self.map)} poses, as many '
                                   'as max_poses allows')
            return
        self._session = decision.session
        try:
            self.map.add(odometry, self._match(decision))
        except EvaluationError:
            self._begin()
            raise
        self._stamps.append(decision.stamp_ns)
        self._publish(decision.stamp_ns, odometry)
        self.diagnostics.time(time.perf_counter() - began_s)

    def _match(self, decision: LoopClosure) -> int | None:
        """Return which pose of the map a decision closes a loop with; None without a loop."""
        if not decision.is_loop or decision.match_stamp_ns is None:
            return None
        at = bisect_left(self._stamps, decision.match_stamp_ns)
        if at < len(self._stamps) and self._stamps[at] == decision.match_stamp_ns:
            return at
        self.diagnostics.count('closures with a frame that is not in the map')
        return None

    def _publish(self, stamp_ns: int, odometry: NDArray[np.float64]) -> None:
        header = _header(stamp_ns, self._config.map_frame)
        # The whole path is long: it is made for those who look.
        if self._path.get_subscription_count():
            self._path.publish(_path(header, self._stamps, self.map.poses, self._config.map_frame))
        self.diagnostics.count('published maps')
        if self._transforms:
            to_odom = self.map.poses[-1] @ np.linalg.inv(odometry)
            self._transforms.publish(_transform(header, self._odom_frame, to_odom))


class Waiting:
    """
    Poses of the odometry, until a decision asks for one of them; bounded.

    Parameters
    ----------
    tolerance_ns : int
        Largest offset in time.

    """

    def __init__(self, tolerance_ns: int) -> None:
        self._tolerance_ns = tolerance_ns
        self._poses: deque[tuple[int, NDArray[np.float64]]] = deque(maxlen=_MOST_POSES)

    def add(self, stamp_ns: int, pose: NDArray[np.float64]) -> None:
        """Keep a pose; one from before the last begins another run."""
        if self._poses and stamp_ns < self._poses[-1][0]:
            self._poses.clear()
        self._poses.append((stamp_ns, pose))

    def has_come_to(self, stamp_ns: int) -> bool:
        """Tell whether no pose that is still to come can be nearer to a stamp."""
        return bool(self._poses) and self._poses[-1][0] >= stamp_ns

    def at(self, stamp_ns: int) -> NDArray[np.float64] | None:
        """Return the pose nearest to a stamp, and forget older ones; None if none is near."""
        while len(self._poses) > 1 and (abs(self._poses[1][0] - stamp_ns)
                                        <= abs(self._poses[0][0] - stamp_ns)):
            self._poses.popleft()
        if not self._poses or abs(self._poses[0][0] - stamp_ns) > self._tolerance_ns:
            return None
        return self._poses[0][1]


class Drift:
    """
    Odometry made of the truth, a step at a time, with the errors of the command "map".

    Parameters
    ----------
    config : MapBuilderNodeConfig

    """

    def __init__(self, config: MapBuilderNodeConfig) -> None:
        self._drift = config.drift
        self._rng = np.random.default_rng(config.seed)
        self._truth: NDArray[np.float64] | None = None
        self._pose = np.eye(4)

    def after(self, truth: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where the odometry is after the next true pose, (4, 4)."""
        if self._truth is None:
            self._pose = truth
        else:
            step = drifting(np.stack([self._truth, truth]), MapConfig(), self._drift, self._rng)
            self._pose = self._pose @ step.steps[0]
        self._truth = truth
        return self._pose


def _sigma(rotation_deg: float, translation_m: float) -> NDArray[np.float64]:
    return np.repeat([math.radians(rotation_deg), translation_m], 3)


def _stamp_ns(header: Any) -> int:
    return checked_stamp_ns(header.stamp.sec, header.stamp.nanosec)


def _matrix(pose: Any) -> NDArray[np.float64]:
    """Return a pose as (4, 4); raises CodecError."""
    at, turn = pose.position, pose.orientation
    place = np.array([at.x, at.y, at.z])
    quaternion = np.array([turn.x, turn.y, turn.z, turn.w])
    norm = float(np.linalg.norm(quaternion))
    if not (np.isfinite(place).all() and abs(norm - 1) <= NORM_TOLERANCE):
        raise CodecError(f'pose at {place.tolist()} with a quaternion of norm {norm:.3g}: '
                         'expected finite metres and a unit quaternion', cause='pose')
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = Rotation.from_quat(quaternion).as_matrix(), place
    return matrix


def _header(stamp_ns: int, frame: str) -> Header:
    header = Header(frame_id=frame)
    header.stamp.sec, header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
    return header


def _path(header: Header, stamps: Sequence[int], poses: NDArray[np.float64],
          frame: str) -> Path:
    quaternion = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    path = Path(header=header)
    for stamp, place, turn in zip(stamps, poses[:, :3, 3].tolist(), quaternion.tolist(),
                                  strict=True):
        pose = PoseStamped(header=_header(stamp, frame))
        at, orientation = pose.pose.position, pose.pose.orientation
        at.x, at.y, at.z = place
        orientation.x, orientation.y, orientation.z, orientation.w = turn
        path.poses.append(pose)
    return path


def _transform(header: Header, child: str, motion: NDArray[np.float64]) -> Any:
    transform = TransformStamped(header=header, child_frame_id=child)
    at, turn = transform.transform.translation, transform.transform.rotation
    at.x, at.y, at.z = motion[:3, 3].tolist()
    turn.x, turn.y, turn.z, turn.w = Rotation.from_matrix(motion[:3, :3]).as_quat().tolist()
    return importlib.import_module('tf2_msgs.msg').TFMessage(transforms=[transform])


def _transform_publisher(node: PipelineNode) -> Any | None:
    # PyPI's wheels of ROS have no tf2_msgs; every installation of ROS 2 has.
    if importlib.util.find_spec('tf2_msgs') is None:
        return None
    return node.create_publisher(importlib.import_module('tf2_msgs.msg').TFMessage, TF, 100)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; return its exit code."""
    return run_node(MapBuilderNode, args)
