# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a setting is: a field that knows its range and its text, and a class that checks it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields
import math
from typing import Any, ClassVar, TypeVar

from adversarial_lcd_ros.errors import ConfigError, with_suggestions
from adversarial_lcd_ros.registry import Table

ConfigT = TypeVar('ConfigT', bound='Config')


def setting(default: Any, help: str, *, low: float | None = None, high: float | None = None,
            choices: tuple[str, ...] | Table | None = None, several: bool = False,
            empty: bool = False) -> Any:
    """
    Return a dataclass field with what is needed to check and to explain it.

    Choices are values, or a table of classes; ``several`` takes names of it between commas,
    ``empty`` none as well.
    """
    return field(default=default, metadata={
        'help': help, 'low': low, 'high': high, 'choices': choices, 'several': several,
        'empty': empty})


@dataclass(frozen=True)
class Config:
    """Base of all settings: checked on construction."""

    title: ClassVar[str] = ''

    def __post_init__(self) -> None:
        """Check the type and range of every field."""
        for entry in fields(self):
            _check(type(self).__name__, entry, getattr(self, entry.name))

    @classmethod
    def from_mapping(cls: type[ConfigT], values: Mapping[str, Any]) -> ConfigT:
        """
        Return the settings with the given values in place of defaults.

        Raises
        ------
        ConfigError
            A name is unknown, or a value of the wrong type or out of range.

        """
        known = {entry.name: entry for entry in fields(cls)}
        unknown = sorted(str(name) for name in values if name not in known)
        if unknown:
            raise ConfigError(f'unknown setting {with_suggestions(unknown, known)} for '
                              f'{cls.__name__}; there are: {", ".join(known)}')
        return cls(**{name: _widen(known[name], value) for name, value in values.items()})

    def changed(self, *but: str) -> str:
        """Return the settings that are not the default in words, some left out; '' if none."""
        return ', '.join(f'{entry.name} {getattr(self, entry.name)}' for entry in fields(self)
                         if entry.name not in but and getattr(self, entry.name) != entry.default)


def _widen(entry: Field[Any], value: Any) -> Any:
    # A whole number is a fine value for a real setting (YAML "1", command line "1").
    if isinstance(entry.default, float) and type(value) is int:
        return float(value)
    return value


def _check(owner: str, entry: Field[Any], value: Any) -> None:
    expected = type(entry.default)
    if type(value) is not expected:
        raise ConfigError(f'{owner}.{entry.name} = {value!r}: expected {expected.__name__}, '
                          f'found {type(value).__name__}')
    low, high, choices = (entry.metadata[key] for key in ('low', 'high', 'choices'))
    if isinstance(choices, Table):
        _check_names(f'{owner}.{entry.name}', entry, choices, value)
    elif choices is not None and value not in choices:
        raise ConfigError(f'{owner}.{entry.name} = {value!r}: expected one of '
                          f'{", ".join(choices)}')
    if isinstance(value, float) and not math.isfinite(value):
        raise ConfigError(f'{owner}.{entry.name} = {value}: expected a finite number')
    if (low is not None and value < low) or (high is not None and value > high):
        raise ConfigError(f'{owner}.{entry.name} = {value}: expected {low} to '
                          f'{"any" if high is None else high}')


def _check_names(what: str, entry: Field[Any], table: Table, value: Any) -> None:
    if not value and entry.metadata['empty']:
        return
    for name in names_in(value) if entry.metadata['several'] else [value]:
        try:
            table.check(name)
        except ConfigError as error:
            raise ConfigError(f'{what} = {value!r}: {error}') from error


def names_in(text: str) -> list[str]:
    """Return the names in a setting that takes several, between commas."""
    return [name.strip() for name in text.split(',')]
