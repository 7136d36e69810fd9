# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Folders of labels as YOLO writes them, and detectors that find nothing."""

import logging
from pathlib import Path

import bag_factory as make
import layout_factory as layouts
import numpy as np
import pytest

from adversarial_lcd_ros.config import BuilderConfig
from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.graph_sequences.opening import for_sequence, open_graphs
from adversarial_lcd_ros.sequences import import_sequence, open_sequence
from adversarial_lcd_ros.sequences.detections import read_detections
from adversarial_lcd_ros.sequences.yolo_labels import convert_labels


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv('ADVERSARIAL_LCD_CACHE', str(tmp_path / 'cache'))
    return tmp_path / 'cache'


@pytest.fixture
def pictures(tmp_path):
    layouts.pictures(tmp_path / 'images', [f'img_{k}.png' for k in range(4)])
    return tmp_path / 'images'


def write_labels(folder, lines):
    """Write {name: lines} of labels, and what lies beside them."""
    folder.mkdir(parents=True)
    for name, text in lines.items():
        (folder / f'{name}.txt').write_text(text)
    (folder / 'classes.txt').write_text('chair\ntable\n')
    (folder / '._img_0.txt').write_bytes(b'\0\5')
    return folder


LABELS = {'img_0': '3 0.5 0.5 0.5 0.25 0.9\n', 'img_2': '7 0.25 0.25 0.1 0.2\n1 1 1 0.5 0.5 0.5\n'}


@pytest.mark.parametrize('part', ['', 'labels'])
def test_labels_belong_to_the_pictures_of_their_names(tmp_path, pictures, part):
    labels = write_labels(tmp_path / 'found' / part, LABELS)
    sequence = open_sequence(pictures)
    assert convert_labels(tmp_path / 'found', sequence, tmp_path / 'd.csv') == 3
    table = read_detections(tmp_path / 'd.csv')
    frames = sequence.stamps_ns.tolist()
    assert table.stamp_ns.tolist() == [frames[0], frames[2], frames[2]]
    assert table.label.tolist() == [3, 7, 1]
    # The pictures have 64 x 48 pixels.
    np.testing.assert_allclose(table.box, [[16, 18, 32, 12], [12.8, 7.2, 6.4, 9.6],
                                           [48, 36, 32, 24]], rtol=1e-6)
    np.testing.assert_allclose(table.score, [0.9, 1.0, 0.5])
    config = BuilderConfig(detector='csv', detections=str(labels.parent if part else labels))
    found = for_sequence(config, sequence).detections
    assert read_detections(Path(found)).label.tolist() == [3, 7, 1]
    assert for_sequence(config, sequence).detections == found


def test_labels_named_by_time_belong_to_an_imported_bag(tmp_path):
    source = make.tum_folder(tmp_path / 'tum')
    import_sequence(source, tmp_path / 'bag')
    names = [path.stem for path in sorted((source / 'rgb').iterdir())]
    labels = write_labels(tmp_path / 'labels', dict.fromkeys(names, '3 0.5 0.5 0.5 0.5\n'))
    sequence = open_sequence(tmp_path / 'bag')
    assert convert_labels(labels, sequence, tmp_path / 'd.csv') == 4
    assert read_detections(tmp_path / 'd.csv').stamp_ns.tolist() == make.stamps()


def test_labels_of_a_video_are_numbered_from_one(tmp_path):
    video = layouts.video(tmp_path / 'walk.mp4')
    labels = write_labels(tmp_path / 'labels', dict.fromkeys(('walk_1', 'walk_4'),
                                                             '3 .5 .5 .5 .5'))
    convert_labels(labels, open_sequence(video), tmp_path / 'd.csv')
    assert read_detections(tmp_path / 'd.csv').stamp_ns.tolist() == [0, 300_000_000]


@pytest.mark.parametrize(('text', 'message'), [
    ('3 0.5 0.5 0.5', r'img_0\.txt, line 1: 4 fields; expected 5 or more'),
    ('3 0.1 0.1 0.5 0.5 0.9 0.9 0.1', r'line 1: 8 fields; .* outlines and key points'),
    ('chair 0.5 0.5 0.5 0.5', r'line 1: invalid literal'),
    ('-1 0.5 0.5 0.5 0.5', r'line 1: class -1'),
    ('3 320 240 50 60', r'line 1: 320 240 50 60; expected cx cy w h in shares'),
    ('3 0.5 0.5 0 0.5', r'in shares'), ('3 nan 0.5 0.5 0.5', r'in shares'),
    ('3 0.5 0.5 0.5 0.5 7', r'and a confidence')])
def test_what_is_no_label_is_refused_by_line(tmp_path, pictures, text, message):
    labels = write_labels(tmp_path / 'labels', {'img_0': text})
    with pytest.raises(SequenceError, match=message):
        convert_labels(labels, open_sequence(pictures), tmp_path / 'd.csv')


def test_labels_of_other_pictures_are_refused_by_name(tmp_path, pictures):
    labels = write_labels(tmp_path / 'labels', {'img_0': '3 .5 .5 .5 .5', 'dog': '3 .5 .5 .5 .5'})
    with pytest.raises(SequenceError, match=r'dog\.txt is named like none of the 4 frames .* such '
                       r'as img_0\.txt'):
        convert_labels(labels, open_sequence(pictures), tmp_path / 'd.csv')
    import_sequence(pictures, tmp_path / 'bag')
    with pytest.raises(SequenceError, match=r'a bag does not know them: name the folder'):
        convert_labels(labels, open_sequence(tmp_path / 'bag'), tmp_path / 'd.csv')
    (tmp_path / 'empty').mkdir()
    with pytest.raises(SequenceError, match=r'holds no labels'):
        convert_labels(tmp_path / 'empty', open_sequence(pictures), tmp_path / 'd.csv')


def test_a_folder_where_a_csv_is_expected_names_the_line_to_type(tmp_path):
    with pytest.raises(SequenceError, match=r'adversarial-lcd build PICTURES BAG --detector csv'):
        read_detections(tmp_path)


def test_a_detector_that_never_finds_anything_is_told(tmp_path, vocabulary, pictures, caplog):
    labels = write_labels(tmp_path / 'labels', {'img_0': '3 0.5 0.5 0.5 0.5 0.1\n'})
    config = BuilderConfig(detector='csv', detections=str(labels), vocabulary=vocabulary,
                           object_score=0.05)
    caplog.set_level(logging.WARNING)
    open_graphs(str(pictures), config)
    assert not caplog.records
    for _ in range(2):  # built, and from the cache
        caplog.clear()
        open_graphs(str(pictures), BuilderConfig(
            detector='csv', detections=str(labels), vocabulary=vocabulary, object_score=0.5))
        assert 'found no object in any of 4 frames' in caplog.text
    caplog.clear()
    open_graphs(str(pictures), BuilderConfig(detector='none', vocabulary=vocabulary))
    assert not caplog.records
