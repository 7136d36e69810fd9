# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is printed reaches terminals of any encoding and width, and names stay as they are."""

import io
import os
from pathlib import Path
import subprocess
import sys

import bag_factory as make
from graph_factory import make_graph
import numpy as np
import pytest

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.commands.common import print_rows, progress_bar
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.payload import WIRE_TYPE
from adversarial_lcd_ros.sequences import import_sequence
from adversarial_lcd_ros.sequences.bagfile import BagWriter

# Markup of rich that is opened, closed without being open, or a style that there is not.
NAMES = ('[/b]', '[bold]', 'a[/b]c', '[nonsense]', ':smile:', '[link=x]')
ENCODINGS = ('utf-8', 'latin-1', 'ascii', 'cp437')


class Terminal(io.TextIOWrapper):
    """A stream of an encoding, as strict as that of a shell."""

    def __init__(self, encoding):
        super().__init__(io.BytesIO(), encoding=encoding, errors='strict')

    def text(self):
        self.flush()
        return self.buffer.getvalue().decode(self.encoding)


@pytest.fixture
def terminal(monkeypatch):
    """Return a function that puts a terminal in place of stdout and stderr."""
    def use(encoding, width=150):
        opened = Terminal(encoding)
        monkeypatch.setenv('COLUMNS', str(width))
        monkeypatch.setattr(sys, 'stdout', opened)
        monkeypatch.setattr(sys, 'stderr', opened)
        return opened
    return use


@pytest.fixture
def bag(tmp_path):
    """Return a bag whose topics have names that rich would take for markup."""
    types = codec.typestore().types
    graph = codec.encode_graph(make_graph(8, objects=2))
    message = types['std_msgs/msg/UInt8MultiArray'](
        layout=types['std_msgs/msg/MultiArrayLayout'](dim=[], data_offset=0),
        data=np.frombuffer(graph, np.uint8))
    wire = bytes(codec.typestore().serialize_cdr(message, WIRE_TYPE))
    path = tmp_path / 'bäg → é'
    with BagWriter(path) as writer:
        for number, name in enumerate(NAMES):
            writer.write(f'/{name}', WIRE_TYPE, number, wire)
    return path


@pytest.mark.parametrize('encoding', ENCODINGS)
@pytest.mark.parametrize('width', [40, 400])
def test_a_bag_is_shown_on_any_terminal(terminal, bag, encoding, width):
    opened = terminal(encoding, width)
    assert main(['inspect', str(bag)]) == 0
    text = opened.text()
    assert max(len(line) for line in text.splitlines()[1:]) <= width
    if width == 400:
        for name in NAMES:
            assert f'/{name} ' in text
    assert ('→' in text) == (encoding == 'utf-8')


@pytest.mark.parametrize('encoding', ENCODINGS)
def test_tables_of_an_evaluation_are_shown_on_any_terminal(terminal, tmp_path, encoding):
    opened = terminal(encoding)
    main(['inspect', str(tmp_path / 'none')])  # what every command does with its streams
    print_rows('The detector on [/bold]', [
        {'run': name, 'balanced': '75.0\u202f% → 50.0\u202f%'} for name in NAMES])
    text = opened.text()
    assert 'The detector on [/bold]' in text
    assert all(f' {name} ' in text for name in NAMES)
    if encoding in ('latin-1', 'ascii'):
        assert '75.0 % -> 50.0 %' in text


def test_names_in_a_progress_bar_stay_as_they_are(terminal):
    opened = terminal('ascii')
    main(['params'])
    with progress_bar('building [/b] [bold]') as progress:
        progress(1, 2)
    assert 'building [/b] [bold]' in opened.text()


def test_an_error_with_any_name_is_one_line(terminal, tmp_path):
    opened = terminal('ascii')
    assert main(['inspect', str(tmp_path / 'né[/b]\udcff')]) == 2
    text = opened.text()
    assert text.startswith('error: ')
    assert text.count('\n') == 1
    assert r'n?[/b]\udcff' in text  # what cannot be printed is spelt out


ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize(('redirection', 'said', 'code'), [
    ('>&-', 'error: there is no file or folder nowhere', 2), ('2>&-', '', 2),
    ('>&- 2>&- <&-', '', 2), ('2>/dev/full', '', 2)])
def test_a_stream_that_is_closed_or_full_changes_no_exit_code(tmp_path, redirection, said, code):
    """The number of a closed stream would be that of the next file, which gets what is said."""
    done = subprocess.run(
        ['bash', '-c', f'"{sys.executable}" -m adversarial_lcd_ros.cli inspect nowhere '
         f'{redirection}'], cwd=tmp_path, capture_output=True, text=True, check=False,
        env={**os.environ, 'PYTHONPATH': str(ROOT)}, timeout=300)
    assert (done.stderr.strip(), done.stdout, done.returncode) == (said, '', code)


def test_what_a_command_says_to_nobody_spoils_no_file(tmp_path):
    make.tum_folder(tmp_path / 'source')
    whole = import_sequence(tmp_path / 'source', tmp_path / 'a' / 'bag').path
    done = subprocess.run(
        ['bash', '-c', f'"{sys.executable}" -m adversarial_lcd_ros.cli import source b/bag '
         '>&- 2>&- <&-'], cwd=tmp_path, check=False, env={**os.environ, 'PYTHONPATH': str(ROOT)},
        timeout=300)
    assert done.returncode == 0
    for file in whole.iterdir():
        assert file.read_bytes() == (tmp_path / 'b' / 'bag' / file.name).read_bytes()
