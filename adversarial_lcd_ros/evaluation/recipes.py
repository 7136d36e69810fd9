# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Recipes: what an evaluation does, in small YAML files; each kind reads on in its own room.

An option on the command line wins over each attack of a recipe.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from adversarial_lcd_ros.errors import ConfigError, FileError, with_suggestions
from adversarial_lcd_ros.files.reading import read_yaml
from adversarial_lcd_ros.paths import share_path

FOLDER = 'config/recipes'
# Every frame through the nodes, or a sample of frames without ROS (``frames``).
LIVE, FRAMES = 'live', 'frames'
# A sample of frames, attacks beside defences, and posters.
RINGS = 'rings'
SAMPLED = (FRAMES, RINGS)


def read_recipe(name: str) -> tuple[Path, dict[str, Any]]:
    """
    Return the path of a recipe and what is in it, with its protocol and a list of attacks.

    Parameters
    ----------
    name : str
        A recipe that ships, or the path of a YAML file like those in config/recipes.

    Raises
    ------
    ConfigError
        There is no such recipe, or it has no attacks, or a protocol that is not known.

    """
    path, content = load_yaml(name)
    entries = content.get('attacks')
    if not isinstance(entries, list) or not entries:
        raise ConfigError(f'recipe {path}: expected a list "attacks"')
    protocol = content.setdefault('protocol', LIVE)
    if protocol not in (LIVE, *SAMPLED):
        raise ConfigError(f'recipe {path}: the protocol is {protocol!r}: expected "{LIVE}" '
                          f'(every frame, through the nodes), "{FRAMES}" (a sample of frames) or '
                          f'"{RINGS}" (attacks beside defences, and posters)')
    return path, content


def load_yaml(name: str) -> tuple[Path, dict[str, Any]]:
    """
    Return the path of a recipe and what is in it.

    Raises
    ------
    ConfigError
        There is no such recipe, or it is not made of names and values.

    """
    path = find_recipe(name)
    try:
        content = read_yaml(path)
    except FileError as error:
        raise ConfigError(f'recipe {error}') from error
    if not isinstance(content, dict):
        raise ConfigError(f'recipe {path} holds a {type(content).__name__}: expected lists by '
                          'name, such as "attacks" or "sequences"')
    return path, content


def find_recipe(name: str) -> Path:
    """Return the path of a recipe that ships, or of a YAML file; raises ConfigError."""
    if name.endswith(('.yaml', '.yml')):
        return Path(name)
    folder = share_path(FOLDER)
    path = folder / f'{name}.yaml'
    if not path.is_file():
        there = sorted(entry.stem for entry in folder.glob('*.yaml'))
        raise ConfigError(f'no recipe {with_suggestions([repr(name)], map(repr, there))}; there '
                          f'are: {", ".join(there)}, or give a .yaml file')
    return path
