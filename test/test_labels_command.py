# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command "labels": a folder that shows labels before anything is evaluated."""

import json

import bag_factory as make
import cv2
import layout_factory as layouts
import numpy as np
import pytest

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.sequences import import_sequence, open_sequence


@pytest.fixture
def sequence(tmp_path):
    """Write a walk of 24 frames that returns to where it started; co-visibility tells so."""
    folder = tmp_path / 'walk'
    (folder / 'rgb').mkdir(parents=True)
    rng = np.random.default_rng(0)
    rows, poses = [], []
    for frame in range(24):
        cv2.imwrite(str(folder / 'rgb' / f'{frame}.png'),
                    rng.integers(0, 256, (48, 64, 3), np.uint8))
        rows.append(f'{frame}.0 rgb/{frame}.png\n')
        poses.append(f'{frame}.0 {0.2 * (frame % 12):g} 0 0 0 0 0 1\n')
    (folder / 'rgb.txt').write_text(''.join(rows))
    (folder / 'groundtruth.txt').write_text(''.join(poses))
    place = np.arange(24) % 12
    np.savez(folder / 'covisibility.npz', timestamp=np.arange(24, dtype=float),
             percent=np.where(place[:, None] == place[None], 90, 0).astype(np.uint8))
    return folder


def test_counts_path_and_pairs_are_written(sequence, tmp_path, monkeypatch):
    monkeypatch.setenv('ADVERSARIAL_LCD_CACHE', str(tmp_path / 'cache'))
    out = tmp_path / 'out'
    assert main(['labels', str(sequence), '--label-rule', 'auto', '--output', str(out)]) == 0
    summary = json.loads((out / 'summary.json').read_text())
    assert (summary['kind'], summary['schema']) == ('labels', 1)
    row, = summary['rows']
    assert row['told_by'] == 'co-visibility'
    assert (row['positive'], row['negative'], row['no_candidate']) == (12, 4, 8)
    page = (out / 'report.html').read_text()
    assert 'co-visibility' in page
    assert page.count('data:image/jpeg') == len(list(out.glob('*_*_*.jpg'))) == 10
    assert (out / 'positive_12_0.jpg').is_file()
    assert cv2.imread(str(out / 'labels.png')).shape[1] > 900
    (out / 'report.html').unlink()
    assert main(['report', str(out)]) == main(['inspect', str(out)]) == 0
    assert (out / 'report.html').read_text() == page


def test_check_holds_a_rule_against_the_exact_shares(sequence, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv('ADVERSARIAL_LCD_CACHE', str(tmp_path / 'cache'))
    out = tmp_path / 'out'
    assert main(['labels', str(sequence), '--check', '--label-rule', 'overlap',
                 '--output', str(out)]) == 0
    check = json.loads((out / 'summary.json').read_text())['rows'][0]['check']
    assert check['rule'] == 'overlap'
    assert check['exactly_new'] == 4
    # By poses alone the frames of a straight walk see what those before them saw.
    assert check['right_pairs_elsewhere'] > 0.5
    assert 'right pairs elsewhere' in capsys.readouterr().out


def test_ground_truth_can_be_named_and_what_is_missing_is_told(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv('ADVERSARIAL_LCD_CACHE', str(tmp_path / 'cache'))
    folder = tmp_path / 'pictures'
    folder.mkdir()
    for frame in range(24):
        cv2.imwrite(str(folder / f'{frame}.png'), make.noise(frame % 12))
    (tmp_path / 'poses.txt').write_text(''.join(
        f'{100 + frame}.0 {5 * (frame % 12)} 0 0 0 0 0 1\n' for frame in range(24)))
    line = ['labels', str(folder), '--label-rule', 'overlap', '--output', str(tmp_path / 'out')]
    assert main(line) == 2
    said = capsys.readouterr().err
    assert 'no ground truth' in said
    assert '--ground-truth' in said
    assert main([*line, '--ground-truth', str(tmp_path / 'poses.txt')]) == 0
    assert '12 frames with a loop and ' in capsys.readouterr().out
    assert json.loads((tmp_path / 'out/summary.json').read_text())['rows'][0]['positive'] == 12


def test_without_exact_shares_there_is_nothing_to_check(sequence, tmp_path, capsys):
    (sequence / 'covisibility.npz').unlink()
    assert main(['labels', str(sequence), '--check', '--label-rule', 'overlap',
                 '--output', str(tmp_path / 'out')]) == 2
    assert 'no covisibility.npz' in capsys.readouterr().err


@pytest.mark.parametrize('write', [layouts.kitti, layouts.euroc])
def test_the_focal_length_of_the_calibration_is_taken_where_there_is_one(
        tmp_path, monkeypatch, write):
    monkeypatch.setenv('ADVERSARIAL_LCD_CACHE', str(tmp_path / 'cache'))
    recording = write(tmp_path / 'recording')
    bag = import_sequence(recording, tmp_path / 'bag').path
    for source in (recording, bag):
        out = tmp_path / 'out' / source.name
        assert main(['labels', str(source), '--label-rule', 'audit', '--output', str(out)]) == 0
        row, = json.loads((out / 'summary.json').read_text())['rows']
        assert row['focal_from'] == 'calibration in the recording'
        assert row['focal_length'] == open_sequence(recording).focal_length_px / make.WIDTH
