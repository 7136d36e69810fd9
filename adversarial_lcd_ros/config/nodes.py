# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings of a replay, and of nodes beside those of what they run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from adversarial_lcd_ros.config.base import Config, setting
from adversarial_lcd_ros.registry import NONE

# What makes a map, from the one that believes every closure to the one that leaves out most.
BACK_ENDS = ('least_squares', 'huber', 'cauchy', 'gnc')
POSTERS = (NONE, 'cells', 'noise', 'chessboard')


@dataclass(frozen=True)
class ReplayConfig(Config):
    """Replay of a bag."""

    title: ClassVar[str] = 'bag_replay'

    lockstep: bool = setting(
        False, 'Publish a frame, wait for the decision with the same stamp: nothing is lost.')
    window: int = setting(
        1, 'Lockstep: frames that may be under way at once.', low=1, high=8)
    rate: float = setting(
        1.0, 'Speed of a replay in real time, as a multiple of the recorded one.',
        low=1e-3, high=1e3)
    start_s: float = setting(0.0, 'Seconds of the bag to skip.', low=0.0, high=1e9)
    duration_s: float = setting(
        0.0, 'Seconds of the bag to replay; 0: to its end.', low=0.0, high=1e9)
    stride: int = setting(1, 'Every how many frames one is replayed.', low=1, high=100_000)
    loop: int = setting(
        1, 'How often the bag is replayed; stamps go on rising.', low=1, high=1_000_000)
    clock: bool = setting(True, 'Publish /clock.')
    start_timeout_s: float = setting(
        30.0, 'Wait so long for the other nodes at the start, seconds, and anew while one of '
        'them is loading or compiling. 0: as long as it takes.', low=0.0, high=1e6)
    poster: str = setting(
        NONE, 'A poster that is pasted into frames on their way to graph_builder: cells, noise or '
        'a chessboard.', choices=POSTERS)
    poster_share: float = setting(
        0.05, 'Poster: share of the frame that it covers, two sheets together.', low=0.001,
        high=1.0)
    poster_sheets: int = setting(
        1, 'Poster: sheets; two hang in opposite corners of one square.', low=1, high=2)
    poster_spans: str = setting(
        '', 'Poster: when it is seen, FROM:TO in seconds of the bag, several between commas.')
    poster_seed: int = setting(
        42, 'Poster: seed of its texture, place and light.', low=0, high=2**31 - 1)
    timeout_s: float = setting(
        30.0, 'In lockstep wait so long for a decision, and at the end for the rest, seconds.',
        low=0.1, high=1e6)


@dataclass(frozen=True)
class GraphBuilderNodeConfig(Config):
    """What the graph_builder node has beside BuilderConfig."""

    title: ClassVar[str] = 'graph_builder node'

    queue_depth: int = setting(
        10, 'Camera frames that may wait; older ones give way. 1: always the newest.',
        low=1, high=1000)
    frames_at_once: int = setting(
        2, 'Frames whose objects are looked for side by side; graphs leave in the order of '
        'their frames.', low=1, high=64)
    detections_wait_ms: float = setting(
        300.0, 'Detector topic: a frame waits so long for its detections, milliseconds; then its '
        'graph goes out without objects. At most queue_depth frames wait.', low=0.0, high=1e6)
    key: str = setting(
        '', 'File of a key, as "adversarial-lcd key" makes it: graphs are sealed with it; empty: '
        'they are not.')


@dataclass(frozen=True)
class LcdNodeConfig(Config):
    """What the lcd node has beside LcdConfig."""

    title: ClassVar[str] = 'lcd node'

    max_queries_per_s: int = setting(
        10_000, 'Queries beyond so many in a second are refused. Graphs that wait are decided '
        'before any query in any case.', low=1, high=10_000_000)
    key: str = setting(
        '', 'File of the key of graph_builder: graphs that are not sealed with it, or come again, '
        'late or out of order, are refused; empty: all are taken.')
    max_age_s: float = setting(
        10.0, 'Under a key: graphs sealed longer ago, or ahead, are refused, seconds by the '
        'clocks of both machines; 0: not looked at.', low=0.0, high=1e6)


@dataclass(frozen=True)
class AttackerNodeConfig(Config):
    """What the attacker node has beside AttackConfig."""

    title: ClassVar[str] = 'attacker node'

    query_timeout_s: float = setting(
        2.0, 'Wait so long for the answer to a query, seconds; then the best graph so far is '
        'forwarded.', low=1e-3, high=1e4)
    max_backlog: int = setting(
        10, 'Once more graphs than this wait, the attack under way ends and the waiting ones '
        'are forwarded unchanged.', low=1, high=100_000)


@dataclass(frozen=True)
class BagReplayNodeConfig(Config):
    """What the bag_replay node has beside ReplayConfig."""

    title: ClassVar[str] = 'bag_replay node'

    bag: str = setting('', 'Bag to replay: a rosbag2 folder, or an .mcap or .db3 file.')
    record: str = setting(
        '', 'Bag (MCAP) to write the graphs, decisions and attack reports of this replay to; '
        'empty: none.')
    record_frames: bool = setting(
        True, 'Record what is replayed, too: camera frames, poses, detections.')
    key: str = setting(
        '', 'Lockstep: file of the key of lcd, where it has one; frames whose graph lcd refuses '
        'for its seal are not waited for. Empty: every frame is.')


@dataclass(frozen=True)
class MapBuilderNodeConfig(Config):
    """The map_builder node: decisions and odometry to a map (docs/map.md)."""

    title: ClassVar[str] = 'map_builder node'

    back_end: str = setting(
        'cauchy', 'What makes the map, frame by frame (iSAM2): gnc needs all frames at once.',
        choices=BACK_ENDS[:3])
    odometry: str = setting(
        'topic', 'Where the odometry is from: the topic odom, or the topic ground_truth with '
        'drift (truth).', choices=('topic', 'truth'))
    drift: float = setting(
        1.0, 'Odometry truth: errors, as a multiple of those of the command "map".',
        low=0.0, high=1e3)
    odometry_tolerance_s: float = setting(
        0.05, 'Largest offset in time between a decision and its odometry, seconds.',
        low=0.0, high=1e3)
    step_rotation_deg: float = setting(
        0.3, 'What the map takes the error of the odometry from frame to frame for, about each '
        'axis, degrees.', low=1e-3, high=180.0)
    step_translation_m: float = setting(
        0.01, 'And along each axis, metres.', low=1e-6, high=1e3)
    closure_rotation_deg: float = setting(
        5.0, 'A closure claims that the camera is where it was: within so much about each axis, '
        'degrees.', low=1e-3, high=180.0)
    closure_translation_m: float = setting(
        0.2, 'And along each axis, metres.', low=1e-6, high=1e3)
    max_poses: int = setting(
        20_000, 'Most poses of a map; decisions beyond are counted and left out.', low=2,
        high=1_000_000)
    map_frame: str = setting('map', 'Name of the frame that the map is in.')
    odom_frame: str = setting(
        'odom', 'Name of the frame that the odometry is in, where its messages have none.')
    seed: int = setting(42, 'Odometry truth: seed of its errors.', low=0, high=2**31 - 1)
