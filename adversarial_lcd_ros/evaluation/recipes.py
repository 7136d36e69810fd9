"""Recipes: the attacks of an evaluation, in small YAML files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.paths import share_path

FOLDER = 'config/recipes'
# Every frame through the nodes, or a sample of frames without ROS (``frames``).
LIVE, FRAMES = 'live', 'frames'


def load_recipe(name: str, overrides: Mapping[str, Any]) -> dict[str, AttackConfig]:
    """
    Return the attacks of a recipe by name, in its order.

    Parameters
    ----------
    name : str
        A recipe that ships, or the path of a YAML file like those in config/recipes.
    overrides : mapping
        Settings that win over those of every attack in the recipe.

    Raises
    ------
    ConfigError
        There is no such recipe, or it is not of the expected form.

    """
    path, content = read_recipe(name)
    if content.pop('protocol') != LIVE:
        raise ConfigError(f'recipe {path} is for whole evaluations: "adversarial-lcd evaluate '
                          'SEQUENCE ... --recipe" runs it; here the protocol is "live"')
    if set(content) != {'attacks'}:
        raise ConfigError(f'recipe {path}: expected a list "attacks" and nothing else')
    attacks: dict[str, AttackConfig] = {}
    for entry in content['attacks']:
        if not isinstance(entry, dict) or not isinstance(entry.get('name'), str):
            raise ConfigError(f'recipe {path}: {entry!r} is no attack with a name')
        title = entry.pop('name')
        if title in attacks or title == 'clean':
            raise ConfigError(f'recipe {path}: the name {title!r} is taken')
        attacks[title] = AttackConfig.from_mapping({**entry, **overrides})
    return attacks


def read_recipe(name: str) -> tuple[Path, dict[str, Any]]:
    """
    Return the path of a recipe and what is in it, with its protocol and a list of attacks.

    Parameters
    ----------
    name : str
        As in ``load_recipe``.

    Raises
    ------
    ConfigError
        There is no such recipe, or it has no attacks, or a protocol that is not known.

    """
    path = find_recipe(name)
    try:
        content = yaml.safe_load(path.read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ConfigError(f'recipe {path} cannot be read: {error}') from error
    entries = content.get('attacks') if isinstance(content, dict) else None
    if not isinstance(entries, list) or not entries:
        raise ConfigError(f'recipe {path}: expected a list "attacks"')
    protocol = content.setdefault('protocol', LIVE)
    if protocol not in (LIVE, FRAMES):
        raise ConfigError(f'recipe {path}: the protocol is {protocol!r}: expected "{LIVE}" '
                          f'(every frame, through the nodes) or "{FRAMES}" (a sample of frames)')
    return path, content


def find_recipe(name: str) -> Path:
    """Return the path of a recipe that ships, or of a YAML file; raises ConfigError."""
    if name.endswith(('.yaml', '.yml')):
        return Path(name)
    folder = share_path(FOLDER)
    path = folder / f'{name}.yaml'
    if not path.is_file():
        there = ', '.join(sorted(entry.stem for entry in folder.glob('*.yaml')))
        raise ConfigError(f'no recipe {name!r}; there are: {there}, or give a .yaml file')
    return path
