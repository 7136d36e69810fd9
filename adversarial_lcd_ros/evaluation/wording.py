# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Figures and attacks in words, for all reports and the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from adversarial_lcd_ros.evaluation.methods import method_of, surrogate_facts
from adversarial_lcd_ros.registry import NONE

UNDEFINED = 'n/a'
NARROW_SPACE = '\u202f'  # does not break the line
_MODE = {'query': 'query-guided', 'surrogate': 'surrogate only', 'pass': 'forwarded unchanged'}

Attack = Mapping[str, Any]


def attack_title(attack: Attack) -> str:
    """Return what an attack is, in words: its name, or else its settings."""
    if attack.get('name'):
        return str(attack['name'])
    if attack['mode'] == 'pass':
        return 'control: forwarded unchanged'
    unasked = attack['mode'] == 'surrogate' and not attack['surrogate']
    return f'{method_title(attack)}, {"no queries" if unasked else mode_title(attack["mode"])}'


def method_title(attack: Attack) -> str:
    """Return what looks for the flips of an attack, in words: a surrogate only if one ran."""
    title = method_of(attack).replace('_', ' ')
    if attack['surrogate'] in ('', NONE):
        return title
    return f'{title} + {surrogate_title(attack["surrogate"])}'


def surrogate_title(surrogate: str) -> str:
    """Return a surrogate in words."""
    return surrogate_facts(surrogate).title or surrogate.replace('_', ' ')


def mode_title(mode: str) -> str:
    """Return how an attack uses its queries, in words."""
    return _MODE.get(mode, mode)


def percent(value: float | None, digits: int = 1) -> str:
    """Return a share in percent."""
    return UNDEFINED if value is None else f'{100 * value:.{digits}f}{NARROW_SPACE}%'


def number(value: float | None, digits: int = 1) -> str:
    """Return a number with fixed decimals and thousands set apart; nothing has no sign."""
    return UNDEFINED if value is None else f'{round(value, digits) + 0.0:,.{digits}f}'


def mean_count(value: float | None) -> str:
    """Return a mean of counts; decimals only where they say something."""
    return number(value, 1 if value is None or value < 100 else 0)


def ratio(value: float | None) -> str:
    """Return a ratio of flips; no digits that it does not have."""
    return UNDEFINED if value is None else f'{value:g}'


def points(value: float | None) -> str:
    """Return percentage points; what rounds to nothing has no sign."""
    return UNDEFINED if value is None else f'{round(value, 1) + 0.0:.1f}'


def interval(bounds: Sequence[float] | None, factor: float = 1.0) -> str:
    """Return the bounds of an interval."""
    if bounds is None:
        return ''
    return ' to '.join(f'{round(factor * bound, 1) + 0.0:.1f}' for bound in bounds)


def detector_title(detector: Mapping[str, Any] | None) -> str:
    """Return what has to be known of the detector beside its figures, in words."""
    if not detector:
        return ''
    defences = [name.replace('_', ' ') for name in detector['defences']]
    return (f'detector {detector["target"]}, threshold {detector["threshold"]:g}, '
            f'{"behind " + ", ".join(defences) if defences else "no defence"}')


def sentence(text: str) -> str:
    """Return a text with a capital first letter."""
    return text[:1].upper() + text[1:]


def own_settings(changed: Sequence[str]) -> list[str]:
    """Return settings, each a text "name value, ...", without those that all of them share."""
    parts = [text.split(', ') for text in changed]
    common = set.intersection(*map(set, parts))
    return [', '.join(part for part in own if part not in common) for own in parts]
