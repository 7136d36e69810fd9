# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readers come back with content or one FileError; writers leave a whole file or the old one."""

from contextlib import suppress
import io
import json
import os
import stat
import struct
import zipfile

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.errors import FileError
from adversarial_lcd_ros.files.arrays import read_npz
from adversarial_lcd_ros.files.reading import (
    MAX_DEPTH,
    MAX_YAML_NODES,
    csv_rows,
    parse_json,
    read_bytes,
    read_json,
    read_yaml,
)
from adversarial_lcd_ros.files.writing import (
    plain_cell,
    replacing,
    write_csv,
    write_json,
    write_text,
)

BOMB = 'a: &a [x, x, x, x, x, x, x, x, x]\n' + ''.join(
    f'{after}: &{after} [{", ".join([f"*{before}"] * 9)}]\n'
    for before, after in zip('abcdefghi', 'bcdefghij', strict=True))


@pytest.mark.parametrize(('text', 'message'), [
    ('{"a": 1, "a": 2}', "the key 'a' is there twice"),
    ('[1, {"b": {"c": 1, "c": 1}}]', "the key 'c' is there twice"),
    ('[NaN]', 'NaN is no number'),
    ('[1e999]', 'inf is no finite number'),
    ('[' * 100_000, 'nested deeper'),
    ('[' * 40 + ']' * 40, f'nested deeper than {MAX_DEPTH}'),
    ('[' + '9' * 5000 + ']', '4300 digits'),
    ('hello', 'cannot be read as JSON'),
    ('', 'cannot be read as JSON'),
])
def test_json_that_is_none_is_one_error(tmp_path, text, message):
    path = tmp_path / 'x.json'
    path.write_text(text)
    with pytest.raises(FileError, match=message) as refused:
        read_json(path)
    assert str(path) in str(refused.value)


@pytest.mark.parametrize(('text', 'message'), [
    ('a: 1\na: 2', "line 2: the key 'a' is there twice"),
    ('a: {b: 1, b: 2}', 'there twice'),
    (BOMB, f'more than {MAX_YAML_NODES} values'),
    ('a: &a\n- *a', r'\*a is part of itself'),
    ('a: ' + '[' * 100_000, 'nested deeper'),
    ('a: ' + '9' * 5000, '4300 digits'),
    ('a: .inf', 'no finite number'),
    ('a: !!python/object/apply:os.system [id]', 'could not determine a constructor'),
    ('a: 2024-13-45', 'month'),
    ('? [a]\n: b', 'unhashable'),
    ('a: "\0"', 'special characters'),
    ('a: *b', 'undefined alias'),
    ('x' * 600_000, 'larger than'),
])
def test_yaml_that_is_none_is_one_error(tmp_path, text, message):
    path = tmp_path / 'x.yaml'
    path.write_text(text)
    with pytest.raises(FileError, match=message):
        read_yaml(path)


def test_chain_of_anchors_is_as_deep_as_it_would_be_written_out(tmp_path):
    path = tmp_path / 'x.yaml'
    path.write_text('a0: &a0 [x]\n' + ''.join(
        f'a{n}: &a{n} [*a{n - 1}]\n' for n in range(1, 200)))
    with pytest.raises(FileError, match='nested deeper'):
        read_yaml(path)


def test_yaml_with_anchors_and_merged_keys_is_read(tmp_path):
    path = tmp_path / 'x.yaml'
    path.write_text('base: &base {a: 1, b: 2}\nown: {<<: *base, b: 3}\nlist: [*base, *base]\n')
    assert read_yaml(path) == {'base': {'a': 1, 'b': 2}, 'own': {'a': 1, 'b': 3},
                               'list': [{'a': 1, 'b': 2}] * 2}


@given(st.binary(max_size=200) | st.text(max_size=200).map(str.encode)
       | st.text('[]{}":,&*- \n!<ab1.', max_size=80).map(str.encode))
def test_any_bytes_are_content_or_one_error(tmp_path_factory, data):
    path = tmp_path_factory.mktemp('any') / 'file'
    path.write_bytes(data)
    for read in (read_json, read_yaml, lambda file: list(csv_rows(file)),
                 lambda file: read_npz(file, ['a'])):
        with suppress(FileError):
            read(path)


