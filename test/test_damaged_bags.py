# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags that others wrote, edited or cut: read where they are whole, else the true reason."""

import shutil
import sqlite3

import bag_factory as make
from mcap.writer import Writer as McapWriter
import pytest
from rosbags.rosbag2 import StoragePlugin
import yaml

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.sequences.bagfile import BagFile

ROWS = [*make.jpeg_rows(), *make.pose_rows()]


def storage(bag):
    return next(path for path in bag.iterdir() if path.suffix in ('.db3', '.mcap'))


def sqlite_bag(path):
    return make.write_ros2(path, ROWS, StoragePlugin.SQLITE3)


def edit_metadata(bag, edit):
    path = bag / 'metadata.yaml'
    content = yaml.safe_load(path.read_text())
    edit(content['rosbag2_bagfile_information'])
    path.write_text(yaml.safe_dump(content))


def topics_of(information):
    return information['topics_with_message_count']


def foreign_mcap(path, profile='', extra='json', **options):
    """Write an MCAP as other tools do, with a channel that is none of ROS."""
    with path.open('wb') as stream:
        writer = McapWriter(stream, **options)
        writer.start(profile)
        if extra:
            schema = writer.register_schema('state', f'{extra}schema', b'{}')
            foreign = writer.register_channel('/state', extra, schema)
            for stamp in make.stamps():
                writer.add_message(foreign, stamp, b'{}', stamp)
        channels = {}
        for topic, kind, stamp, message in ROWS:
            if topic not in channels:
                channels[topic] = writer.register_channel(
                    topic, 'cdr', writer.register_schema(kind, 'ros2msg', b''))
            writer.add_message(channels[topic], stamp, bytes(
                make.typestore().serialize_cdr(message, kind)), stamp)
        writer.finish()
    return path


def assert_whole(bag):
    sequence = open_sequence(bag)
    assert [frame.stamp_ns for frame in sequence.frames()] == make.stamps()
    assert len(sequence.trajectory) == 4


@pytest.mark.parametrize('extra', ['', 'json', 'protobuf'])
@pytest.mark.parametrize('profile', ['', 'ros2', 'px4'])
@pytest.mark.parametrize('options', [{}, {'use_chunking': False}, {'use_statistics': False}])
def test_an_mcap_of_another_tool_is_read(tmp_path, profile, extra, options):
    path = foreign_mcap(tmp_path / 'other.mcap', profile, extra, **options)
    assert_whole(path)
    if extra:
        with BagFile(path) as bag:
            assert bag.topics['/state'].startswith('state')
            assert bag.counts['/state'] == 4
            assert 0 < bag.duration_s < 1


@pytest.mark.parametrize('qos', ['', [], None, [{'history': 'keep_all', 'depth': 0,
    'reliability': 'best_effort', 'durability': 'volatile', 'deadline': {'sec': 0, 'nsec': 0},
    'lifespan': {'sec': 0, 'nsec': 0}, 'liveliness': 'automatic',
    'liveliness_lease_duration': {'sec': 0, 'nsec': 0},
    'avoid_ros_namespace_conventions': False}]])
@pytest.mark.parametrize('write', [sqlite_bag, lambda path: make.write_ros2(path, ROWS)])
def test_quality_of_service_in_the_metadata_decides_nothing(tmp_path, write, qos):
    bag = write(tmp_path / 'bag')

    def edit(information):
        for entry in topics_of(information):
            entry['topic_metadata'].update(offered_qos_profiles=qos, type_description_hash='')

    edit_metadata(bag, edit)
    assert_whole(bag)


def test_two_publishers_of_a_topic_are_both_read(tmp_path):
    bag = make.write_ros2(tmp_path / 'bag', ROWS[:1])
    file = storage(bag)
    with file.open('wb') as stream:
        writer = McapWriter(stream)
        writer.start('ros2')
        ids = {}
        for number, (topic, kind, stamp, message) in enumerate(ROWS):
            key = topic, number % 2
            if key not in ids:
                ids[key] = writer.register_channel(
                    topic, 'cdr', writer.register_schema(kind, 'ros2msg', b''))
            writer.add_message(ids[key], stamp, bytes(
                make.typestore().serialize_cdr(message, kind)), stamp)
        writer.finish()
    assert_whole(bag)
    assert_whole(file)


def test_more_messages_than_the_metadata_say_are_all_read(tmp_path):
    bag = sqlite_bag(tmp_path / 'bag')

    def edit(information):
        for entry in topics_of(information):
            entry['message_count'] = 2

    edit_metadata(bag, edit)
    assert_whole(bag)


