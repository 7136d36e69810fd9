# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sealed graphs: none of somebody else's is taken, none twice, late or out of order."""

import os

from graph_factory import graphs, make_graph
from hypothesis import given, settings
from hypothesis import strategies as st
import pytest

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.errors import CodecError, FileError
from adversarial_lcd_ros.files.keys import make_key, read_key
from adversarial_lcd_ros.messages.authentic import Gate
from adversarial_lcd_ros.messages.codec import decode_graph, encode_graph
from adversarial_lcd_ros.messages.payload import WIRE_TYPE, wrap
from adversarial_lcd_ros.messages.sealing import SEAL_BYTES, Sealer
from adversarial_lcd_ros.sequences.replay import BagRecorder, read_payloads

KEY, OTHER_KEY = bytes(range(32)), bytes(32)
START, SECOND = 10**18, 10**9


def sealed(number, *, key=KEY, started=START, session=7, at=START):
    payload = encode_graph(make_graph(sequence=number, seed=number), session)
    return Sealer(key, started).seal(payload, at)


def cause(gate, message, now=START):
    """Return why a graph is refused; '' if it is taken."""
    try:
        gate.take(message, now)
    except CodecError as error:
        return error.cause
    return ''


@given(graphs(), st.integers(0, 2**64 - 1))
@settings(deadline=None)
def test_a_sealed_graph_is_the_graph_with_a_key_and_without(graph, session):
    message = Sealer(KEY).seal(encode_graph(graph, session))
    taken = Gate(KEY, 10.0).take(message)
    assert taken == graph == decode_graph(message)
    assert taken.session == decode_graph(message).session == session
    assert len(message) == len(encode_graph(graph)) + SEAL_BYTES


@given(st.data())
@settings(deadline=None)
def test_no_byte_can_be_changed_taken_away_or_added(data):
    message = sealed(1)
    gate = Gate(KEY)
    place = data.draw(st.integers(0, len(message) - 1))
    bit = data.draw(st.integers(0, 7))
    changed = bytearray(message)
    changed[place] ^= 1 << bit
    assert cause(gate, bytes(changed)) in ('seal', 'unsealed')
    assert cause(gate, message[:place]) in ('seal', 'unsealed')
    assert cause(gate, message[:place] + b'\0' + message[place:]) in ('seal', 'unsealed')
    assert cause(gate, message + b'\0') == 'unsealed'
    assert cause(gate, message) == ''  # what was refused left no trace


def test_graphs_of_others_are_refused():
    gate = Gate(KEY)
    assert cause(gate, sealed(1, key=OTHER_KEY)) == 'seal'
    assert cause(gate, encode_graph(make_graph())) == 'unsealed'
    assert cause(gate, encode_graph(make_graph()) + sealed(1)[-SEAL_BYTES:]) == 'seal'
    assert cause(gate, b'') == 'unsealed'


def test_numbers_rise_and_may_leave_gaps():
    gate = Gate(KEY)
    assert [cause(gate, sealed(number)) for number in (3, 4, 4, 3, 9, 7, 4, 10, 2)] == [
        '', '', 'replayed', 'replayed', '', 'reordered', 'replayed', '', 'reordered']


def test_a_builder_may_start_again_and_an_earlier_run_does_not_come_back():
    gate = Gate(KEY)
    later = {'started': START + SECOND, 'session': 8}
    assert [cause(gate, sealed(5)), cause(gate, sealed(0, **later)), cause(gate, sealed(6)),
            cause(gate, sealed(0, **later)), cause(gate, sealed(1, **later))] == [
                '', '', 'run', 'replayed', '']


def test_one_run_has_one_session():
    gate = Gate(KEY)
    assert cause(gate, sealed(1)) == ''
    assert cause(gate, sealed(2, session=8)) == 'run'
    assert cause(gate, sealed(2)) == ''


def test_a_detector_that_knows_of_no_run_takes_nothing_old():
    yesterday = START - 86_400 * SECOND
    old = sealed(1, started=yesterday, at=yesterday)
    assert cause(Gate(KEY, 10.0), old) == 'age'
    assert cause(Gate(KEY, 10.0), sealed(1, at=START + 11 * SECOND)) == 'age'
    assert cause(Gate(KEY, 10.0), sealed(1, at=START - 9 * SECOND)) == ''
    assert cause(Gate(KEY), old) == ''


def test_what_is_sealed_and_no_graph_is_refused_as_such():
    gate = Gate(KEY)
    assert cause(gate, Sealer(KEY, START).seal(b'no graph', START)) == 'unreadable'
    assert cause(gate, sealed(1)) == ''


def test_a_recording_carries_seals_and_is_read_without_a_key(tmp_path):
    messages = [sealed(number) for number in range(3)]
    with BagRecorder(tmp_path / 'bag') as recorder:
        for number, message in enumerate(messages):
            recorder.write('graph', WIRE_TYPE, number, wrap(message))
    recorded = [payload for _, payload in read_payloads(tmp_path / 'bag', 'graph')]
    assert recorded == messages
    assert [decode_graph(payload).sequence for payload in recorded] == [0, 1, 2]
    gate = Gate(KEY)
    assert [cause(gate, payload) for payload in recorded] == [''] * 3


def test_a_key_is_new_each_time_and_for_its_owner_alone(tmp_path, capsys):
    one, other = tmp_path / 'one', tmp_path / 'other'
    assert main(['key', str(one)]) == main(['key', str(other)]) == 0
    assert capsys.readouterr().out.split() == [str(one), str(other)]
    assert one.stat().st_mode & 0o777 == 0o600
    assert len(read_key(one)) == 32
    assert read_key(one) == read_key(one) != read_key(other)


def test_a_key_is_not_overwritten(tmp_path, capsys):
    path = tmp_path / 'key'
    make_key(path)
    key = read_key(path)
    assert main(['key', str(path)]) == 2
    assert 'is there already' in capsys.readouterr().err
    assert read_key(path) == key
    (tmp_path / 'link').symlink_to(tmp_path / 'nowhere')
    with pytest.raises(FileError, match='is there already'):
        make_key(tmp_path / 'link')


@pytest.mark.parametrize('mode', [0o640, 0o604, 0o620, 0o602, 0o610])
def test_a_key_that_others_can_open_is_refused(tmp_path, mode):
    path = tmp_path / 'key'
    make_key(path)
    path.chmod(mode)
    with pytest.raises(FileError, match=f'open to others .mode {mode:03o}.: expected 600'):
        read_key(path)


@pytest.mark.skipif(os.geteuid() != 0, reason='only root can give a file away')
def test_a_key_of_somebody_else_is_refused(tmp_path):
    path = tmp_path / 'key'
    make_key(path)
    os.chown(path, 12345, -1)
    with pytest.raises(FileError, match='belongs to user 12345'):
        read_key(path)


@pytest.mark.parametrize('content', [b'', b'ab' * 31, b'ab' * 33, b'x' * 64, b'\xff' * 64])
def test_what_is_no_key_is_not_repeated_in_the_error(tmp_path, content):
    path = tmp_path / 'key'
    path.write_bytes(content)
    path.chmod(0o600)
    with pytest.raises(FileError, match='holds no key: expected 64 hexadecimal digits') as error:
        read_key(path)
    assert not content or content.decode('latin-1') not in str(error.value)
