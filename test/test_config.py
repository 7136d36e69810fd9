# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings: checked on construction, the same on the command line, in files and in nodes."""

from argparse import ArgumentParser
from dataclasses import fields
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
import pytest
import yaml

from adversarial_lcd_ros.config import AttackConfig, BuilderConfig, Config, LabelConfig, LcdConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.settings import (
    NODE_CONFIGS,
    SECTIONS,
    add_config_options,
    add_models_option,
    config_from_options,
    load_settings,
    render_parameters,
)

PARAMS = Path(__file__).resolve().parents[1] / 'config' / 'params.yaml'
SETTINGS = [pytest.param(config, entry, id=f'{config.__name__}.{entry.name}')
            for configs in SECTIONS.values() for config in configs for entry in fields(config)]


def test_every_config_class_is_in_a_section():
    listed = {config for configs in SECTIONS.values() for config in configs}
    # Those of adversarial_lcd_ros.config: a recipe has a class of its own, which no node has.
    assert listed == {config for config in Config.__subclasses__()
                      if config.__module__.startswith('adversarial_lcd_ros.config.')}


@pytest.mark.parametrize(('config', 'entry'), SETTINGS)
def test_every_setting_is_explained_and_bounded(config, entry):
    assert entry.metadata['help'].strip().endswith('.')
    assert entry.name == entry.name.lower()
    number = isinstance(entry.default, int | float) and not isinstance(entry.default, bool)
    bounded = entry.metadata['low'] is not None and entry.metadata['high'] is not None
    assert bounded == number


@pytest.mark.parametrize(('config', 'entry'), SETTINGS)
def test_every_setting_refuses_what_is_out_of_range(config, entry):
    if isinstance(entry.default, str):
        wrong = ['nothing of the kind'] if entry.metadata['choices'] else [1, None]
    elif isinstance(entry.default, bool):
        wrong = [1, 'true']
    else:
        wrong = [entry.metadata['low'] - 1, entry.metadata['high'] + 1, 'many', True,
                 float('nan')]
    for value in wrong:
        with pytest.raises(ConfigError, match=entry.name):
            config.from_mapping({entry.name: value})


def test_unknown_setting_names_the_known_ones():
    with pytest.raises(ConfigError, match=r'unknown setting ratoi .*ratio'):
        AttackConfig.from_mapping({'ratoi': 1e-4})


@given(st.floats(0.0, 1.0))
def test_any_value_in_range_is_kept(ratio):
    assert AttackConfig.from_mapping({'ratio': ratio}).ratio == ratio


def test_whole_number_serves_as_real_but_not_the_other_way_round():
    assert type(AttackConfig.from_mapping({'deadline_ms': 30}).deadline_ms) is float
    with pytest.raises(ConfigError, match='expected int'):
        AttackConfig.from_mapping({'seed': 1.0})


def test_params_yaml_is_in_step():
    assert PARAMS.read_text(encoding='utf-8') == render_parameters(), (
        'run: adversarial-lcd params > config/params.yaml')


def test_params_yaml_gives_every_node_its_defaults():
    sections = load_settings(PARAMS)
    assert set(sections) == set(NODE_CONFIGS)
    for node, configs in NODE_CONFIGS.items():
        defaults = {entry.name: entry.default for config in configs for entry in fields(config)}
        assert sections[node] == defaults


def test_parameters_of_a_node_have_distinct_names():
    for node, configs in NODE_CONFIGS.items():
        names = [entry.name for config in configs for entry in fields(config)]
        assert len(names) == len(set(names)), node


def parse(arguments, *configs):
    parser = ArgumentParser()
    parser.add_argument('--config', type=Path)
    add_models_option(parser)
    for config, prefix in configs:
        add_config_options(parser, config, prefix)
    return parser.parse_args(arguments)


def test_command_line_wins_over_file_and_file_over_default(tmp_path):
    file = tmp_path / 'settings.yaml'
    file.write_text('attacker: {ratio: 0.001, seed: 7}\n')
    options = parse(['--config', str(file), '--ratio', '0.002'], (AttackConfig, ''))
    config = config_from_options(options, AttackConfig)
    assert (config.ratio, config.seed, config.mode) == (0.002, 7, AttackConfig().mode)