def test_fewer_messages_than_the_metadata_say_are_named_with_what_helps(tmp_path):
    bag = sqlite_bag(tmp_path / 'bag')
    with sqlite3.connect(storage(bag)) as database:
        database.execute('DELETE FROM messages WHERE id = 2')
    with pytest.raises(SequenceError, match=r'3 of 4 messages on /image/compressed that '
                       r'metadata\.yaml promises .*ros2 bag reindex'):
        open_sequence(bag)
    assert open_sequence(storage(bag)).frame_count == 3


@pytest.mark.parametrize('name', ['hash#1', 'per%20cent', 'a?b', "it's", 'two words', '[x]'])
def test_any_path_will_do(tmp_path, name):
    # The writer of rosbags would not take such a path: the folder gets its name afterwards.
    sqlite_bag(tmp_path / 'bag').rename(tmp_path / name)
    assert_whole(tmp_path / name)
    assert_whole(storage(tmp_path / name))


def cut(file, share=0.6):
    data = file.read_bytes()
    file.write_bytes(data[:int(len(data) * share)])


def ros1_bag(path):
    store, messages = make.ros1_messages()
    return make.write_ros1(path, [('/image', make.COMPRESSED, stamp, messages.compressed(
        stamp, make.encoded(make.picture()))) for stamp in make.stamps()], store)


def test_each_kind_of_damage_gets_the_remedy_that_works_for_it(tmp_path):
    mcap = make.write_ros2(tmp_path / 'of mcap', ROWS)
    database = sqlite_bag(tmp_path / 'database')
    ros1 = ros1_bag(tmp_path / 'one.bag')
    for file in (storage(mcap), storage(database), ros1):
        cut(file)
    cases = {
        mcap: r"of mcap\.mcap: it is truncated.*\"mcap recover '.*/of mcap\.mcap' -o whole\.mcap",
        storage(mcap): r'it is truncated.*mcap recover',
        database: r'database\.db3: it is truncated.*sqlite3 .*database\.db3 \.recover',
        storage(database): r'it is truncated.*\.recover \| sqlite3 whole\.db3',
        ros1: r'truncated.*rosbag reindex .*one\.bag',
    }
    for path, text in cases.items():
        with pytest.raises(SequenceError, match=text) as error:
            open_sequence(path)
        assert '\n' not in str(error.value)
        assert 'ros2 bag reindex' not in str(error.value)


@pytest.mark.parametrize('name', ['a.mcap', 'a.db3', 'a.bag'])
def test_empty_files_and_web_pages_are_named(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(b'')
    with pytest.raises(SequenceError, match=r'cannot be read: it is empty'):
        open_sequence(path)
    path.write_bytes(b'<html>404: Not Found</html>')
    with pytest.raises(SequenceError, match=r"it is no .*: it starts with b'<html>404"):
        open_sequence(path)


@pytest.mark.parametrize(('write', 'plugin'), [
    (sqlite_bag, 'sqlite3'), (lambda path: make.write_ros2(path, ROWS), 'mcap')])
def test_a_folder_without_metadata_is_told_from_a_damaged_file(tmp_path, write, plugin):
    bag = write(tmp_path / 'bag')
    (bag / 'metadata.yaml').unlink()
    with pytest.raises(SequenceError, match=rf'no metadata\.yaml.*import its file itself \(.*bag'
                       rf'/bag\..*ros2 bag reindex -s {plugin}'):
        open_sequence(bag)
    assert_whole(storage(bag))


def test_damaged_metadata_are_told_from_a_damaged_file(tmp_path):
    bag = sqlite_bag(tmp_path / 'bag')
    (bag / 'metadata.yaml').write_text('rosbag2_bagfile_information:\n  version: 5\n')
    with pytest.raises(SequenceError, match=r'metadata key is missing.*import the file itself'):
        open_sequence(bag)


def test_a_recording_that_was_not_ended_is_named(tmp_path):
    bag = sqlite_bag(tmp_path / 'bag')
    database = sqlite3.connect(storage(bag))
    database.execute('PRAGMA journal_mode=WAL')
    database.execute('DELETE FROM messages WHERE id = 2')
    database.commit()
    for name in ('bag.db3', 'bag.db3-wal'):
        shutil.copy(bag / name, tmp_path / name)
    database.close()
    with pytest.raises(SequenceError, match=r'is in bag\.db3-wal: .*wal_checkpoint'):
        open_sequence(tmp_path / 'bag.db3')
