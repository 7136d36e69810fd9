# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recipes of whole replays: attacks by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.evaluation.recipes import LIVE, read_recipe

MAX_ATTACKS = 1000
_MAX_NAME = 200


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
        title = entry['name']
        if not title.isprintable() or len(title) > _MAX_NAME:
            raise ConfigError(f'recipe {path}: the name {title[:_MAX_NAME]!r} is longer than '
                              f'{_MAX_NAME} characters, or not all of them can be printed')
        if title in attacks or title == 'clean':
            raise ConfigError(f'recipe {path}: the name {title!r} is taken')
        settings = {name: value for name, value in entry.items() if name != 'name'}
        attacks[title] = AttackConfig.from_mapping({**settings, **overrides})
    if len(attacks) > MAX_ATTACKS:
        raise ConfigError(f'recipe {path} has {len(attacks)} attacks, each a replay of the bag: '
                          f'expected at most {MAX_ATTACKS}')
    return attacks
