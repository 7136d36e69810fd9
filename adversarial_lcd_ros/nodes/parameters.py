# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
ROS parameters made from the settings of the package: same names, defaults, ranges and texts.

Keys of a parameter file are ``/**/<node>``: one without the wildcard is missed by a node in a
namespace, and ``/**`` would give each node the parameters of the others, which it refuses as
unknown.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import Field, fields
from pathlib import Path
import sys
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from adversarial_lcd_ros.config import Config
from adversarial_lcd_ros.errors import ConfigError, FileError, with_suggestions
from adversarial_lcd_ros.files.keys import read_key
from adversarial_lcd_ros.settings import limits

# Declared by rclpy itself, on every node.
_RCLPY_PARAMETERS = ('use_sim_time', 'start_type_description_service')
_MAX_INTEGER = 2**63 - 1
_OVERRIDES = 'qos_overrides.'
_KINDS = ('publisher', 'subscription')
_POLICIES: Mapping[str, tuple[str, ...]] = {
    'history': ('keep_last', 'keep_all'), 'depth': (),
    'reliability': ('reliable', 'best_effort'), 'durability': ('volatile', 'transient_local')}


def load_key(path: str) -> bytes | None:
    """Return the key in a file that a parameter names, None for no name; raises ConfigError."""
    try:
        return read_key(Path(path)) if path else None
    except FileError as error:
        raise ConfigError(f'parameter key: {error}') from error


def declare(node: Node, configs: Sequence[type[Config]]) -> list[Any]:
    """
    Declare every setting of the given classes as a parameter, and return the settings.

    The parameters are read-only: the core is made from them once. A whole number is taken for
    a real parameter (``-p ratio:=1``), which rclpy alone would refuse.

    Parameters
    ----------
    node : Node
        Made with ``automatically_declare_parameters_from_overrides``.
    configs : sequence of Config classes
        Without a name in common.

    Raises
    ------
    ConfigError
        An override is unknown, of the wrong type or out of range.

    """
    given = {name: getattr(value, 'value', value)
             for name, value in node.get_parameters_by_prefix('').items()}
    _check_rclpys({name: given.pop(name) for name in list(given)
                   if name in _RCLPY_PARAMETERS or name.startswith(_OVERRIDES)})
    known = {entry.name for config in configs for entry in fields(config)}
    unknown = sorted(set(given) - known)
    if unknown:
        raise ConfigError(f'unknown parameter {with_suggestions(unknown, sorted(known))} for '
                          f'{node.get_name()}; '
                          f'there are: {", ".join(sorted(known))}')
    settings = []
    for config in configs:
        names = {entry.name for entry in fields(config)}
        setting = config.from_mapping({k: v for k, v in given.items() if k in names})
        settings.append(setting)
        for entry in fields(config):
            if node.has_parameter(entry.name):
                node.undeclare_parameter(entry.name)
            node.declare_parameter(entry.name, getattr(setting, entry.name), _descriptor(entry),
                                   ignore_override=True)
    return settings


def _check_rclpys(given: Mapping[str, Any]) -> None:
    """Refuse values of rclpy's own parameters that it would log and ignore."""
    for name, value in given.items():
        if name in _RCLPY_PARAMETERS:
            if type(value) is not bool:
                raise ConfigError(f'{name} = {value!r}: expected true or false')
            continue
        topic, kind, policy = (['', '', *name.removeprefix(_OVERRIDES).split('.')])[-3:]
        if not topic or kind not in _KINDS or policy not in _POLICIES:
            raise ConfigError(f'{name}: expected {_OVERRIDES}/TOPIC.KIND.POLICY, KIND one of '
                              f'{", ".join(_KINDS)}, POLICY one of {", ".join(_POLICIES)}')
        elif policy == 'depth' and (type(value) is not int or value < 1):
            raise ConfigError(f'{name} = {value!r}: expected a whole number above 0')
        elif policy != 'depth' and value not in _POLICIES[policy]:
            raise ConfigError(f'{name} = {value!r}: expected one of '
                              f'{", ".join(_POLICIES[policy])}')


def check_overridden_topics(node: Node, **topics: Sequence[str]) -> None:
    """
    Refuse overrides of QoS for topics that the node does not have.

    Parameters
    ----------
    node : Node
    topics : sequence of str
        Names by ``publisher`` and ``subscription``.

    """
    for name in node.get_parameters_by_prefix(_OVERRIDES.rstrip('.')):
        topic, kind, _ = name.rsplit('.', 2)
        if topic not in topics[kind]:
            raise ConfigError(f'{_OVERRIDES}{name}: no {kind} of {topic} here; there are: '
                              f'{", ".join(topics[kind])}')


def _descriptor(entry: Field[Any]) -> ParameterDescriptor:
    choices = entry.metadata['choices']
    descriptor = ParameterDescriptor(
        description=entry.metadata['help'], read_only=True,
        additional_constraints=limits(entry) if choices else '')
    low, high = entry.metadata['low'], entry.metadata['high']
    if low is None and high is None:
        return descriptor
    if isinstance(entry.default, float):
        descriptor.floating_point_range = [FloatingPointRange(
            from_value=float(-sys.float_info.max if low is None else low),
            to_value=float(sys.float_info.max if high is None else high))]
    else:
        descriptor.integer_range = [IntegerRange(
            from_value=int(-_MAX_INTEGER if low is None else low),
            to_value=int(_MAX_INTEGER if high is None else high), step=1)]
    return descriptor


def describe(configs: Sequence[type[Config]]) -> Iterator[str]:
    """Yield one line of help for each parameter."""
    for config in configs:
        for entry in fields(config):
            accepted = ', '.join(filter(None, (type(entry.default).__name__, limits(entry))))
            yield f'  {entry.name} := {entry.default!r} ({accepted}): {entry.metadata["help"]}'
