# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recipes of an evaluation of the targets: sequences, and the settings that each needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

from adversarial_lcd_ros.config import BuilderConfig, Config, LabelConfig, LcdConfig
from adversarial_lcd_ros.errors import ConfigError, with_suggestions
from adversarial_lcd_ros.evaluation.recipes import load_yaml
from adversarial_lcd_ros.registry import TARGETS

ConfigT = TypeVar('ConfigT', bound=Config)
_KEYS = ('source', 'scored', 'nodes', 'targets', 'builder', 'lcd', 'labels', 'detectors')


@dataclass(frozen=True)
class TargetSequence:
    """
    A sequence to evaluate targets on.

    Attributes
    ----------
    source : str
        As for ``open_graphs``.
    builder, lcd, labels
        Settings.
    nodes : tuple of int
        Features of a graph.
    targets : tuple of str
    scored : (float, float)
        From and to which fraction of the frames queries are scored; earlier ones are map only.
    detectors : tuple of LcdConfig
        Every target is evaluated with each of them; ``lcd`` with further settings, such as
        defences.

    """

    source: str
    builder: BuilderConfig
    lcd: LcdConfig
    labels: LabelConfig
    nodes: tuple[int, ...]
    targets: tuple[str, ...]
    scored: tuple[float, float] = (0.0, 1.0)
    detectors: tuple[LcdConfig, ...] = ()


@dataclass(frozen=True)
class Choices:
    """What the command line says; settings win over those of a recipe."""

    builder: Mapping[str, Any]
    lcd: Mapping[str, Any]
    labels: Mapping[str, Any]
    nodes: tuple[int, ...] = ()
    targets: tuple[str, ...] = ()
    defences: tuple[str, ...] = ()


def named_sequences(sources: Sequence[str], choices: Choices) -> list[TargetSequence]:
    """Return sequences that the command line names, with its settings."""
    return [_sequence(source, {}, choices) for source in sources]


def recipe_sequences(name: str, data: Path, choices: Choices) -> list[TargetSequence]:
    """
    Return the sequences of a recipe.

    Parameters
    ----------
    name : str
        A recipe that ships, or the path of a YAML file like config/recipes/target.yaml.
    data : Path
        Folder that the sources are in.
    choices : Choices

    Raises
    ------
    ConfigError
        There is no such recipe or folder, or it is not of the expected form.

    """
    path, content = load_yaml(name)
    entries = content.get('sequences')
    if not isinstance(entries, list) or not entries or set(content) != {'sequences'}:
        raise ConfigError(f'recipe {path}: expected a list "sequences" and nothing else')
    if not data.is_dir():
        raise ConfigError(f'there is no folder {data} with the sequences of recipe {name}: say '
                          'where they are with --data, or name sequences of your own')
    for entry in entries:
        if not isinstance(entry, dict) or not isinstance(entry.get('source'), str):
            raise ConfigError(f'recipe {path}: {entry!r} is no sequence with a source')
        unknown = sorted(set(entry) - set(_KEYS))
        if unknown:
            raise ConfigError(f'recipe {path}: unknown key '
                              f'{with_suggestions(unknown, _KEYS)}; there are: '
                              f'{", ".join(_KEYS)}')
    return [_sequence(str(data / entry['source']), entry, choices) for entry in entries]


def _sequence(source: str, entry: Mapping[str, Any], choices: Choices) -> TargetSequence:
    builder = _merged(BuilderConfig, entry.get('builder'), choices.builder)
    nodes = choices.nodes or tuple(entry.get('nodes') or (builder.features,))
    targets = choices.targets or tuple(entry.get('targets') or TARGETS)
    for target in targets:
        try:
            TARGETS.check(target)
        except ConfigError as error:
            raise ConfigError(f'{source}: {error}') from error
    lcd = _merged(LcdConfig, entry.get('lcd'), choices.lcd)
    return TargetSequence(source, builder, lcd,
                          _merged(LabelConfig, entry.get('labels'), choices.labels), nodes,
                          targets, _part(source, entry.get('scored', (0, 1))),
                          _detectors(source, lcd, entry.get('detectors'), choices))


def _detectors(source: str, lcd: LcdConfig, own: Any, choices: Choices) -> tuple[LcdConfig, ...]:
    """Return the settings of the detector, one for each row of a target and protocol."""
    entries = [{'defences': names} for names in choices.defences] or own or [{}]
    if not isinstance(entries, list) or not all(
            isinstance(entry, dict) and 'target' not in entry for entry in entries):
        raise ConfigError(f'{source}: detectors {own!r}: expected a list of settings of the '
                          'detector, such as [{}, {defences: length_check}]')
    return tuple(dict.fromkeys(LcdConfig.from_mapping({**asdict(lcd), **entry, **choices.lcd})
                               for entry in entries))


def _part(source: str, value: Any) -> tuple[float, float]:
    if not (isinstance(value, (list, tuple)) and len(value) == 2
            and all(isinstance(end, (int, float)) for end in value)
            and 0 <= value[0] < value[1] <= 1):
        raise ConfigError(f'{source}: scored {value!r}: expected a part, such as [0.5, 1]')
    return float(value[0]), float(value[1])


def _merged(config: type[ConfigT], own: Any, chosen: Mapping[str, Any]) -> ConfigT:
    if own is not None and not isinstance(own, dict):
        raise ConfigError(f'{config.__name__}: expected settings by name, found {own!r}')
    return config.from_mapping({**(own or {}), **chosen})
