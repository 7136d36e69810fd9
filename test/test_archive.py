# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A run as one file: what is read back makes the same report; what is damaged is one line."""

import json
import lzma

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
import pytest
from results_factory import frames, replay

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.errors import AdversarialLcdError
from adversarial_lcd_ros.evaluation import archive


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope='module')
def packed(tmp_path_factory):
    """A folder, its archive, and the lines in it."""
    folder = frames(tmp_path_factory.mktemp('archive') / 'a')
    path = folder.with_name('a.jsonl.xz')
    archive.pack_results(folder, path)
    return folder, path, lzma.decompress(path.read_bytes()).splitlines(keepends=True)


def test_a_report_of_the_file_is_that_of_the_folder(packed, tmp_path, capsys):
    folder = packed[0]
    assert main(['report', str(folder), '--archive', 'run.jsonl.xz']) == 0
    assert main(['report', 'run.jsonl.xz']) == 0
    again = tmp_path / 'results/run'
    for name in ('report.html', 'summary.json', 'summary.csv', 'cells.csv', 'tables.md'):
        assert (again / name).read_bytes() == (folder / name).read_bytes()
    rows = len(json.loads((folder / 'summary.json').read_text())['rows'])
    assert f'{rows} of {rows} rows of figures' in capsys.readouterr().err
    # What lies in the folder of other settings is left out.
    assert len((again / 'cells.jsonl').read_text().splitlines()) == 4


def test_it_does_not_tell_where_files_lay(tmp_path):
    folder = frames(tmp_path / 'a')
    path = folder / 'configuration.json'
    text = json.loads(path.read_text())
    text |= {'command_line': ['/home/somebody/bin/adversarial-lcd', '--lcd-model=/home/somebody/m',
                              '/data/tour@0:0.5'], 'seed': 7}
    path.write_text(json.dumps(text))
    archive.pack_results(folder, tmp_path / 'a.jsonl.xz')
    archive.unpack_results(tmp_path / 'a.jsonl.xz', tmp_path / 'b')
    assert json.loads((tmp_path / 'b/configuration.json').read_text()) == {
        **text, 'command_line': ['adversarial-lcd', '--lcd-model=m', 'tour@0:0.5']}


def test_figures_that_are_not_of_the_cells_are_told(packed, tmp_path, capsys):
    head, *cells = packed[2]
    values = json.loads(head)
    values['summary']['rows'][0]['decline_pp'] += 1.0
    (tmp_path / 'x.jsonl.xz').write_bytes(lzma.compress(
        b''.join([json.dumps(values).encode() + b'\n', *cells])))
    assert main(['report', 'x.jsonl.xz', '--output', 'x']) == 0
    rows = len(values['summary']['rows'])
    assert f'warning: only {rows - 1} of {rows} rows' in capsys.readouterr().err


def changed(lines, **values):
    return b''.join([json.dumps({**json.loads(lines[0]), **values}).encode() + b'\n', *lines[1:]])


@pytest.mark.parametrize(('damage', 'said'), [
    (lambda lines: b'PK' + b''.join(lines), 'cannot be unpacked as xz'),
    (lambda lines: lzma.compress(b''.join(lines))[:-40], 'cut off'),
    (lambda lines: lzma.compress(b''.join(lines)) + b'more', 'behind its end'),
    (lambda lines: lzma.compress(b''.join(lines)[:-1]), 'ends within a line'),
    (lambda lines: lzma.compress(b''), 'line 1 cannot be read'),
    (lambda lines: lzma.compress(b''.join(lines[1:])), 'is no archive of results'),
    (lambda lines: lzma.compress(changed(lines, version=2)), 'found'),
    (lambda lines: lzma.compress(changed(lines, summary=[])), 'summary missing'),
    (lambda lines: lzma.compress(changed(lines, releases={'../../evil': {}})), 'releases of'),
    (lambda lines: lzma.compress(lines[0] + b'[]\n'), 'line 2 is a list'),
    (lambda lines: lzma.compress(lines[0] + b'{}\n'), 'has no key'),
    (lambda lines: lzma.compress(lines[0] + b'{"key": "a", "key": "b"}\n'), 'there twice'),
    (lambda lines: lzma.compress(lines[0] + b'[' * 5000 + b'\n'), 'line 2')])
def test_what_is_damaged_is_one_line_and_leaves_nothing(packed, tmp_path, capsys, damage, said):
    (tmp_path / 'x.jsonl.xz').write_bytes(damage(packed[2]))
    assert main(['report', 'x.jsonl.xz', '--output', 'out']) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count('\n') == 1
    assert not (tmp_path / 'out').exists()
    assert not list(tmp_path.parent.glob('*evil*'))


def test_what_grows_without_end_is_not_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr(archive, '_MAX_BYTES', 8 * archive.MIB)
    monkeypatch.setattr(archive, '_MAX_LINE', 2 * archive.MIB)
    for line, said in ((b'\n', 'when unpacked'), (b'0' * archive.MIB, 'a line of more than')):
        (tmp_path / 'x').write_bytes(lzma.compress(line * (64 * archive.MIB // len(line))))
        with pytest.raises(AdversarialLcdError, match=said):
            for _ in archive._lines(tmp_path / 'x'):
                pass


def test_what_cannot_be_archived_or_read_is_said(packed, tmp_path, capsys):
    replay(tmp_path / 'live')
    (tmp_path / 'used').mkdir()
    (tmp_path / 'used/file').touch()
    folder, path, _ = packed
    for arguments, said in (
            (['live', '--archive', 'x'], 'not made of cells'),
            ([str(folder), '--output', 'b'], '--output is for an archived run'),
            ([str(path), '--archive', 'x'], '--archive is for a results folder'),
            ([str(path), '--output', 'used'], 'is not empty'),
            ([str(path), '--output', str(path)], 'cannot be made')):
        assert main(['report', *arguments]) == 2
        assert said in capsys.readouterr().err
    assert not (tmp_path / 'x').exists()


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None,
          max_examples=40)
@given(st.binary(max_size=200), st.booleans())
def test_any_bytes_give_an_error_of_one_line(tmp_path, data, under_xz):
    path = tmp_path / 'x'
    path.write_bytes(lzma.compress(data) if under_xz else data)
    with pytest.raises(AdversarialLcdError) as caught:
        archive.unpack_results(path, tmp_path / 'out')
    assert '\n' not in str(caught.value)