@given(st.recursive(st.none() | st.booleans() | st.integers(-2**63, 2**63) | st.text()
                    | st.floats(allow_nan=False, allow_infinity=False),
                    lambda inner: st.lists(inner, max_size=3)
                    | st.dictionaries(st.text(), inner, max_size=3), max_leaves=20))
def test_json_that_was_written_is_read_back(tmp_path_factory, value):
    path = tmp_path_factory.mktemp('json') / 'x.json'
    write_json(path, [value])
    assert read_json(path) == [value]
    assert parse_json(json.dumps(value), 'x') == value


def test_only_regular_files_are_read(tmp_path):
    os.mkfifo(tmp_path / 'pipe')
    (tmp_path / 'zero').symlink_to('/dev/zero')
    for name in ('pipe', 'zero', '.'):
        with pytest.raises(FileError, match=r'no regular file|Is a directory'):
            read_bytes(tmp_path / name)
        with pytest.raises(FileError, match=r'no regular file|Is a directory'):
            read_npz(tmp_path / name, ['a'])
    with pytest.raises(FileError, match='no name of a file'):
        read_bytes(tmp_path / 'a\0b')


def test_csv_that_is_none_names_the_line(tmp_path):
    path = tmp_path / 'x.csv'
    path.write_bytes(b'a,b\n1,\xff\n')
    with pytest.raises(FileError, match='not in UTF-8: byte 6 is 0xff'):
        list(csv_rows(path))
    path.write_text('a,b\n1,"x"y\n')
    with pytest.raises(FileError, match='line 2 cannot be read as CSV'):
        list(csv_rows(path))
    path.write_text('a\n' + 'x' * 100_000)
    with pytest.raises(FileError, match='field larger than'):
        list(csv_rows(path))


def npz_with(path, header, data=b'', compression=zipfile.ZIP_STORED):
    """Write an archive with one member: an npy header that says anything, and some data."""
    text = f'{header}\n'.encode()
    with zipfile.ZipFile(path, 'w', compression) as archive:
        archive.writestr('a.npy', b'\x93NUMPY\x01\x00' + struct.pack('<H', len(text)) + text
                         + data)
    return path


HEADER = "{{'descr': {!r}, 'fortran_order': False, 'shape': {}}}"


@pytest.mark.parametrize(('header', 'data', 'message'), [
    (HEADER.format('<f8', '(100000000000,)'), b'12345678', 'declares float64'),
    (HEADER.format('<f8', '(-1,)'), b'', 'declares float64'),
    (HEADER.format('<f8', '(1,)'), b'1234', 'declares float64'),
    (HEADER.format('<f8', '(1,)'), b'12345678extra', 'declares float64'),
    (HEADER.format('|O', '(1,)'), b'12345678', 'holds objects'),
    ('[' * 5000, b'', 'cannot be read as npz'),
    ('__import__("os")', b'', 'cannot be read as npz'),
])
def test_header_of_an_array_is_looked_at_before_it_is_read(tmp_path, header, data, message):
    with pytest.raises(FileError, match=message):
        read_npz(npz_with(tmp_path / 'x.npz', header, data), ['a'])


def test_archive_that_unfolds_is_not_unfolded(tmp_path):
    size = 64 << 20
    path = npz_with(tmp_path / 'x.npz', HEADER.format('|u1', f'({size},)'), bytes(size),
                    zipfile.ZIP_DEFLATED)
    assert path.stat().st_size < size / 900
    with pytest.raises(FileError, match='unfolds from'):
        read_npz(path, ['a'])
    with pytest.raises(FileError, match=r'beyond 1000 bytes|more than the 1000'):
        read_npz(path, ['a'], limit=1000, ratio=2000)


def test_archive_of_very_many_members_is_not_opened(tmp_path):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, 'w') as archive:
        for number in range(30_000):
            archive.writestr(str(number), b'')
    (tmp_path / 'x.npz').write_bytes(stream.getvalue())
    with pytest.raises(FileError, match='more members'):
        read_npz(tmp_path / 'x.npz', ['a'])


