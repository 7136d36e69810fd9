# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Payload bytes <-> types; the only file that knows msg_schemas.

A payload is the CDR of a message in ``msg_schemas``, carried in a std_msgs/UInt8MultiArray, so
that no interface package has to be built. A later interface package would carry the same bytes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import MessageLimits
from adversarial_lcd_ros.errors import CodecError, GraphError
from adversarial_lcd_ros.graph import (
    DESCRIPTOR_BYTES,
    FEATURE_TIER,
    SCENE_CLASS,
    MultiTierGraph,
)
from adversarial_lcd_ros.messages.checks import (
    check_decision,
    check_graph,
    check_probability,
    check_report,
    check_sizes,
    checked_name,
    checked_stamp_ns,
)
from adversarial_lcd_ros.messages.schemas import MESSAGES as MESSAGES
from adversarial_lcd_ros.messages.schemas import dump as _dump
from adversarial_lcd_ros.messages.schemas import load, schema_version
from adversarial_lcd_ros.messages.schemas import message_type as _type
from adversarial_lcd_ros.messages.schemas import schema_text as schema_text
from adversarial_lcd_ros.messages.schemas import typestore as typestore
from adversarial_lcd_ros.messages.sealing import unsealed
from adversarial_lcd_ros.messages.types import (
    AttackReport,
    FrameDetections,
    LcdAnswer,
    LcdQuery,
    LoopClosure,
    log_odds,
)
from adversarial_lcd_ros.paths import PACKAGE

# What a command reads: bags of one's own may hold larger graphs than a node takes in by default.
LIMITS = MessageLimits(max_nodes=100_000, max_edges=10_000_000, max_words=1_000_000,
                       max_pixels=2 ** 27, max_payload_bytes=2 ** 26)
MAX_PAYLOAD_BYTES = LIMITS.max_payload_bytes
_NS = 1_000_000_000
_REPORT_FIELDS = ('sequence', 'status', 'reason', 'edit_budget', 'edits', 'query_budget',
                  'queries', 'loss_before', 'loss_after', 'duration_s')


def _header(stamp_ns: int, frame_id: str) -> Any:
    return _type('std_msgs/msg/Header')(stamp=_time(stamp_ns), frame_id=frame_id)


def _time(stamp_ns: int) -> Any:
    seconds, nanoseconds = divmod(int(stamp_ns), _NS)
    return _type('builtin_interfaces/msg/Time')(sec=seconds, nanosec=nanoseconds)


def _stamp_ns(time: Any) -> int:
    return checked_stamp_ns(time.sec, time.nanosec)


def _frame_id(message: Any) -> str:
    return checked_name(message.header.frame_id, 'frame_id')


def _load(payload: bytes | bytearray | memoryview, name: str,
          limits: MessageLimits = LIMITS) -> Any:
    return load(payload, name, limits.max_payload_bytes)


def encode_graph(graph: MultiTierGraph, session: int | None = None) -> bytes:
    """Return the CDR of MultiTierGraph.msg; ``session`` in place of the graph's own."""
    return _dump(_graph_message(graph, session), 'MultiTierGraph')


def decode_graph(payload: bytes | bytearray | memoryview,
                 limits: MessageLimits = LIMITS) -> MultiTierGraph:
    """
    Return the graph in a payload after every count, index and range has been checked.

    A seal behind it is not looked at: ``authentic.Gate`` does that.

    Raises
    ------
    CodecError
        The payload is no MultiTierGraph, larger than the limits, or contradicts itself.

    """
    return _graph(_load(unsealed(payload), 'MultiTierGraph', limits), limits)


def _graph_message(graph: MultiTierGraph, session: int | None = None) -> Any:
    return _type(f'{PACKAGE}/msg/MultiTierGraph')(
        header=_header(graph.stamp_ns, graph.frame_id),
        schema_version=schema_version('MultiTierGraph'), sequence=graph.sequence,
        width=graph.width, height=graph.height,
        node_tier=graph.tier, node_label=graph.label,
        node_position=graph.position.ravel(), node_size=graph.size.ravel(),
        node_score=graph.score,
        node_descriptor=graph.descriptor[graph.tier == FEATURE_TIER].ravel(),
        edge_source=np.ascontiguousarray(graph.edge[:, 0]),
        edge_target=np.ascontiguousarray(graph.edge[:, 1]),
        edge_length=graph.edge_length,
        word=graph.word, word_weight=graph.word_weight,
        session=graph.session if session is None else session)


