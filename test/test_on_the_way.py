"""Recordings that were not imported: imported on the way, once, and kept by their content."""

import shutil

import bag_factory as make
import pytest

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.sequences import import_sequence, open_sequence
from adversarial_lcd_ros.sequences.bag_truth import TruthOptions
from adversarial_lcd_ros.sequences.frame_poses import parse_extrinsics
from adversarial_lcd_ros.sequences.on_the_way import imported, is_imported


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv('ADVERSARIAL_LCD_CACHE', str(tmp_path / 'cache'))
    return tmp_path / 'cache' / 'imports'


def test_what_import_wrote_is_taken_as_it_is(tmp_path, cache):
    import_sequence(make.tum_folder(tmp_path / 'tum'), tmp_path / 'bag')
    assert is_imported(tmp_path / 'bag')
    assert imported(tmp_path / 'bag', {}) == tmp_path / 'bag'
    assert not cache.exists()


def test_a_recording_is_imported_once(tmp_path):
    source, said = make.tum_folder(tmp_path / 'tum'), []
    bag = imported(source, {}, tell=said.append)
    assert is_imported(bag)
    assert open_sequence(bag).name == 'tum'
    assert open_sequence(bag).stamps_ns.tolist() == make.stamps()
    assert 'importing it to' in said[0]
    assert '4 of 4 frames have a pose' in said[1]
    before = (bag / 'metadata.yaml').stat().st_mtime_ns
    assert imported(source, {}, tell=said.append) == bag
    assert 'was imported before' in said[2]
    assert (bag / 'metadata.yaml').stat().st_mtime_ns == before
    # By content: a copy elsewhere of the same name is the same recording.
    shutil.copytree(source, tmp_path / 'copy' / 'tum')
    assert imported(tmp_path / 'copy' / 'tum', {}) == bag


def test_other_content_or_options_are_another_import(tmp_path):
    source = make.tum_folder(tmp_path / 'tum')
    mount = TruthOptions(extrinsics=parse_extrinsics(['1', '0', '0', '0', '0', '0', '1']))
    bags = [imported(source, options) for options in (
        {}, {'ground_truth': 'none'}, {'truth': mount})]
    (source / 'groundtruth.txt').write_text('\n'.join(
        make.pose_line(stamp, 9.0) for stamp in make.stamps()))
    bags.append(imported(source, {}))
    assert len(set(bags)) == 4
    found = [open_sequence(bag).trajectory for bag in bags]
    assert found[1] is None
    assert [found[k].position[0, 0] for k in (0, 2, 3)] == [0.0, 1.0, 9.0]


@pytest.mark.parametrize('rows', [
    make.raw_rows(), make.jpeg_rows(topic='/camera/image_raw/compressed'),
    make.jpeg_rows() + [('/odom', make.ODOMETRY, make.START_NS, make.ROS2.odometry(
        make.START_NS, (0.0, 0.0, 0.0)))]])
def test_a_bag_that_the_nodes_would_not_hear_is_no_imported_one(tmp_path, rows):
    bag = make.write_ros2(tmp_path / 'bag', rows)
    assert not is_imported(bag)
    assert is_imported(imported(bag, {}))


def test_what_cannot_be_imported_is_refused_and_leaves_nothing(tmp_path, cache):
    rows = make.raw_rows() + make.pose_rows(topic='/a') + make.pose_rows(topic='/b')
    with pytest.raises(SequenceError, match='such as --ground-truth /a'):
        imported(make.write_ros2(tmp_path / 'bag', rows), {})
    assert not list(cache.iterdir())
    with pytest.raises(SequenceError, match='there is no sequence'):
        imported(tmp_path / 'nonesuch', {})


def test_build_takes_the_options_of_an_import(tmp_path, capsys):
    bag = make.write_ros2(tmp_path / 'mine', [
        (topic, kind, stamp, make.ROS2.compressed(stamp, make.encoded(make.noise(k))))
        for k, (topic, kind, stamp, _) in enumerate(make.jpeg_rows(topic='/camera/compressed'))
    ] + make.pose_rows(topic='/a') + make.pose_rows(topic='/b'))
    line = ['build', str(bag), str(tmp_path / 'graphs'), '--detector', 'none']
    assert main(line) == 2
    assert '--ground-truth /a' in capsys.readouterr().err
    assert main([*line, '--ground-truth', '/b']) == 0
    assert '4 poses' in capsys.readouterr().out


def test_graphs_of_blank_pictures_are_said_to_be_empty(tmp_path, capsys):
    folder = make.tum_folder(tmp_path / 'tum')
    for file in (folder / 'rgb').iterdir():
        file.write_bytes(make.encoded(make.noise() * 0 + 128))
    assert main(['build', str(folder), str(tmp_path / 'graphs'), '--detector', 'none']) == 0
    assert 'warning: 4 of 4 graphs are empty' in capsys.readouterr().err


def test_a_part_cannot_be_replayed(tmp_path, capsys):
    folder = make.tum_folder(tmp_path / 'tum')
    assert main(['evaluate', f'{folder}@0:0.5', '--output', str(tmp_path / 'results')]) == 2
    assert '--replay-duration-s' in capsys.readouterr().err
