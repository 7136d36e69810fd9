# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which frames of a replay are worth a picture, and what is said below it."""

from __future__ import annotations

from collections.abc import Sequence

from adversarial_lcd_ros.evaluation.outcomes import UNTOLD_MATCH
from adversarial_lcd_ros.evaluation.replay.records import NO_TRUTH, QueryRecord

_EFFECTS = {
    'suppressed': 'The loop was found before the attack and is not found any more.',
    'diverted': 'The loop is now declared with a frame that shows too little of the same view.',
    'invented': 'Under attack a loop is declared where there is none.',
    'regained': "Only under attack the loop is found, against the attacker's purpose.",
    'withdrawn': 'The attack made a false alarm disappear.',
    'silenced': 'A loop was declared before the attack and is not any more.',
    'raised': 'Under attack a loop is declared where none was before.',
    'redirected': 'The loop is now declared with another frame.'}
_OUTCOMES = {
    'TP': ('held', 'The loop is found, attack or not.'),
    'TN': ('held', 'Rightly silent, attack or not.'),
    'FN': ('missed', 'The loop is missed, attack or not.'),
    'WM': ('wrong match', 'The loop is declared with a wrong frame, attack or not.'),
    'FP': ('false alarm', 'A loop is declared where there is none, attack or not.'),
    UNTOLD_MATCH: ('cannot be told', 'Nobody can say whether the match declared is right.'),
    '': ('not scored', 'Ground truth cannot tell whether there is a loop.')}
_UNCHANGED = 'unchanged', 'The decision is the same, attack or not.'
# The most telling first.
_ORDER = ('suppressed', 'invented', 'diverted', 'silenced', 'raised', 'redirected',
          'TP', 'TN', 'regained', 'withdrawn', 'FN', 'WM', 'FP', UNTOLD_MATCH, '')


def choose_records(run: Sequence[QueryRecord], count: int = 6) -> list[QueryRecord]:
    """
    Return the attacked frames most worth a picture, in time order.

    Kinds of effect take turns, the most telling first; within a kind the frames with the most
    flipped edges first, not within a twentieth of the sequence of one already chosen, as long
    as there are such. Only frames with a match are chosen, and fewer if there are fewer.

    Parameters
    ----------
    run : sequence of QueryRecord
        The records of one attack.
    count : int
        Number of pictures.

    """
    apart = len(run) // 20
    waiting = {kind: sorted((record for record in run
                             if (record.effect or record.outcome) == kind
                             and record.match_frame is not None),
                            key=lambda record: (-(record.edits or 0), record.frame))
               for kind in _ORDER}
    chosen: list[QueryRecord] = []
    while len(chosen) < count and any(waiting.values()):
        for records in waiting.values():
            if records and len(chosen) < count:
                taken = [other.frame for other in chosen]
                far = [record for record in records
                       if all(abs(record.frame - frame) > apart for frame in taken)]
                record = (far or records)[0]
                records.remove(record)
                chosen.append(record)
    return sorted(chosen, key=lambda record: record.frame)


def _spent(record: QueryRecord) -> str:
    if record.node_budget:
        return f'{record.nodes_moved or 0} nodes changed of {record.node_budget}'
    return f'{record.edits or 0} edges flipped of {record.edit_budget or 0}'


def describe(record: QueryRecord, clean: QueryRecord) -> tuple[str, str]:
    """Return title and caption of the picture of an attacked frame."""
    what, text = ((record.effect, _EFFECTS[record.effect]) if record.effect
                  else _UNCHANGED if record.kind == NO_TRUTH else _OUTCOMES[record.outcome])
    title = f'Frame {record.frame}: {what}'
    caption = (f'{text} Probability {clean.probability:.2f} clean, {record.probability:.2f} '
               f'attacked; {_spent(record)} allowed, {record.queries or 0} queries.')
    return title, caption
