# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What messages must satisfy beside their types: ranges, sums, sizes, and what must agree.

All that a schema says in words is checked here, so that nothing behind the codec meets a
number it was not made for. Every refusal names its cause.

Graphs that our own code made are not checked again.
"""

from __future__ import annotations

import math
from typing import Any

from adversarial_lcd_ros.compiled import ranges
from adversarial_lcd_ros.config import MessageLimits
from adversarial_lcd_ros.errors import CodecError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages.types import AttackReport, LoopClosure

STATUSES = ('success', 'failure', 'skipped')
MAX_NAME = 256
_PROBABILITY_TOLERANCE = 1e-6
_NS = 1_000_000_000
# Cause, field and what was expected.
_FAULTS = {
    ranges.POSITION: ('position', 'position', 'x and y inside the image'),
    ranges.SIZE: ('node size', 'size', 'above 0 pixels'),
    ranges.LABEL: ('label', 'label', f'at most {ranges.MAX_WORD}'),
    ranges.SCORE: ('score', 'score', '0 to 1 of an object, at least -0.16 of a feature'),
    ranges.WORD: ('word', 'word', f'at most {ranges.MAX_WORD}'),
    ranges.WEIGHTS: ('word weights', 'word_weight', 'a sum of 1'),
    ranges.LENGTH: ('edge length', 'edge_length', 'the distance between the ends over the image '
                    'diagonal, 0 to 1')}


def checked_stamp_ns(seconds: int, nanoseconds: int) -> int:
    """Return the two parts of a stamp as nanoseconds; raises CodecError."""
    if not (0 <= seconds < 2 ** 31 and 0 <= nanoseconds < _NS):
        raise CodecError(f'stamp of {seconds} s and {nanoseconds} ns: expected 0 s to 2^31 - 1 s '
                         f'and below {_NS} ns', cause='stamp')
    return int(seconds) * _NS + int(nanoseconds)


def checked_name(name: str, what: str) -> str:
    """Return a name without control characters, of at most 256; raises CodecError."""
    # With what steers a terminal, a name would write where it is only shown.
    if len(name) > MAX_NAME or any(ord(sign) < 0x20 or 0x7F <= ord(sign) < 0xA0 for sign in name):
        raise CodecError(f'{what} {name[:40]!r}: expected at most {MAX_NAME} characters and no '
                         'control characters', cause='name')
    return name


def check_sizes(message: Any, limits: MessageLimits) -> None:
    """Hold the numbers of a graph message against limits, before anything is made of it."""
    for name, count, most in (
            ('nodes', len(message.node_tier), limits.max_nodes),
            ('edges', len(message.edge_source), limits.max_edges),
            ('words', len(message.word), limits.max_words),
            ('pixels', int(message.width) * int(message.height), limits.max_pixels)):
        if count > most:
            raise CodecError(f'graph of {count} {name}: at most {most} are accepted '
                             f'(parameter max_{name})', cause=f'too many {name}')


def check_graph(graph: MultiTierGraph) -> None:
    """Hold a graph against what MultiTierGraph.msg says; raises CodecError."""
    for fault, place in (
            ranges.node_fault(graph.position, graph.size, graph.label, graph.score,
                              graph.object_count, graph.width, graph.height),
            ranges.word_fault(graph.word, graph.word_weight),
            ranges.length_fault(graph.position, graph.edge, graph.edge_length, graph.diagonal)):
        if fault:
            cause, name, expected = _FAULTS[fault]
            found = getattr(graph, name)
            shown = found.sum(dtype=float) if fault == ranges.WEIGHTS else found[place]
            raise CodecError(f'{cause} {shown}: expected {expected}', cause=cause)


def check_decision(decision: LoopClosure) -> None:
    """Hold a decision against what LoopClosure.msg says; raises CodecError."""
    check_probability(decision.probability, decision.log_odds)
    if not 0.0 <= decision.vbow_score <= 1.0 + ranges.WEIGHT_TOLERANCE:
        raise CodecError(f'vbow_score {decision.vbow_score}: expected 0 to 1', cause='score')
    if decision.is_loop and decision.match_stamp_ns is None:
        raise CodecError('a loop without a match: expected the keyframe that it closes with',
                         cause='match')


def check_probability(probability: float, log_odds: float) -> None:
    """Hold a probability against its range, and its log odds against it; raises CodecError."""
    if not 0.0 <= probability <= 1.0:
        raise CodecError(f'probability {probability}: expected 0 to 1', cause='probability')
    if math.isnan(log_odds) or abs(_sigmoid(log_odds) - probability) > _PROBABILITY_TOLERANCE:
        raise CodecError(f'log odds {log_odds} of the probability {probability}: they do not '
                         'agree', cause='probability')


def _sigmoid(log_odds: float) -> float:
    share = math.exp(-abs(log_odds))
    return (1.0 if log_odds >= 0 else share) / (1.0 + share)


def check_report(report: AttackReport) -> None:
    """Hold an attack report against what AttackReport.msg says; raises CodecError."""
    if report.status not in STATUSES:
        raise CodecError(f'status {report.status[:40]!r}: expected one of {", ".join(STATUSES)}',
                         cause='status')
    for what, spent, granted in (('edits', report.edits, report.edit_budget),
                                 ('nodes', report.nodes_moved, report.node_budget),
                                 ('queries', report.queries, report.query_budget)):
        if spent > granted:
            raise CodecError(f'{spent} {what} of {granted} that were granted', cause='budget')
    values = report.loss_before, report.loss_after, report.duration_s
    if not all(map(math.isfinite, values)) or report.duration_s < 0:
        raise CodecError('losses or duration of a report are not finite', cause='not finite')
