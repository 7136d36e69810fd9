# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start of the nodes: parameters, help and refusals, each with its exit code."""

from dataclasses import fields
from importlib import import_module
import signal

import pytest

from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.paths import share_path

pytest.importorskip('rclpy', reason='rclpy is not installed')

from adversarial_lcd_ros.nodes.attacker import AttackerNode
from adversarial_lcd_ros.nodes.lcd import LcdNode
from adversarial_lcd_ros.nodes.runtime import run_node

NODES = ('graph_builder', 'attacker', 'lcd', 'bag_replay')


@pytest.fixture
def main(ros):
    """Return a node's main by name, run in this process as a command would."""
    def run(name, *arguments):
        return import_module(f'adversarial_lcd_ros.nodes.{name}').main(list(arguments))
    return run


@pytest.mark.parametrize('name', NODES)
def test_help_tells_topics_and_every_parameter(main, capsys, name):
    assert main(name, '--help') == 0
    text = capsys.readouterr().out
    module = import_module(f'adversarial_lcd_ros.nodes.{name}')
    node_class = next(c for c in vars(module).values()
                      if isinstance(c, type) and getattr(c, 'default_name', '') == name)
    for config in node_class.configs:
        for entry in fields(config):
            assert f'  {entry.name} := ' in text
    assert 'Subscribes:' in text
    assert '/diagnostics' in text


@pytest.mark.parametrize('name', NODES)
@pytest.mark.parametrize(('arguments', 'expected'), [
    (('--ros-args', '-p', 'epsilon:=1'), 'unknown parameter epsilon'),
    (('--ros-args', '-r', 'not a rule'), 'not a rule'),
    (('--ros-args', '--params-file', '/nowhere.yaml'), 'nowhere.yaml'),
    (('--fast',), 'unrecognized arguments: --fast'),
])
def test_a_wrong_command_line_is_refused_with_exit_code_2(main, capsys, name, arguments, expected):
    assert main(name, *arguments) == 2
    assert expected in capsys.readouterr().err


@pytest.mark.parametrize(('name', 'assignment', 'expected'), [
    ('lcd', 'target:=best', 'there are: wl'),
    ('lcd', 'threshold:=1.5', 'expected 0.0 to 1.0'),
    ('lcd', 'candidates:=many', 'expected int, found str'),
    ('lcd', 'min_gap_s:=.nan', 'finite'),
    ('attacker', 'ratio:=true', 'expected float, found bool'),
    ('bag_replay', 'window:=2', 'parameter bag is empty'),
])
def test_a_wrong_value_is_one_line_on_stderr(main, capsys, name, assignment, expected):
    assert main(name, '--ros-args', '-p', assignment) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert error.startswith(f'{name}: ')
    assert error.count('\n') == 1


def test_a_missing_model_is_exit_code_1(main, capsys, tmp_path):
    assert main('lcd', '--ros-args', '-p', f'model:={tmp_path / "no.json"}') == 1
    assert 'no.json' in capsys.readouterr().err


def test_input_and_output_on_one_topic_is_exit_code_2(main, capsys):
    assert main('attacker', '--ros-args', '-r', 'graph:=graph_clean') == 2
    assert 'both resolve to /graph_clean' in capsys.readouterr().err


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_node_with_exit_code_0(main, monkeypatch, number):
    work, before = AttackerNode.work, signal.getsignal(number)

    def work_with_signal(self, spin):
        signal.raise_signal(number)
        return work(self, spin)

    monkeypatch.setattr(AttackerNode, 'work', work_with_signal)
    assert run_node(AttackerNode, []) == 0
    assert signal.getsignal(number) is before


def test_parameters_tell_range_and_description_and_are_read_only(ros, lcd_model):
    from rclpy.parameter import Parameter
    node = ros.start(LcdNode, model=lcd_model)
    threshold = node.describe_parameter('threshold')
    assert threshold.description.startswith('A loop closure is declared')
    (limits,) = threshold.floating_point_range
    assert (limits.from_value, limits.to_value) == (0.0, 1.0)
    (limits,) = node.describe_parameter('candidates').integer_range
    assert (limits.from_value, limits.to_value) == (1, 1000)
    assert 'one of wl' in node.describe_parameter('target').additional_constraints
    (result,) = node.set_parameters([Parameter('threshold', value=0.9)])
    assert not result.successful
    assert node.get_parameter('threshold').value == 0.5


def test_a_whole_number_is_taken_for_a_real_parameter(ros):
    node = ros.start(AttackerNode, ratio=1, deadline_ms=50)
    assert node.get_parameter('ratio').value == 1.0
    assert node.settings[0].deadline_ms == 50.0


def test_the_parameter_file_that_ships_is_read(ros, lcd_model, tmp_path):
    shipped = share_path('config/params.yaml').read_text(encoding='utf-8')
    changed = tmp_path / 'params.yaml'
    changed.write_text(shipped.replace('candidates: 8', 'candidates: 5'), encoding='utf-8')
    node = LcdNode(context=ros.context, use_global_arguments=False, namespace='robot1',
                   cli_args=['--ros-args', '--params-file', str(changed),
                             '-p', f'model:={lcd_model}'])
    assert node.detector.config.candidates == 5
    node.destroy_node()


def test_use_sim_time_is_no_unknown_parameter(ros):
    node = ros.start(AttackerNode, use_sim_time=True)
    assert node.get_parameter('use_sim_time').value is True


def test_unknown_parameters_are_named_with_the_known_ones(ros):
    with pytest.raises(ConfigError, match=r'unknown parameter ratioo \(did you mean ratio\?\) '
                       r'for attacker; .*ratio, '):
        ros.start(AttackerNode, ratioo=1e-4)


def test_names_follow_the_namespace(ros):
    node = ros.start(AttackerNode, '__ns:=/robot1')
    assert node.resolve_topic_name('graph') == '/robot1/graph'
