# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recipes of whole replays: attacks by name, and posters that hang while they run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from adversarial_lcd_ros.attack.images.posting import Posting, spans_in
from adversarial_lcd_ros.config import AttackConfig, ReplayConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.evaluation.methods import attack_columns, used_settings
from adversarial_lcd_ros.evaluation.recipes import LIVE, read_recipe
from adversarial_lcd_ros.evaluation.wording import attack_title
from adversarial_lcd_ros.registry import NONE

MAX_ATTACKS = 1000
REPLAY = 'replay'  # of an attack: settings of the poster that hangs while it runs
POSTERS = 'posters'  # where configuration.json says in which runs one hung
_MAX_NAME, _POSTER = 200, 'poster'


@dataclass(frozen=True)
class ReplayRecipe:
    """
    What is run.

    Attributes
    ----------
    attacks : dict of AttackConfig
        Settings of every attack by the name of its run, in the order of the recipe.
    posters : dict of dict
        Settings of ``bag_replay`` by which a poster hangs in a run, by its name.

    """

    attacks: dict[str, AttackConfig]
    posters: dict[str, dict[str, Any]]


def load_recipe(name: str, overrides: Mapping[str, Any]) -> ReplayRecipe:
    """
    Return the attacks of a recipe, and the posters that hang while they run.

    Where overrides make another attack of one, such as another search, it is called by its
    settings: its name in the recipe would tell of what did not run. Attacks that overrides make
    the same run once.

    Parameters
    ----------
    name : str
        A recipe that ships, or the path of a YAML file like those in config/recipes.
    overrides : mapping
        Settings that win over those of every attack in the recipe.

    Raises
    ------
    ConfigError
        There is no such recipe, or it is not of the expected form; or settings of a replay are
        no poster's, or no poster.

    """
    path, content = read_recipe(name)
    if content.pop('protocol') != LIVE:
        raise ConfigError(f'recipe {path} is for whole evaluations: "adversarial-lcd evaluate '
                          'SEQUENCE ... --recipe" runs it; here the protocol is "live"')
    if set(content) != {'attacks'}:
        raise ConfigError(f'recipe {path}: expected a list "attacks" and nothing else')
    names, attacks, posters = {'clean'}, dict[str, AttackConfig](), dict[str, dict[str, Any]]()
    for entry in content['attacks']:
        title = _run_name(path, entry)
        if title in names:
            raise ConfigError(f'recipe {path}: the name {title!r} is taken')
        names.add(title)
        settings = {name: value for name, value in entry.items() if name not in ('name', REPLAY)}
        attack = AttackConfig.from_mapping({**settings, **overrides})
        if REPLAY in entry:
            posters[title] = _poster(f'recipe {path}, {title}', entry[REPLAY])
        else:  # what a poster does hangs on no setting of the attacker
            if overrides and used_settings(attack) in map(used_settings, attacks.values()):
                continue
            title = _title(title, AttackConfig.from_mapping(settings), attack, attacks)
        attacks[title] = attack
    if len(attacks) > MAX_ATTACKS:
        raise ConfigError(f'recipe {path} has {len(attacks)} attacks, each a replay of the bag: '
                          f'expected at most {MAX_ATTACKS}')
    return ReplayRecipe(attacks, posters)


def _title(title: str, meant: AttackConfig, attack: AttackConfig,
           taken: Mapping[str, AttackConfig]) -> str:
    """Return what an attack is called that the recipe calls by a title and means so."""
    runs = {'mode': attack.mode, **attack_columns(attack)}
    if runs == {'mode': meant.mode, **attack_columns(meant)}:
        return title
    by_settings = attack_title(runs)
    return f'{by_settings} (in place of {title})' if by_settings in taken else by_settings


def _run_name(path: Path, entry: Any) -> str:
    """Return the name of an attack, which is also that of its run and row."""
    if not isinstance(entry, dict) or not isinstance(entry.get('name'), str):
        raise ConfigError(f'recipe {path}: {entry!r} is no attack with a name')
    title: str = entry['name']
    if not title.isprintable() or len(title) > _MAX_NAME:
        raise ConfigError(f'recipe {path}: the name {title[:_MAX_NAME]!r} is longer than '
                          f'{_MAX_NAME} characters, or not all of them can be printed')
    return title


def _poster(where: str, settings: Any) -> dict[str, Any]:
    if not isinstance(settings, dict) or not all(
            isinstance(name, str) and name.startswith(_POSTER) for name in settings):
        # Other settings would give the run other frames than the clean one has.
        raise ConfigError(f'{where}: {REPLAY} is {settings!r}: expected settings of a poster, '
                          'such as {poster: cells, poster_spans: "6:8, 18:20"}')
    hung = ReplayConfig.from_mapping(settings)
    if hung.poster == NONE or not spans_in(hung.poster_spans):
        raise ConfigError(f'{where}: {REPLAY} hangs no poster: expected poster, and poster_spans, '
                          'when it is seen')
    Posting(hung, 0)  # two sheets may overlap
    return settings
