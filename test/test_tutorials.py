# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The tutorials: their lines are typed, one after the other, on a small walk."""

from pathlib import Path
import re
import shlex

import bag_factory as make
import cv2
import numpy as np
import pytest

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.evaluation.results import LATEST, REPORT
from adversarial_lcd_ros.graph_sequences.opening import holds_graphs, open_graphs
from adversarial_lcd_ros.messages import codec, payload

DOCS = Path(__file__).parents[1] / 'docs'
CAMERA, DETECTOR = ((DOCS / f'tutorial_{name}.md').read_text(encoding='utf-8')
                    for name in ('camera', 'detector'))
TOPIC = '/camera/camera/color/image_raw'
PLACES, LAPS = 12, 2


def lines(page):
    """Return the arguments of every line that is typed, in order."""
    return [shlex.split(line) for line in re.findall(r'^    adversarial-lcd (.+)$', page, re.M)]


def record_walk(path):
    """Record two laps past the same places, a frame a second, in bgra8 as a RealSense does."""
    rows = []
    for frame in range(PLACES * LAPS):
        stamp = make.START_NS + frame * 10**9
        place = frame % PLACES
        picture = cv2.cvtColor(make.noise(place), cv2.COLOR_GRAY2BGRA)
        rows.append((TOPIC, make.IMAGE, stamp, make.ROS2.image(stamp, picture, 'bgra8')))
        rows.append(('/odom', make.ODOMETRY, stamp, make.ROS2.odometry(
            stamp, (5.0 * place, 0.0, 0.0))))
    make.write_ros2(path, rows)


@pytest.fixture
def walk(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('ADVERSARIAL_LCD_CACHE', str(tmp_path / 'cache'))
    record_walk(tmp_path / 'walk')
    return tmp_path


def test_the_lines_of_the_camera(walk, capsys):
    pytest.importorskip('rclpy')
    typed = lines(CAMERA)
    assert [line[0] for line in typed] == ['inspect', 'import', 'labels', 'evaluate', 'evaluate',
                                           'compare']
    for line in typed:
        assert main(line) == 0, line
        if line[0] == 'inspect':
            said = capsys.readouterr().out
            assert TOPIC in said
            assert '/odom' in said
    assert (walk / 'results' / LATEST / REPORT).is_file()


def test_the_lines_of_the_detector(walk, vocabulary):
    assert main(next(line for line in lines(CAMERA) if line[0] == 'import')) == 0
    (walk / 'detections.csv').write_text(
        'timestamp,class,x,y,w,h,score\n'
        f'{make.seconds(make.START_NS)},56,10,10,60,60,0.9\n')
    pictures, labels = walk / 'my_images', walk / 'runs/detect/predict/labels'
    pictures.mkdir()
    labels.mkdir(parents=True)
    for number in range(3):
        cv2.imwrite(str(pictures / f'{number}.png'), make.noise(number))
    (labels / '1.txt').write_text('56 0.5 0.5 0.5 0.5 0.9\n')
    built = [line for line in lines(DETECTOR) if line[0] == 'build']
    for line in built:
        assert main([*line, '--vocabulary', vocabulary]) == 0, line
        assert holds_graphs(walk / line[2])
    objects = [[graph.object_count for graph in open_graphs(line[2]).graphs] for line in built]
    assert objects[0] == [0, 1, 0]
    assert objects[1][:2] == [1, 0]


def test_detections_are_published_as_the_page_says():
    said = {}
    exec(compile(re.search(r'```python\n(.*?)```', DETECTOR, re.S)[1], 'page', 'exec'), said)
    found = codec.decode_detections(payload.unwrap(said['message']))
    assert found.label.tolist() == [56]
    assert np.allclose(found.box, said['found'].box)