def test_arrays_that_numpy_wrote_are_read(tmp_path):
    arrays = {'a': np.arange(6.0).reshape(2, 3).T, 'b': np.zeros(0, bool),
              'c': np.array(3, np.int64)}
    for save in (np.savez, np.savez_compressed):
        save(tmp_path / 'x.npz', **arrays)
        found = read_npz(tmp_path / 'x.npz', ['a', 'b', 'c'])
        for name, array in arrays.items():
            assert found[name].dtype == array.dtype
            np.testing.assert_array_equal(found[name], array)
    with pytest.raises(FileError, match="no array 'd'"):
        read_npz(tmp_path / 'x.npz', ['d'])


@given(st.data())
def test_damaged_archive_gives_arrays_or_one_error(tmp_path_factory, data):
    path = tmp_path_factory.mktemp('npz') / 'x.npz'
    np.savez_compressed(path, a=np.arange(20.0), b=np.ones((2, 3), np.uint8))
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(bytes(content[:data.draw(st.integers(0, len(content)))]))
    with suppress(FileError):
        read_npz(path, ['a', 'b'])


def test_link_is_replaced_and_its_target_left_alone(tmp_path):
    (tmp_path / 'precious').write_text('precious')
    (tmp_path / 'report.html').symlink_to('precious')
    write_text(tmp_path / 'report.html', 'new')
    assert (tmp_path / 'precious').read_text() == 'precious'
    assert (tmp_path / 'report.html').read_text() == 'new'
    assert not (tmp_path / 'report.html').is_symlink()
    assert sorted(os.listdir(tmp_path)) == ['precious', 'report.html']


def test_what_fails_half_way_leaves_the_old_file(tmp_path):
    write_text(tmp_path / 'x.json', 'old')
    with suppress(RuntimeError), replacing(tmp_path / 'x.json') as stream:
        stream.write(b'half')
        raise RuntimeError
    assert os.listdir(tmp_path) == ['x.json']
    assert (tmp_path / 'x.json').read_text() == 'old'


def test_what_cannot_be_moved_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / 'a.json'
    write_json(path, {'a': 1})

    def break_off(*arguments):
        raise OSError(28, 'No space left on device')
    monkeypatch.setattr(type(path), 'replace', break_off)
    with pytest.raises(FileError, match=r'No space left on device.*make room'):
        write_json(path, {'a': 2})
    assert read_json(path) == {'a': 1}
    assert os.listdir(tmp_path) == ['a.json']


def test_what_is_no_number_becomes_null(tmp_path):
    write_json(tmp_path / 'a.json', {'a': [np.float64('nan'), np.int64(3), float('inf')]})
    assert read_json(tmp_path / 'a.json') == {'a': [None, 3, None]}


def test_others_may_read_it(tmp_path):
    (tmp_path / 'usual').write_text('')
    write_text(tmp_path / 'ours', '')
    modes = {stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ('usual', 'ours')}
    assert len(modes) == 1


@pytest.mark.parametrize(('value', 'written'), [
    ('=HYPERLINK("x")', "\"'=HYPERLINK(\"\"x\"\")\""), ('+1', "'+1"), ('-1', "'-1"), ('@a', "'@a"),
    ('\tx', "'\tx"), ("'=x", "''=x"), (-1.5, '-1.5'), (-2, '-2'), (True, '1'), (None, ''),
    ('plain', 'plain'), ('a=b', 'a=b'), ("'tis", "'tis")])
def test_text_of_a_cell_is_no_formula(tmp_path, value, written):
    write_csv(tmp_path / 'x.csv', ['a', 'b'], [{'a': value, 'b': 0}])
    assert (tmp_path / 'x.csv').read_text().splitlines()[1] == f'{written},0'


@given(st.text(st.characters(exclude_categories=['Cs', 'Cc'])) | st.text("'=+-@a", max_size=5))
def test_text_of_a_cell_is_read_back(tmp_path_factory, text):
    path = tmp_path_factory.mktemp('csv') / 'x.csv'
    write_csv(path, ['a', 'b'], [{'a': text, 'b': 1}])
    rows = [cells for _, cells in csv_rows(path)]
    assert [plain_cell(cells[0]) for cells in rows[1:]] == [text]
