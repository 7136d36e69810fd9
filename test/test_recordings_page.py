# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The table of bags/README.md: each of its lines is typed, on a small recording of its layout."""

from pathlib import Path
import re

import bag_factory as make
import layout_factory as layouts
import numpy as np
import pytest

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.graph_sequences.opening import holds_graphs
from adversarial_lcd_ros.sequences import open_sequence

PAGE = Path(__file__).parents[1] / 'bags' / 'README.md'
LINES = re.findall(r'\| `adversarial-lcd ((?:import|build) [^`]+)` \|$', PAGE.read_text(), re.M)
LEFT, RIGHT = '/camera/left/image_raw', '/camera/right/image_raw'


def _seven_scenes(path):
    for number, pose in enumerate(layouts.poses()):
        layouts.pictures(path, [f'frame-{number:06d}.color.png'])
        layouts.write_rows(path / f'frame-{number:06d}.pose.txt', pose.tolist())


def _walks(path):
    for walk in ('day_left', 'day_right'):
        layouts.pictures(path / walk, [f'Image{k:03d}.jpg' for k in range(4)])


def _two_cameras(path):
    make.write_ros2(path, make.raw_rows(topic=LEFT) + make.raw_rows(topic=RIGHT))


def _ros1(path):
    make.tum_bag(path, [make.picture(k) for k in range(4)], make.stamps(), make.stamps(),
                 np.zeros((4, 3)), np.tile([0.0, 0, 0, 1], (4, 1)))


SOURCES = {
    'rgbd_dataset_freiburg1_rpy': make.tum_folder,
    'MH_01_easy': layouts.euroc,
    'dataset/sequences/07': lambda path: layouts.kitti(path.parents[1]),
    'cafe1-1': layouts.openloris,
    'Replica/room0': lambda path: layouts.replica(path.parent),
    'scene0000_00': layouts.scannet,
    'redkitchen/seq-01': _seven_scenes,
    'gardenspoint_walking': _walks,
    'my_images': lambda path: layouts.pictures(path, [f'image{k}.jpg' for k in range(4)]),
    'walk.mp4': layouts.video,
    'my_bag': _two_cameras,
    'fr1_rpy.bag': _ros1,
}


def test_no_layout_is_without_a_line():
    assert {line.split()[1] for line in LINES} == set(SOURCES)
    assert len(LINES) == len(SOURCES) + 1


@pytest.mark.parametrize('line', LINES)
def test_the_line_does_what_the_table_says(tmp_path, monkeypatch, vocabulary, line):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('ADVERSARIAL_LCD_CACHE', str(tmp_path / 'cache'))
    command, source, destination, *options = line.split()
    SOURCES[source](tmp_path / source)
    if command == 'build':
        labels = tmp_path / options[options.index('--detections') + 1]
        labels.mkdir(parents=True)
        (labels / 'image2.txt').write_text('56 0.5 0.5 0.5 0.5 0.9\n')
        options += ['--vocabulary', vocabulary]
    assert main([command, source, destination, *options]) == 0
    bag = tmp_path / destination
    if command == 'build':
        assert holds_graphs(bag)
        return
    frames = 8 if source == 'gardenspoint_walking' else 4
    assert open_sequence(bag).frame_count == frames
