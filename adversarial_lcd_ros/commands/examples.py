# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lines to type, shown below the help of each command; a test parses them."""

from __future__ import annotations

from collections.abc import Mapping

# Command to pairs of what follows "adversarial-lcd", and what it is for.
EXAMPLES: Mapping[str, tuple[tuple[str, str], ...]] = {
    'demo': (
        ('demo', 'all 360 frames, five runs: some minutes'),
        ('demo --replay-stride 4', 'a quarter of the frames'),
        ('demo --lcd-defences length_check', 'the same behind a defence'),
    ),
    'inspect': (
        ('inspect my_bag', 'topics, frames, and what could be ground truth'),
        ('inspect results/latest', 'the figures of an evaluation'),
    ),
    'import': (
        ('import my_bag bags/mine', 'rosbag2 or ROS 1'),
        ('import my_bag bags/mine --topic /camera/left/image_raw --ground-truth /odom',
         'one camera of several, odometry for ground truth'),
        ('import my_images bags/mine --ground-truth poses.txt', 'a pose for each picture'),
        ('import walk.mp4 bags/walk', 'no ground truth: decisions that change are counted'),
    ),
    'labels': (
        ('labels bags/mine', 'before any figure is believed'),
        ('labels my_bag --ground-truth /odom', 'of a recording that was not imported'),
    ),
    'evaluate': (
        ('evaluate bags/mine', 'the attacks of the recipe "quick", over the nodes'),
        ('evaluate bags/mine --replay-stride 3 --ratio 1e-4', 'every third frame, fewer flips'),
        ('evaluate bags/mine --lcd-defences length_check,geometric_check',
         'behind defences'),
        ('evaluate bags/mine --recipe mine.yaml', 'attacks of your own list'),
        ('evaluate bags/mine bags/other --recipe paper --frames 1 --seeds 1',
         "the paper's experiments, a small sample, without ROS"),
    ),
    'report': (
        ('report', 'of results/latest'),
        ('report results/paper --archive paper.jsonl.xz', 'and all its cells in one file'),
    ),
    'compare': (
        ('compare results/latest results/checked/latest', 'what a defence changed'),
    ),
    'map': (
        ('map', 'of results/latest'),
        ('map A B --output maps', 'replays by two settings of the detector'),
        ('map results/latest --export-g2o graphs', 'for a back end of your own'),
    ),
    'render': (
        ('render results/latest --output map.gif', 'the run with the most false closures'),
        ('render results/latest --run clean --output clean.mp4', 'another run'),
    ),
    'build': (
        ('build bags/mine bags/mine_graphs', 'evaluations of it start at once'),
        ('build my_images bags/mine_graphs --detector csv --detections labels',
         'objects of your own detector'),
    ),
    'targets': (
        ('targets bags/mine', 'every detector, by your ground truth'),
        ('targets bags/mine --protocols live --defences none length_check',
         'what a defence costs without an attack'),
    ),
    'train': (
        ('train bags/one bags/two --output models', 'then: evaluate SEQUENCE --models models'),
        ('train bags/one@0:0.5 --targets wl --output models',
         'on the first half: test on bags/one@0.5:1'),
    ),
    'certify': (
        ('certify bags/mine', '60 loops and 60 new places of three detectors'),
        ('certify bags/mine --targets wl --frames 10', 'a quick look'),
    ),
    'key': (
        ('key robot.key', 'then give both nodes -p key:=robot.key'),
    ),
    'params': (
        ('params > params.yaml', 'nodes: --ros-args --params-file params.yaml'),
    ),
    'convert': (
        ('convert OLD NEW --frames bags/mine', 'with the camera frames of what was replayed'),
    ),
    'clean': (
        ('clean', 'lists what is in results, and asks'),
    ),
}


def shown(command: str) -> str:
    """Return the examples of a command as they stand below its help; '' if there are none."""
    lines = (f'  adversarial-lcd {line}\n      {what}' for line, what in EXAMPLES.get(command, ()))
    text = '\n'.join(lines)
    return f'examples:\n{text}' if text else ''