def _graph(message: Any, limits: MessageLimits) -> MultiTierGraph:
    check_sizes(message, limits)
    count = len(message.node_tier)
    features = int(np.count_nonzero(message.node_tier == FEATURE_TIER))
    expected = {'node_label': count, 'node_position': 2 * count, 'node_size': 2 * count,
                'node_score': count, 'node_descriptor': DESCRIPTOR_BYTES * features,
                'edge_target': len(message.edge_source),
                'edge_length': len(message.edge_source),
                'word_weight': len(message.word)}
    for name, length in expected.items():
        if len(getattr(message, name)) != length:
            raise CodecError(f'{name} has {len(getattr(message, name))} values: '
                             f'expected {length}', cause='counts')
    descriptor: NDArray[np.uint8] = np.zeros((count, DESCRIPTOR_BYTES), np.uint8)
    descriptor[message.node_tier == FEATURE_TIER] = message.node_descriptor.reshape(
        -1, DESCRIPTOR_BYTES)
    try:
        graph = MultiTierGraph(
            stamp_ns=_stamp_ns(message.header.stamp), frame_id=_frame_id(message),
            sequence=int(message.sequence), width=int(message.width), height=int(message.height),
            tier=message.node_tier, label=message.node_label,
            position=message.node_position.reshape(-1, 2), size=message.node_size.reshape(-1, 2),
            score=message.node_score, descriptor=descriptor,
            edge=np.stack([message.edge_source, message.edge_target], axis=1),
            edge_length=message.edge_length, word=message.word, word_weight=message.word_weight,
            session=_session(message))
    except GraphError as error:
        raise CodecError(f'MultiTierGraph payload refused: {error}', cause=error.cause) from error
    check_graph(graph)
    return graph


def _session(message: Any) -> int:
    return int(getattr(message, 'session', 0))  # messages of version 1 have none


def encode_loop_closure(decision: LoopClosure) -> bytes:
    """Return the CDR of LoopClosure.msg."""
    has_match = decision.match_stamp_ns is not None
    return _dump(_type(f'{PACKAGE}/msg/LoopClosure')(
        header=_header(decision.stamp_ns, decision.frame_id),
        schema_version=schema_version('LoopClosure'),
        sequence=decision.sequence, is_loop=bool(decision.is_loop),
        probability=float(decision.probability), has_match=has_match,
        match_stamp=_time(decision.match_stamp_ns or 0),
        match_sequence=decision.match_sequence or 0,
        vbow_score=float(decision.vbow_score), candidates=decision.candidates,
        log_odds=float(decision.log_odds), session=decision.session,
        match_session=decision.match_session), 'LoopClosure')


def decode_loop_closure(payload: bytes | bytearray | memoryview) -> LoopClosure:
    """Return the decision in a payload; raises CodecError."""
    message = _load(payload, 'LoopClosure')
    matched = bool(message.has_match)
    decision = LoopClosure(
        stamp_ns=_stamp_ns(message.header.stamp), frame_id=_frame_id(message),
        sequence=int(message.sequence), is_loop=bool(message.is_loop),
        probability=float(message.probability),
        match_stamp_ns=_stamp_ns(message.match_stamp) if matched else None,
        match_sequence=int(message.match_sequence) if matched else None,
        vbow_score=float(message.vbow_score), candidates=int(message.candidates),
        log_odds=_log_odds(message), session=_session(message),
        match_session=int(getattr(message, 'match_session', 0)))
    check_decision(decision)
    return decision


def _log_odds(message: Any) -> float:
    """Return the log odds of a message, those of its probability if it is of version 1."""
    known = float(getattr(message, 'log_odds', log_odds(message.probability)))
    check_probability(message.probability, known)
    return known


def encode_query(query: LcdQuery) -> bytes:
    """Return the CDR of LcdQuery.msg."""
    return _dump(_type(f'{PACKAGE}/msg/LcdQuery')(
        schema_version=schema_version('LcdQuery'), id=query.id, graph=_graph_message(query.graph)),
        'LcdQuery')


