# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command: thin, errors in one line, exit codes."""

import os
import re
import shlex
import signal
import subprocess
import sys

from graph_factory import make_graph
import numpy as np
import pytest

from adversarial_lcd_ros import __version__
from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.commands.examples import EXAMPLES
from adversarial_lcd_ros.commands.parser import make_parser
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.sequences.bagfile import BagWriter
from adversarial_lcd_ros.settings import render_parameters

COMMANDS = ('demo', 'import', 'evaluate', 'report', 'train', 'fetch-model', 'compile', 'clean',
            'convert', 'inspect', 'params')


def parsers():
    """Return the parser of every command, by name."""
    return next(action for action in make_parser()._actions if action.choices).choices


def wire(payload):
    """Return the CDR of the byte array that carries a payload."""
    types = codec.typestore().types
    layout = types['std_msgs/msg/MultiArrayLayout'](dim=[], data_offset=0)
    message = types['std_msgs/msg/UInt8MultiArray'](
        layout=layout, data=np.frombuffer(payload, np.uint8))
    return bytes(codec.typestore().serialize_cdr(message, 'std_msgs/msg/UInt8MultiArray'))


def payloads():
    """Return one payload of every message, by name."""
    graph = make_graph()
    header = {'stamp_ns': 1_500_000_000, 'frame_id': 'camera', 'sequence': 4}
    return {
        'MultiTierGraph': codec.encode_graph(graph),
        'LoopClosure': codec.encode_loop_closure(codec.LoopClosure(
            **header, is_loop=True, probability=0.75, match_stamp_ns=1, match_sequence=2)),
        'LcdQuery': codec.encode_query(codec.LcdQuery(9, graph)),
        'LcdAnswer': codec.encode_answer(codec.LcdAnswer(9, True, True, 0.75)),
        'AttackReport': codec.encode_attack_report(codec.AttackReport(
            **header, status='success', query_budget=40, queries=40)),
    }


@pytest.fixture
def graph_bag(tmp_path):
    path = tmp_path / 'recorded'
    with BagWriter(path) as bag:
        for number, nodes in enumerate((6, 8, 10)):
            graph = make_graph(nodes, objects=2)
            bag.write('/graph', 'std_msgs/msg/UInt8MultiArray', number * 500_000_000,
                      wire(codec.encode_graph(graph)))
        bag.write('/loop_closures', 'std_msgs/msg/UInt8MultiArray', 1_000_000_000,
                  wire(payloads()['LoopClosure']))
    return path


def test_version_and_commands(capsys):
    with pytest.raises(SystemExit, match='0'):
        main(['--version'])
    assert capsys.readouterr().out == f'adversarial-lcd {__version__}\n'
    with pytest.raises(SystemExit, match='0'):
        main(['--help'])
    out = capsys.readouterr().out
    for command in COMMANDS:
        assert f'\n  {command} ' in out


@pytest.mark.parametrize('command', COMMANDS)
def test_every_command_explains_itself(command, capsys):
    with pytest.raises(SystemExit, match='0'):
        main([command, '--help'])
    assert 'usage: adversarial-lcd' in capsys.readouterr().out


def test_the_whole_help_shows_defaults_and_ranges(capsys):
    with pytest.raises(SystemExit, match='0'):
        main(['demo', '--help-all'])
    out = ' '.join(capsys.readouterr().out.split())
    assert f'(0.0 to 1.0, default: {AttackConfig().ratio})' in out


@pytest.mark.parametrize('command', COMMANDS)
def test_help_names_settings_and_explains_none(command):
    parser = parsers()[command]
    text = parser.format_help()
    assert len(text.splitlines()) < 150
    assert all(re.search(rf'{re.escape(option)}\b', text)
               for option in parser.option_names() if not option.startswith('--no-'))


@pytest.mark.parametrize('command', EXAMPLES)
def test_examples_of_the_help_are_right(command):
    assert f'adversarial-lcd {EXAMPLES[command][0][0]}' in parsers()[command].format_help()
    for line, _ in EXAMPLES[command]:
        assert line.split()[0] == command
        make_parser().parse_args(shlex.split(line.partition('>')[0]))