def test_a_folder_of_models_gives_all_that_is_trained(tmp_path):
    sections = ((BuilderConfig, 'builder-'), (LcdConfig, 'lcd-'), (AttackConfig, ''))
    arguments = ['--models', str(tmp_path), '--builder-vocabulary', 'mine.npz']
    options = parse(arguments, *sections)
    with pytest.raises(ConfigError, match=r'"adversarial-lcd train" has written, with vocab'):
        config_from_options(options, LcdConfig)
    (tmp_path / 'vocabulary.npz').touch()
    assert config_from_options(options, BuilderConfig) == BuilderConfig(vocabulary='mine.npz')
    assert config_from_options(options, LcdConfig).model == str(tmp_path)
    assert config_from_options(options, AttackConfig).surrogate_data == str(
        tmp_path / 'surrogate_data.npz')
    assert config_from_options(options, LabelConfig) == LabelConfig()


def test_settings_of_the_same_name_are_told_apart():
    both = ((BuilderConfig, 'builder-'), (LcdConfig, 'lcd-'), (LabelConfig, 'label-'))
    options = parse(['--builder-model', 'a.onnx', '--lcd-min-gap-s', '3'], *both)
    assert config_from_options(options, BuilderConfig).model == 'a.onnx'
    assert config_from_options(options, LcdConfig) == LcdConfig(min_gap_s=3.0)
    assert config_from_options(options, LabelConfig) == LabelConfig()


def test_switches_go_both_ways():
    assert config_from_options(parse(['--hard-answers'], (LcdConfig, '')), LcdConfig).hard_answers
    options = parse(['--no-hard-answers'], (LcdConfig, ''))
    assert not config_from_options(options, LcdConfig).hard_answers


def test_node_parameter_file_serves_as_settings_file(tmp_path):
    file = tmp_path / 'params.yaml'
    file.write_text(yaml.safe_dump({
        '/**/lcd': {'ros__parameters': {'target': 'vbow'}},
        '/**/attacker': {'ros__parameters': {'max_backlog': 3}}}))
    options = parse(['--config', str(file)], (LcdConfig, ''))
    assert config_from_options(options, LcdConfig).target == 'vbow'
    assert config_from_options(options, AttackConfig) == AttackConfig()


@pytest.mark.parametrize(('text', 'message'), [
    ('lcd: {taget: wl}', r'lcd: unknown setting taget \(did you mean target\?\); there are: '),
    ('lcs: {target: wl}', r'unknown section lcs \(did you mean lcd\?\); there are: .*lcd'),
    ('- 1', 'expected sections, found list'),
    ('lcd: 3', 'expected NAME: VALUE, found 3'),
    ('a: [', r'settings\.yaml cannot be read as YAML: while parsing'),
])
def test_bad_settings_file_is_refused_with_its_reason(tmp_path, text, message):
    file = tmp_path / 'settings.yaml'
    file.write_text(text)
    with pytest.raises(ConfigError, match=message):
        load_settings(file)


def test_missing_settings_file_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r'gone\.yaml.*No such file'):
        load_settings(tmp_path / 'gone.yaml')


@pytest.mark.parametrize('namespace', ['/', '/robot/front'])
def test_nodes_take_params_yaml_in_any_namespace(namespace):
    pytest.importorskip('rclpy', reason='rclpy is not installed')
    import rclpy
    from rclpy.context import Context
    from rclpy.node import Node
    context = Context()
    rclpy.init(context=context, args=['--ros-args', '--params-file', str(PARAMS),
                                      '-r', f'__ns:={namespace}'])
    node = Node('attacker', context=context, automatically_declare_parameters_from_overrides=True)
    try:
        found = {name: parameter.value for name, parameter
                 in node.get_parameters_by_prefix('').items()}
    finally:
        node.destroy_node()
        context.try_shutdown()
    defaults = {entry.name: entry.default for config in NODE_CONFIGS['attacker']
                for entry in fields(config)}
    assert {name: found.get(name) for name in defaults} == defaults
