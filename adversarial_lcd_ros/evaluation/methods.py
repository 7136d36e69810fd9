# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What attacks are in rows and reports: a search, with what it uses, and facts on its class."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

from adversarial_lcd_ros.attack.search import COMMON_SETTINGS
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.registry import NONE, PERTURBATIONS, SEARCHES, SURROGATES, YARDSTICKS
from adversarial_lcd_ros.shown import OTHERS_RANK, OURS_RANK, Shown

# Columns of a row that say what ran; '' where a search has no such thing.
COLUMNS = ('search', 'perturbation', 'surrogate')


def used_settings(config: AttackConfig) -> AttackConfig:
    """Return the settings of an attack, with those that its search does not use at defaults."""
    used = (*COMMON_SETTINGS, *SEARCHES.find(config.search).own_settings)
    unused: dict[str, Any] = {entry.name: entry.default for entry in fields(config)
                              if entry.name not in used}
    return replace(config, **unused)


def attack_columns(config: AttackConfig) -> dict[str, str]:
    """Return what runs in an attack, by the names of ``COLUMNS``."""
    used = ('search', *SEARCHES.find(config.search).own_settings)
    return {name: getattr(config, name) if name in used and config.mode != 'pass' else ''
            for name in COLUMNS}


def is_yardstick(row: Mapping[str, Any]) -> bool:
    """Tell whether a row is of an attack that looks into the detector: no black-box attack."""
    return row['search'] in YARDSTICKS


def method_of(row: Mapping[str, Any]) -> str:
    """Return the name of what chooses the flips: a perturbation, or else a search."""
    return str(row['perturbation'] or row['search'])


def method_facts(method: str) -> type[Shown]:
    """Return the class of a perturbation, a search or a yardstick, for its facts."""
    return _facts(method, PERTURBATIONS, SEARCHES, YARDSTICKS)


def surrogate_facts(surrogate: str) -> type[Shown]:
    """Return the class of a surrogate, for its facts."""
    return _facts(surrogate, SURROGATES)


def whose(row: Mapping[str, Any]) -> str:
    """
    Return whose an attack is: paper, ours, other, control, or bound; '' where nobody knows.

    'bound' looks into the detector and is no attack that anybody could carry out. 'other' is from
    elsewhere in the literature, such as a poster alone, or of the user's own.
    """
    if row['mode'] == 'pass':
        return 'other' if row.get('poster') else 'control'
    if not row['search']:
        return ''
    if is_yardstick(row):
        return 'bound'
    method, surrogate = method_of(row), row['surrogate']
    if method == 'random_flip' and surrogate in ('', NONE):
        return 'control'
    ranks = [method_facts(method).rank] + (
        [] if surrogate in ('', NONE) else [surrogate_facts(surrogate).rank])
    if max(ranks) >= OURS_RANK:
        return 'ours'
    return 'paper' if max(ranks) < OTHERS_RANK else 'other'


def _facts(name: str, *tables: Any) -> type[Shown]:
    for table in tables:
        found = table.look_up(name)
        if found is not None:
            shown: type[Shown] = found
            return shown
    # Of a class that is not here any more: a report is made of what its rows say.
    return Shown