def test_every_command_has_its_place_in_the_help(capsys):
    assert set(parsers()) == {name for group in make_parser().groups.values() for name in group}
    with pytest.raises(SystemExit, match='2'):
        main([])
    assert make_parser().format_help() == capsys.readouterr().err


@pytest.mark.parametrize('arguments', [
    [], ['nonsense'], ['inspect'], ['demo', '--ratio', 'much'], ['demo', '--no-such-option']])
def test_wrong_command_line_is_a_usage_error(arguments, capsys):
    with pytest.raises(SystemExit, match='2'):
        main(arguments)
    assert 'usage: adversarial-lcd' in capsys.readouterr().err


def test_known_error_is_one_line_and_exit_code_2(tmp_path, capsys):
    assert main(['inspect', str(tmp_path / 'gone')]) == 2
    captured = capsys.readouterr()
    assert captured.err == f'error: there is no file or folder {tmp_path / "gone"}\n'
    assert captured.out == ''


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_interrupt_ends_with_130(monkeypatch, capsys, number):
    def interrupt(destination, progress, anew):
        signal.raise_signal(number)
    monkeypatch.setattr('adversarial_lcd_ros.provision.fetch_object_model', interrupt)
    before = signal.getsignal(number)
    assert main(['fetch-model']) == 130
    assert capsys.readouterr().err == 'interrupted\n'
    assert signal.getsignal(number) == before


def test_params_prints_the_parameter_file(capsys):
    assert main(['params']) == 0
    assert capsys.readouterr().out == render_parameters()


def test_inspect_shows_topics_and_graphs_of_a_bag(graph_bag, capsys):
    assert main(['inspect', str(graph_bag)]) == 0
    lines = capsys.readouterr().out.splitlines()
    rows = [line.replace('│', ' ').split() for line in lines if line.startswith('│')]
    kind = 'std_msgs/msg/UInt8MultiArray'
    assert rows[0] == ['/graph', kind, '3', 'MultiTierGraph']
    assert rows[1] == ['/loop_closures', kind, '1', 'LoopClosure']
    assert ' '.join(rows[2]) == '/graph 8.0 (6 to 10) 4.0 (4 to 4) 2.0 (2 to 2)'
    assert lines[0] == f'{graph_bag}: 1.0 s'


def test_inspect_refuses_a_topic_of_graphs_that_stops_being_one(tmp_path, capsys):
    path = tmp_path / 'broken'
    with BagWriter(path) as bag:
        for number, payload in enumerate((payloads()['MultiTierGraph'], b'\x00\x01\x00\x00junk')):
            bag.write('/graph', 'std_msgs/msg/UInt8MultiArray', number, wire(payload))
    assert main(['inspect', str(path)]) == 2
    assert 'are no MultiTierGraph' in capsys.readouterr().err


@pytest.mark.parametrize(('name', 'shown'), [
    ('MultiTierGraph', 'MultiTierGraph: n = 6, m = 4, 2 objects'),
    ('LcdQuery', 'LcdQuery 9: n = 6, m = 4, 2 objects'),
    ('LoopClosure', 'probability=0.75'),
    ('LcdAnswer', 'probability=0.75'),
    ('AttackReport', "status='success'"),
])
def test_inspect_knows_every_payload(tmp_path, capsys, name, shown):
    path = tmp_path / 'payload.cdr'
    path.write_bytes(payloads()[name])
    assert main(['inspect', str(path)]) == 0
    assert shown in capsys.readouterr().out


def test_inspect_says_what_a_file_is_not(tmp_path, capsys):
    path = tmp_path / 'notes.txt'
    path.write_text('hello')
    assert main(['inspect', str(path)]) == 2
    assert 'is neither a bag nor a payload of MultiTierGraph' in capsys.readouterr().err


def test_import_reports_what_it_wrote(tmp_path, capsys):
    cv2 = pytest.importorskip('cv2')
    source = tmp_path / 'frames'
    source.mkdir()
    for number in range(3):
        cv2.imwrite(str(source / f'{number}.png'), np.full((24, 32, 3), 60 * number, np.uint8))
    command = ['import', str(source), str(tmp_path / 'bag'), '--rate-hz', '10']
    assert main(command) == 0
    captured = capsys.readouterr()
    assert '3 frames of 32 x 24 pixels, 0 poses, 0.2 s' in captured.out
    assert f'next: adversarial-lcd evaluate {tmp_path / "bag"}' in captured.err
    assert main(command) == 2
    assert 'exists already' in capsys.readouterr().err
    assert main([*command, '--overwrite']) == 0


