# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node map_builder: decisions and odometry in, the map out; in process, with real ROS."""

from map_factory import wavy
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_slam import needs_gtsam

pytest.importorskip('rclpy', reason='rclpy is not installed')

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path

from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.payload import wrap
from adversarial_lcd_ros.messages.types import LoopClosure
from adversarial_lcd_ros.nodes.map_builder import TF, Drift, MapBuilderNode, Waiting
from adversarial_lcd_ros.settings import NODE_CONFIGS

pytestmark = needs_gtsam

COUNT, PERIOD_NS = 20, 200_000_000
TRUTH = wavy(COUNT, 1)
START_NS = 7_000_000_000
# The last frame is half a lap from the tenth.
FALSE = {COUNT - 1: 9}


def stamp(frame):
    return START_NS + frame * PERIOD_NS


def fill(pose, matrix):
    at, turn = pose.position, pose.orientation
    at.x, at.y, at.z = matrix[:3, 3].tolist()
    turn.x, turn.y, turn.z, turn.w = Rotation.from_matrix(matrix[:3, :3]).as_quat().tolist()


def odometry(frame):
    message = Odometry()
    message.header.frame_id = 'odom'
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp(frame), 10**9)
    fill(message.pose.pose, TRUTH[frame])
    return message


def decision(frame, false=FALSE, session=5):
    match = false.get(frame)
    named = {} if match is None else {'match_stamp_ns': stamp(match), 'match_sequence': match}
    return wrap(codec.encode_loop_closure(LoopClosure(
        stamp(frame), 'camera', frame, match is not None, 0.9 if named else 0.1, session=session,
        candidates=int(bool(named)), **named)))


def world(ros, **parameters):
    node = ros.start(MapBuilderNode, **parameters)
    paths = ros.collect('path', lambda message: message, Path, raw=False)
    is_truth = parameters.get('odometry') == 'truth'
    moved = (ros.publisher('ground_truth', PoseStamped) if is_truth
             else ros.publisher('odom', Odometry))
    decided = ros.publisher('loop_closures')
    for publisher in (moved, decided):
        ros.matched(publisher)
    ros.until(node._path.get_subscription_count)
    return node, paths, moved, decided


def positions(path):
    return np.array([[pose.pose.position.x, pose.pose.position.y, pose.pose.position.z]
                     for pose in path.poses])


def walk(ros, paths, moved, decided, frames=COUNT, **options):
    for frame in range(frames):
        moved.publish(odometry(frame))
        decided.publish(decision(frame, **options))
    ros.until(lambda: paths and len(paths[-1].poses) == frames)
    return positions(paths[-1])


def test_without_closures_the_map_is_the_odometry(ros):
    node, paths, moved, decided = world(ros)
    assert np.allclose(walk(ros, paths, moved, decided, false={}), TRUTH[:, :3, 3], atol=1e-5)
    assert paths[-1].header.frame_id == 'map'
    assert (len(node.map), node.map.closures) == (COUNT, 0)


@pytest.mark.parametrize(('back_end', 'bends'), [('least_squares', True), ('cauchy', False)])
def test_a_forged_closure_bends_the_map_of_those_who_believe_it(ros, back_end, bends):
    node, paths, moved, decided = world(ros, back_end=back_end)
    found = walk(ros, paths, moved, decided)
    assert node.map.closures == 1
    off = np.linalg.norm(found - TRUTH[:, :3, 3], axis=1).max()
    assert off > 0.5 if bends else off < 0.3


def test_decisions_wait_for_their_odometry(ros):
    node, paths, moved, decided = world(ros)
    for frame in range(3):
        decided.publish(decision(frame))
    ros.until(lambda: node.diagnostics['received loop closures'] == 3)
    assert len(node.map) == 0
    for frame in range(3):
        moved.publish(odometry(frame))
    ros.until(lambda: paths and len(paths[-1].poses) == 3)


def test_a_decision_without_odometry_is_counted(ros):
    node, paths, moved, decided = world(ros, odometry_tolerance_s=0.01)
    moved.publish(odometry(0))
    moved.publish(odometry(2))
    for frame in range(3):
        decided.publish(decision(frame))
    ros.until(lambda: paths and len(paths[-1].poses) == 2)
    assert node.diagnostics['without odometry'] == 1


def test_a_pose_that_is_none_is_refused_and_survived(ros):
    node, paths, moved, decided = world(ros)
    for spoil in ('nan', 'norm', 'stamp'):
        message = odometry(0)
        if spoil == 'nan':
            message.pose.pose.position.x = float('nan')
        elif spoil == 'norm':
            message.pose.pose.orientation.w = 9.0
        else:
            message.header.stamp.sec = -1
        moved.publish(message)
    ros.until(lambda: node.diagnostics['refused odometry: pose'] == 2
              and node.diagnostics['refused odometry: stamp'] == 1)
    walk(ros, paths, moved, decided, frames=4)


def test_another_run_of_lcd_begins_another_map(ros):
    node, paths, moved, decided = world(ros)
    walk(ros, paths, moved, decided, frames=4)
    moved.publish(odometry(4))
    decided.publish(decision(4, session=6))
    ros.until(lambda: len(paths[-1].poses) == 1)
    assert node.diagnostics['maps begun anew'] == 1


def test_a_full_map_takes_no_more(ros):
    node, _, moved, decided = world(ros, max_poses=3)
    for frame in range(5):
        moved.publish(odometry(frame))
        decided.publish(decision(frame))
    ros.until(lambda: node.diagnostics['without room'] == 2)
    assert len(node.map) == 3


def test_the_truth_with_drift_stands_in_for_odometry(ros):
    _, paths, moved, decided = world(ros, odometry='truth', drift=5.0)
    for frame in range(COUNT):
        message = PoseStamped(header=odometry(frame).header)
        fill(message.pose, TRUTH[frame])
        moved.publish(message)
        decided.publish(decision(frame, false={}))
    ros.until(lambda: paths and len(paths[-1].poses) == COUNT)
    off = np.linalg.norm(positions(paths[-1]) - TRUTH[:, :3, 3], axis=1)
    assert off[0] == pytest.approx(0, abs=1e-6)
    assert 0.01 < off[-1] < 5


def test_drift_of_nothing_is_the_truth():
    config = NODE_CONFIGS['map_builder'][0].from_mapping({'odometry': 'truth', 'drift': 0.0})
    drift = Drift(config)
    assert np.allclose([drift.after(pose) for pose in TRUTH], TRUTH)


def test_the_nearest_pose_is_taken_and_a_run_that_begins_again_forgets():
    waiting = Waiting(50)
    for at in (0, 100, 200):
        waiting.add(at, np.full((4, 4), at))
    assert waiting.has_come_to(190)
    assert not waiting.has_come_to(210)
    assert waiting.at(90)[0, 0] == 100
    assert waiting.at(149)[0, 0] == 100
    assert waiting.at(400) is None
    waiting.add(10, np.eye(4))
    assert not waiting.has_come_to(190)


def test_the_transform_leads_from_the_map_to_the_odometry(ros):
    tf = pytest.importorskip('tf2_msgs.msg', reason='tf2_msgs is not installed (no wheel has it)')
    _, paths, moved, decided = world(ros, back_end='least_squares')
    found = ros.collect(TF, lambda message: message.transforms[0], tf.TFMessage, raw=False)
    walk(ros, paths, moved, decided)
    ros.until(lambda: len(found) == COUNT)
    assert (found[-1].header.frame_id, found[-1].child_frame_id) == ('map', 'odom')
