# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Settings on the command line and in YAML files, made from adversarial_lcd_ros.config.

One file serves nodes and commands: what ``config/params.yaml`` gives a node as parameters, the
commands read as settings (``--config``). The command line wins over the file, the file over the
defaults.

An unknown name is an error.
"""

from __future__ import annotations

from argparse import SUPPRESS, ArgumentParser, BooleanOptionalAction, Namespace
from collections.abc import Iterator, Mapping
from dataclasses import Field, fields
from pathlib import Path
import re
import textwrap
from typing import Any

import yaml

from adversarial_lcd_ros.config import (
    AttackConfig,
    AttackerNodeConfig,
    BagReplayNodeConfig,
    BuilderConfig,
    Config,
    ConfigT,
    GraphBuilderNodeConfig,
    LabelConfig,
    LcdConfig,
    LcdNodeConfig,
    MapBuilderNodeConfig,
    MapConfig,
    MessageLimits,
    ReplayConfig,
)
from adversarial_lcd_ros.errors import ConfigError, FileError, with_suggestions
from adversarial_lcd_ros.files.reading import read_yaml
from adversarial_lcd_ros.paths import SURROGATE_DATA, VOCABULARY
from adversarial_lcd_ros.registry import Table

# The parameters of a node are the settings of its classes.
NODE_CONFIGS: Mapping[str, tuple[type[Config], ...]] = {
    'graph_builder': (BuilderConfig, GraphBuilderNodeConfig, MessageLimits),
    'lcd': (LcdConfig, LcdNodeConfig, MessageLimits),
    'attacker': (AttackConfig, AttackerNodeConfig, MessageLimits),
    'bag_replay': (ReplayConfig, BagReplayNodeConfig),
    'viewer': (MessageLimits,),
    'map_builder': (MapBuilderNodeConfig, MessageLimits),
}
# The sections of a settings file.
SECTIONS: Mapping[str, tuple[type[Config], ...]] = {
    **NODE_CONFIGS, 'labels': (LabelConfig,), 'map': (MapConfig,)}

# Settings that name trained artefacts, and their files in the folder of a training.
_TRAINED: Mapping[type[Config], tuple[str, str]] = {
    BuilderConfig: ('vocabulary', VOCABULARY), LcdConfig: ('model', ''),
    AttackConfig: ('surrogate_data', SURROGATE_DATA)}

_ANY_NAMESPACE = '/**/'
# What the headings of options begin with that settings have.
SETTINGS_OF = 'settings of '
# Behind a class and a dot: what its options start with. No setting has this name.
_PREFIX = '(prefix)'
_HEADER = """\
# Parameters of the nodes with their defaults, made by "adversarial-lcd params".
# Nodes: --ros-args --params-file FILE. Commands: --config FILE, which also takes a section
# "labels". Leave out what shall stay at its default.
"""


def limits(entry: Field[Any]) -> str:
    """Return the accepted values of a setting in a few words; '' if any will do."""
    low, high, choices = (entry.metadata[key] for key in ('low', 'high', 'choices'))
    if isinstance(choices, Table):
        return f'{"some" if entry.metadata["several"] else "one"} of {choices}'
    if choices:
        return f'one of {", ".join(choices)}'
    if low is None and high is None:
        return ''
    return f'{"any" if low is None else low} to {"any" if high is None else high}'


def render_parameters() -> str:
    """Return the ROS parameter file of all nodes: defaults, descriptions and ranges."""
    sections = (_render_node(node, configs) for node, configs in NODE_CONFIGS.items())
    return _HEADER + ''.join(sections)


def _render_node(node: str, configs: tuple[type[Config], ...]) -> str:
    lines = ['', f'{_ANY_NAMESPACE}{node}:', '  ros__parameters:']
    for entry in (entry for config in configs for entry in fields(config)):
        accepted = limits(entry)
        text = entry.metadata['help']
        text = f'{text.rstrip(".")} ({accepted}).' if accepted else text
        lines += textwrap.wrap(text, 95, initial_indent='    # ', subsequent_indent='    # ')
        lines.append(f'    {entry.name}: {_scalar(entry.default)}')
    return '\n'.join(lines) + '\n'


def _scalar(value: Any) -> str:
    text: str = yaml.safe_dump(value)
    return text.removesuffix('...\n').rstrip('\n')


def load_settings(path: Path) -> dict[str, dict[str, Any]]:
    """
    Return the sections of a settings file, with the settings that each one gives.

    Parameters
    ----------
    path : Path
        YAML; either sections of settings, or a ROS parameter file of the nodes.

    Raises
    ------
    ConfigError
        The file cannot be read, is no such YAML, or names an unknown section or setting.

    """
    try:
        content = read_yaml(path) or {}
    except FileError as error:
        raise ConfigError(f'settings file {error}') from error
    if not isinstance(content, dict):
        raise ConfigError(f'settings file {path}: expected sections, found '
                          f'{type(content).__name__}')
    found: dict[str, dict[str, Any]] = {}
    for key, values in content.items():
        section = str(key).removeprefix(_ANY_NAMESPACE).removeprefix('/')
        found[section] = _section(path, section, values)
    return found


def _section(path: Path, section: str, values: Any) -> dict[str, Any]:
    if section not in SECTIONS:
        raise ConfigError(f'settings file {path}: unknown section '
                          f'{with_suggestions([section], SECTIONS)}; there are: '
                          f'{", ".join(SECTIONS)}')
    if isinstance(values, dict) and set(values) == {'ros__parameters'}:
        values = values['ros__parameters']
    if values is None:
        return {}
    if not isinstance(values, dict):
        raise ConfigError(f'settings file {path}, {section}: expected NAME: VALUE, found '
                          f'{values!r}')
    known = {entry.name for config in SECTIONS[section] for entry in fields(config)}
    unknown = sorted(str(name) for name in values if name not in known)
    if unknown:
        raise ConfigError(f'settings file {path}, {section}: unknown setting '
                          f'{with_suggestions(unknown, sorted(known))}; there are: '
                          f'{", ".join(sorted(known))}')
    return values


def add_config_options(parser: ArgumentParser, config_class: type[Config],
                       prefix: str = '') -> None:
    """
    Give a parser an option for every setting of a class.

    Parameters
    ----------
    parser : ArgumentParser
    config_class : type
        A class of ``SECTIONS``.
    prefix : str
        Put before the names, where two classes of a command share some: ``--lcd-model``.

    """
    parser.set_defaults(**{f'{config_class.__name__}.{_PREFIX}': prefix})
    group = parser.add_argument_group(f'{SETTINGS_OF}{config_class.title}')
    for entry in fields(config_class):
        flag = f'--{prefix}{entry.name}'.replace('_', '-')
        shown = ', '.join(filter(None, (limits(entry), f'default: {_scalar(entry.default)}')))
        keywords: dict[str, Any] = {
            'dest': _destination(config_class, entry), 'default': SUPPRESS,
            'help': f'{entry.metadata["help"].rstrip(".")} ({shown})'.replace('%', '%%')}
        if isinstance(entry.default, bool):
            group.add_argument(flag, action=BooleanOptionalAction, **keywords)
        else:
            group.add_argument(flag, type=type(entry.default), metavar=_metavar(entry),
                               **keywords)


def _destination(config_class: type[Config], entry: Field[Any]) -> str:
    return f'{config_class.__name__}.{entry.name}'


def _metavar(entry: Field[Any]) -> str:
    return {int: 'N', float: 'X', str: 'TEXT'}[type(entry.default)]


def config_from_options(options: Namespace, config_class: type[ConfigT]) -> ConfigT:
    """
    Return the settings of a class: command line over ``--config`` file over defaults.

    Raises
    ------
    ConfigError
        The file is not one, or a value is of the wrong type or out of range.

    """
    return config_class.from_mapping(chosen_settings(options, config_class))


def with_options(text: str, options: Namespace) -> str:
    """Return a text that calls settings of the command line by the options that gave them."""
    for destination in vars(options):
        owner, _, name = destination.partition('.')
        if name and name != _PREFIX:
            prefix = getattr(options, f'{owner}.{_PREFIX}', '')
            option = f'--{prefix}{name}'.replace('_', '-')
            text = re.sub(rf'\b{re.escape(destination)}\b', option, text)
    return text


def add_models_option(parser: ArgumentParser) -> None:
    """Give a parser the option ``--models``: all trained artefacts at once."""
    parser.add_argument('--models', type=Path, metavar='FOLDER',
                        help='what "train" has written, in place of the models that ship; '
                        'settings of single files win over it')


def add_config_option(parser: ArgumentParser, of: str = '') -> None:
    """Give a parser the option ``--config``: a file of settings, all or those of some nodes."""
    parser.add_argument('--config', type=Path, metavar='FILE',
                        help=f'settings (YAML){of and f" of {of}"}; options of the command line '
                        'win over it')


def chosen_settings(options: Namespace, config_class: type[Config]) -> dict[str, Any]:
    """
    Return the settings of a class that the command line or the ``--config`` file names.

    Raises
    ------
    ConfigError
        The file is not one, or ``--models`` is no folder of a training.

    """
    values = dict(_from_file(options, config_class)) | _from_models(options, config_class)
    for entry in fields(config_class):
        destination = _destination(config_class, entry)
        if hasattr(options, destination):
            values[entry.name] = getattr(options, destination)
    return values


def _from_models(options: Namespace, config_class: type[Config]) -> dict[str, Any]:
    folder: Path | None = getattr(options, 'models', None)
    if folder is None or config_class not in _TRAINED:
        return {}
    name, file = _TRAINED[config_class]
    if not (folder / VOCABULARY).is_file():
        raise ConfigError(f'--models {folder}: expected a folder that "adversarial-lcd train" '
                          f'has written, with {VOCABULARY} in it')
    return {name: str(folder / file)}


def _from_file(options: Namespace, config_class: type[Config]) -> Iterator[tuple[str, Any]]:
    path: Path | None = getattr(options, 'config', None)
    if path is None:
        return
    own = {entry.name for entry in fields(config_class)}
    settings = load_settings(path)
    for section, configs in SECTIONS.items():
        if config_class in configs:
            for name, value in settings.get(section, {}).items():
                if name in own:
                    yield name, value