@pytest.mark.parametrize(('arguments', 'meant'), [
    (['evalute', 'bag'], 'there is no command evalute (did you mean evaluate?); there are: demo,'),
    (['demo', '--retio', '1e-4'], 'unknown: --retio (did you mean --ratio?)'),
    (['evaluate', 'bag', '--lcd-tresholt', '1'], '(did you mean --lcd-threshold?)'),
    (['evaluate', 'bag', '--nodes', '20'], 'unknown: --nodes (did you mean --nodes-moved?)'),
    (['params', '--lcd-target', 'wl'], 'unknown: --lcd-target'),
])
def test_a_slip_of_the_pen_is_told_what_was_meant(arguments, meant, capsys):
    with pytest.raises(SystemExit, match='2'):
        main(arguments)
    assert meant in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize(('arguments', 'said'), [
    (['--ratio', '2'], 'error: --ratio = 2.0: '),
    (['--lcd-threshold', '-1'], 'error: --lcd-threshold = -1.0: '),
    (['--builder-features', '1'], 'error: --builder-features = 1: '),
    (['--search', 'recal'], "'recal' (did you mean 'recall'?); there are: "),
    (['--recipe', 'quik'], "error: no recipe 'quik' (did you mean 'quick'?); there are: "),
])
def test_errors_name_the_option(arguments, said, tmp_path, capsys):
    pytest.importorskip('rclpy', reason='rclpy is not installed')
    assert main(['demo', '--output', str(tmp_path), *arguments]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(('content', 'said'), [
    ('lcd: {tresholt: 0.7}', 'unknown setting tresholt (did you mean threshold?); there are: '),
    ('lcdd: {threshold: 0.7}', 'unknown section lcdd (did you mean lcd?); there are: ')])
def test_settings_files_are_told_what_was_meant(content, said, tmp_path, capsys):
    (tmp_path / 'settings.yaml').write_text(content)
    assert main(['build', str(tmp_path), str(tmp_path / 'bag'), '--config',
                 str(tmp_path / 'settings.yaml')]) == 2
    assert said in capsys.readouterr().err


def test_recipes_are_told_what_was_meant(tmp_path, capsys):
    pytest.importorskip('rclpy', reason='rclpy is not installed')
    recipe = tmp_path / 'mine.yaml'
    recipe.write_text('attacks: [{name: a, serch: recall}]')
    assert main(['demo', '--output', str(tmp_path), '--recipe', str(recipe)]) == 2
    assert 'serch (did you mean search?)' in capsys.readouterr().err


def test_quiet_says_results_and_warnings_alone(tmp_path, capsys, monkeypatch):
    from adversarial_lcd_ros.commands.common import progress_bar, tell
    for options, said in ((['--quiet'], 'warning: b\n'), ([], 'a\nwarning: b\n')):
        assert main(['params', *options]) == 0
        assert capsys.readouterr().out == render_parameters()
        tell('a')
        tell('warning: b')
        if options:
            with progress_bar('c') as progress:
                progress(1, 2)
        assert capsys.readouterr().err == said


def test_a_shell_is_told_how_to_go_on(tmp_path):
    pytest.importorskip('argcomplete', reason='argcomplete is not installed')
    answer = tmp_path / 'answer'
    environment = {**os.environ, '_ARGCOMPLETE': '1', '_ARGCOMPLETE_SUPPRESS_SPACE': '1',
                   '_ARGCOMPLETE_STDOUT_FILENAME': str(answer), '_ARGCOMPLETE_IFS': '\n'}
    for line, expected in (('adversarial-lcd ev', 'evaluate'),
                           ('adversarial-lcd convert --ov', '--overwrite')):
        subprocess.run([sys.executable, '-m', 'adversarial_lcd_ros.cli'], check=True, env={
            **environment, 'COMP_LINE': line, 'COMP_POINT': str(len(line))}, timeout=60)
        assert answer.read_text().split('\n') == [expected]