def decode_query(payload: bytes | bytearray | memoryview,
                 limits: MessageLimits = LIMITS) -> LcdQuery:
    """Return the query in a payload; raises CodecError."""
    message = _load(payload, 'LcdQuery', limits)
    if message.graph.schema_version != message.schema_version:
        raise CodecError(f'query of version {message.schema_version} with a graph of version '
                         f'{message.graph.schema_version}: expected the same', cause='version')
    return LcdQuery(id=int(message.id), graph=_graph(message.graph, limits))


def encode_answer(answer: LcdAnswer) -> bytes:
    """Return the CDR of LcdAnswer.msg."""
    return _dump(_type(f'{PACKAGE}/msg/LcdAnswer')(
        schema_version=schema_version('LcdAnswer'), id=answer.id, is_loop=bool(answer.is_loop),
        is_soft=bool(answer.is_soft), probability=float(answer.probability),
        log_odds=float(answer.log_odds), session=answer.session), 'LcdAnswer')


def decode_answer(payload: bytes | bytearray | memoryview) -> LcdAnswer:
    """Return the answer in a payload; raises CodecError."""
    message = _load(payload, 'LcdAnswer')
    return LcdAnswer(id=int(message.id), is_loop=bool(message.is_loop),
                     is_soft=bool(message.is_soft), probability=float(message.probability),
                     log_odds=_log_odds(message), session=_session(message))


def encode_attack_report(report: AttackReport) -> bytes:
    """Return the CDR of AttackReport.msg."""
    values = {name: getattr(report, name) for name in (
        *_REPORT_FIELDS, 'node_budget', 'nodes_moved')}
    return _dump(_type(f'{PACKAGE}/msg/AttackReport')(
        header=_header(report.stamp_ns, report.frame_id),
        schema_version=schema_version('AttackReport'), **values), 'AttackReport')


def decode_attack_report(payload: bytes | bytearray | memoryview) -> AttackReport:
    """Return the report in a payload; raises CodecError."""
    message = _load(payload, 'AttackReport')
    report = AttackReport(
        stamp_ns=_stamp_ns(message.header.stamp), frame_id=_frame_id(message),
        **{name: getattr(message, name) for name in _REPORT_FIELDS},
        node_budget=int(getattr(message, 'node_budget', 0)),
        nodes_moved=int(getattr(message, 'nodes_moved', 0)))
    checked_name(report.reason, 'reason')
    check_report(report)
    return report


def encode_detections(detections: FrameDetections) -> bytes:
    """Return the CDR of Detections.msg."""
    return _dump(_type(f'{PACKAGE}/msg/Detections')(
        header=_header(detections.stamp_ns, detections.frame_id),
        schema_version=schema_version('Detections'), label=detections.label,
        box=detections.box.ravel(), score=detections.score), 'Detections')


def decode_detections(payload: bytes | bytearray | memoryview,
                      limits: MessageLimits = LIMITS) -> FrameDetections:
    """
    Return the detections in a payload after counts and ranges have been checked.

    Raises
    ------
    CodecError
        The payload is no Detections, or one that contradicts itself.

    """
    message = _load(payload, 'Detections', limits)
    count = len(message.label)
    if count > limits.max_nodes:
        raise CodecError(f'{count} detections in a frame: at most {limits.max_nodes} are accepted '
                         '(parameter max_nodes)', cause='too many nodes')
    if (len(message.box), len(message.score)) != (4 * count, count):
        raise CodecError(f'{count} labels with {len(message.box)} values of box and '
                         f'{len(message.score)} scores: expected {4 * count} and {count}',
                         cause='counts')
    box = message.box.reshape(-1, 4)
    if not (np.isfinite(box).all() and (box[:, 2:] > 0).all()):
        raise CodecError('box that is not finite, or without width or height', cause='box')
    if not ((message.score >= 0) & (message.score <= 1)).all():
        raise CodecError('score: expected 0 to 1', cause='score')
    if count and message.label.max() >= SCENE_CLASS:
        raise CodecError(f'class {int(message.label.max())}: expected 0 to {SCENE_CLASS - 1}',
                         cause='label')
    return FrameDetections(_stamp_ns(message.header.stamp), _frame_id(message),
                           message.label, box, message.score)
