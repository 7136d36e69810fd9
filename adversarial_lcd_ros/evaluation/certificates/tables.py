# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Certificates in words and cells, for the terminal and the page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.certificates.run import CLASSES
from adversarial_lcd_ros.evaluation.markdown import table_of
from adversarial_lcd_ros.registry import NONE

Row = Mapping[str, Any]
Lines = list[dict[str, str]]


def name_of(row: Row) -> str:
    """Return the detector of a row in a few words."""
    return ', '.join(filter(None, (
        row['target'], row['defences'] if row['defences'] != NONE else '', row['changed'])))


def shown_flips(rows: Iterable[Row]) -> list[int]:
    """Return for how many flips tables have a column, 0 left out."""
    budget = max(row['budget'] for row in rows)
    return sorted({1, *(flips for flips in (3, 9) if flips < budget), budget})


def certified_lines(rows: Sequence[Row]) -> Lines:
    """Return how many frames of each class are right, and certified by flips."""
    return [{'sequence': row['sequence'], 'labels': row['told_by'],
             'detector': f'`{name_of(row)}`', 'class': name, 'frames': str(found['frames']),
             'right': str(found['right']),
             **{_flips(flips): _count(found, flips) for flips in shown_flips(rows)}}
            for row in rows for name in CLASSES for found in [row['classes'][name]]]


def accuracy_lines(rows: Sequence[Row]) -> Lines:
    """Return the certified balanced accuracy by flips, and what a certificate costs."""
    flips = shown_flips(rows)
    return [{'sequence': row['sequence'], 'detector': f'`{name_of(row)}`',
             **{_flips(number): _share(row, number) for number in (0, *flips)},
             '95 % interval of the last': wording.interval(row['ci95'], 100.0)
             or wording.UNDEFINED, 'ms a frame': wording.number(row['certify_ms'], 0)}
            for row in rows]


def terminal_lines(rows: Sequence[Row]) -> Lines:
    """
    Return the certified balanced accuracy by flips, for a terminal of 80 columns.

    Settings that all detectors share are left out.
    """
    own = wording.own_settings([row['changed'] for row in rows])
    return [{'detector': name_of({**row, 'changed': text}), 'sequence': row['sequence'],
             **{_flips(number): _share(row, number) for number in (0, *shown_flips(rows))}}
            for row, text in zip(rows, own, strict=True)]


def markdown(lines: Lines) -> str:
    """Return rows of heading to cell as a Markdown table."""
    return '\n'.join((*table_of(lines), ''))


def _flips(number: int) -> str:
    return 'no flip' if not number else f'{number} flip{"s" if number > 1 else ""}'


def _count(found: Row, flips: int) -> str:
    if not found['frames'] or flips >= len(found['certified']):
        return wording.UNDEFINED
    count = found['certified'][flips]
    return f'{count} ({wording.percent(count / found["frames"], 0)})'


def _share(row: Row, flips: int) -> str:
    return wording.percent(row['accuracy'][flips]) if flips < len(row['accuracy']) \
        else wording.UNDEFINED
