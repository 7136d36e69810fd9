# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What attacks are called beside each other: settings are named where they are not the usual."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.methods import is_yardstick, method_facts
from adversarial_lcd_ros.evaluation.paper.summaries import Summary

_WORDS = {'nodes': '{} features', 'oracle': '{} answers',
          'queries_per_edit': '{} queries an edit', 'edits': 'edits: {}',
          'threshold': 'threshold {}', 'judged': 'judged by {}', 'variant': '{}'}


def usual_settings(cells: Sequence[Summary]) -> dict[str, Any]:
    """Return the commonest value of each setting; of equally common ones the largest."""
    counts = {name: Counter(cell[name] for cell in cells) for name in _WORDS}
    return {name: max(count, key=lambda value: (count[value], value))
            for name, count in counts.items()}


def usual_by_target(cells: Sequence[Summary]) -> dict[str, dict[str, Any]]:
    """Return the usual settings of each target: one may be attacked by pairs, another not."""
    return {target: usual_settings([cell for cell in cells if cell['target'] == target])
            for target in dict.fromkeys(cell['target'] for cell in cells)}


def usual_title(usual: Summary) -> str:
    """Return the usual settings in words."""
    return ', '.join(words.format(usual[name]) for name, words in _WORDS.items()
                     if usual[name] != '')


def full_title(summary: Summary, usual: Summary) -> str:
    """Return what an attack is called; settings that are not the usual ones are named."""
    return ', '.join([_title(summary), *(
        words.format(summary[name]) for name, words in _WORDS.items()
        if summary[name] not in (usual[name], ''))])


def _title(summary: Summary) -> str:
    if is_yardstick(summary):
        return method_facts(summary['search']).title
    title = wording.attack_title({**summary, 'name': None})
    asked = summary['asked_target']
    return title if asked == summary['target'] else f'{title}, asked {asked}'
