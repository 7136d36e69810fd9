"""What attacks are in rows and reports: a search, with what it uses, and facts on its class."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

from adversarial_lcd_ros.attack.search import COMMON_SETTINGS
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.registry import PERTURBATIONS, SEARCHES, SURROGATES, YARDSTICKS
from adversarial_lcd_ros.shown import OTHERS_RANK, OURS_RANK, YARDSTICK_RANK, Shown

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


def whose(row: Mapping[str, Any]) -> str:
    """
    Return where what chooses the flips comes from, by its rank (``Shown``).

    'paper', 'ours', 'control' for what looks into the detector, 'other' for all else; '' where
    nobody knows what ran, or nothing was changed.
    """
    if not method_of(row) or method_of(row) == 'None':
        return ''
    rank = method_facts(method_of(row)).rank
    return ('paper' if rank < OTHERS_RANK else 'other' if rank < OURS_RANK else
            'ours' if rank < YARDSTICK_RANK else 'control')


def method_facts(method: str) -> type[Shown]:
    """Return the class of a perturbation, a search or a yardstick, for its facts."""
    return _facts(method, PERTURBATIONS, SEARCHES, YARDSTICKS)


def surrogate_facts(surrogate: str) -> type[Shown]:
    """Return the class of a surrogate, for its facts."""
    return _facts(surrogate, SURROGATES)


def _facts(name: str, *tables: Any) -> type[Shown]:
    for table in tables:
        found = table.look_up(name)
        if found is not None:
            shown: type[Shown] = found
            return shown
    # Of a class that is not here any more: a report is made of what its rows say.
    return Shown
