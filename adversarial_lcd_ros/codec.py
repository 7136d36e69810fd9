"""
Payload bytes <-> types; the only file that knows msg_schemas.

A payload is the CDR of a message in ``msg_schemas``, carried in a std_msgs/UInt8MultiArray, so
that no interface package has to be built. A later interface package would carry the same bytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from adversarial_lcd_ros.errors import CodecError, GraphError
from adversarial_lcd_ros.graph import DESCRIPTOR_BYTES, FEATURE_TIER, MultiTierGraph
from adversarial_lcd_ros.paths import PACKAGE, share_path

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

SCHEMA_VERSION = 1
MESSAGES = ('MultiTierGraph', 'LoopClosure', 'LcdQuery', 'LcdAnswer', 'AttackReport',
            'Detections')
MAX_NODES = 100_000
MAX_PAYLOAD_BYTES = 64 * 1024 * 1024
_NS = 1_000_000_000
_REPORT_FIELDS = ('sequence', 'status', 'reason', 'edit_budget', 'edits', 'query_budget',
                  'queries', 'loss_before', 'loss_after', 'duration_s')


@dataclass(frozen=True)
class LoopClosure:
    """
    What the detector decided on one graph.

    Attributes
    ----------
    stamp_ns, frame_id, sequence
        Of the graph decided on.
    is_loop : bool
        Probability at or above the detector's threshold.
    probability : float
        Calibrated probability of a loop closure, 0 to 1.
    match_stamp_ns, match_sequence : int or None
        Best matching keyframe; None without a candidate outside the temporal gap.
    vbow_score : float
        DBoW L1 score with the match, 0 to 1.
    candidates : int
        Number of keyframes compared with the graph.

    """

    stamp_ns: int
    frame_id: str
    sequence: int
    is_loop: bool
    probability: float
    match_stamp_ns: int | None = None
    match_sequence: int | None = None
    vbow_score: float = 0.0
    candidates: int = 0


@dataclass(frozen=True)
class LcdQuery:
    """A graph that the detector shall judge without remembering it."""

    id: int
    graph: MultiTierGraph


@dataclass(frozen=True)
class LcdAnswer:
    """The detector's answer to the query of the same id."""

    id: int
    is_loop: bool
    is_soft: bool
    probability: float


@dataclass(frozen=True)
class AttackReport:
    """
    What the attacker did to one graph; the fields are those of AttackReport.msg.

    Attributes
    ----------
    status : str
        success, failure or skipped.
    edit_budget, edits, query_budget, queries : int
        Granted and spent.
    loss_before, loss_after : float
        Attack loss of the clean and of the forwarded graph; above 0 is success.
    duration_s : float
        From the graph's arrival to its publication, seconds.

    """

    stamp_ns: int
    frame_id: str
    sequence: int
    status: str
    reason: str = ''
    edit_budget: int = 0
    edits: int = 0
    query_budget: int = 0
    queries: int = 0
    loss_before: float = 0.0
    loss_after: float = 0.0
    duration_s: float = 0.0


@dataclass(frozen=True, eq=False)
class FrameDetections:
    """
    What a detector of the user's own has found in one frame.

    Attributes
    ----------
    stamp_ns, frame_id
        Of the frame.
    label : uint32, (k,)
        Class.
    box : float32, (k, 4)
        x, y of the upper left corner, width, height, pixels; may reach beyond the image.
    score : float32, (k,)
        Confidence, 0 to 1.

    """

    stamp_ns: int
    frame_id: str
    label: NDArray[np.uint32]
    box: NDArray[np.float32]
    score: NDArray[np.float32]


def schema_text(message: str) -> str:
    """Return the .msg text of one of MESSAGES."""
    return share_path(f'msg_schemas/{message}.msg').read_text(encoding='utf-8')


@cache
def typestore() -> Typestore:
    """Return the Jazzy typestore with this package's messages registered."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types: dict[str, Any] = {}
    for message in MESSAGES:
        types |= get_types_from_msg(schema_text(message), f'{PACKAGE}/msg/{message}')
    store.register(types)
    return store


def _type(name: str) -> Any:
    return typestore().types[name]


def _header(stamp_ns: int, frame_id: str) -> Any:
    return _type('std_msgs/msg/Header')(stamp=_time(stamp_ns), frame_id=frame_id)


def _time(stamp_ns: int) -> Any:
    seconds, nanoseconds = divmod(int(stamp_ns), _NS)
    return _type('builtin_interfaces/msg/Time')(sec=seconds, nanosec=nanoseconds)


def _stamp_ns(time: Any) -> int:
    if not 0 <= time.nanosec < _NS:
        raise CodecError(f'stamp with {time.nanosec} nanoseconds: expected below {_NS}')
    return int(time.sec) * _NS + int(time.nanosec)


def _dump(message: Any, name: str) -> bytes:
    return bytes(typestore().serialize_cdr(message, f'{PACKAGE}/msg/{name}'))


def _load(payload: bytes | bytearray | memoryview, name: str) -> Any:
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise CodecError(f'{name} payload of {len(payload)} bytes: '
                         f'at most {MAX_PAYLOAD_BYTES} are accepted')
    try:
        # rosbags reports most damage as SerdeError, the rest as whatever broke inside it.
        message: Any = typestore().deserialize_cdr(bytes(payload), f'{PACKAGE}/msg/{name}')
    except Exception as error:
        raise CodecError(f'{len(payload)} bytes are no {name}: {error!r}') from error
    if message.schema_version != SCHEMA_VERSION:
        raise CodecError(f'{name} has schema version {message.schema_version}: '
                         f'this package reads version {SCHEMA_VERSION}')
    return message


def encode_graph(graph: MultiTierGraph) -> bytes:
    """Return the CDR of MultiTierGraph.msg."""
    return _dump(_graph_message(graph), 'MultiTierGraph')


def decode_graph(payload: bytes | bytearray | memoryview) -> MultiTierGraph:
    """
    Return the graph in a payload after every count, index and range has been checked.

    Raises
    ------
    CodecError
        The payload is no MultiTierGraph, or one that contradicts itself.

    """
    return _graph(_load(payload, 'MultiTierGraph'))


def _graph_message(graph: MultiTierGraph) -> Any:
    return _type(f'{PACKAGE}/msg/MultiTierGraph')(
        header=_header(graph.stamp_ns, graph.frame_id),
        schema_version=SCHEMA_VERSION, sequence=graph.sequence,
        width=graph.width, height=graph.height,
        node_tier=graph.tier, node_label=graph.label,
        node_position=graph.position.ravel(), node_size=graph.size.ravel(),
        node_score=graph.score,
        node_descriptor=graph.descriptor[graph.tier == FEATURE_TIER].ravel(),
        edge_source=np.ascontiguousarray(graph.edge[:, 0]),
        edge_target=np.ascontiguousarray(graph.edge[:, 1]),
        edge_length=graph.edge_length,
        word=graph.word, word_weight=graph.word_weight)


def _graph(message: Any) -> MultiTierGraph:
    count = len(message.node_tier)
    if count > MAX_NODES:
        raise CodecError(f'graph of {count} nodes: at most {MAX_NODES} are accepted')
    features = int(np.count_nonzero(message.node_tier == FEATURE_TIER))
    expected = {'node_label': count, 'node_position': 2 * count, 'node_size': 2 * count,
                'node_score': count, 'node_descriptor': DESCRIPTOR_BYTES * features,
                'edge_target': len(message.edge_source),
                'edge_length': len(message.edge_source),
                'word_weight': len(message.word)}
    for name, length in expected.items():
        if len(getattr(message, name)) != length:
            raise CodecError(f'{name} has {len(getattr(message, name))} values: '
                             f'expected {length}')
    descriptor: NDArray[np.uint8] = np.zeros((count, DESCRIPTOR_BYTES), np.uint8)
    descriptor[message.node_tier == FEATURE_TIER] = message.node_descriptor.reshape(
        -1, DESCRIPTOR_BYTES)
    try:
        return MultiTierGraph(
            stamp_ns=_stamp_ns(message.header.stamp), frame_id=message.header.frame_id,
            sequence=int(message.sequence), width=int(message.width), height=int(message.height),
            tier=message.node_tier, label=message.node_label,
            position=message.node_position.reshape(-1, 2), size=message.node_size.reshape(-1, 2),
            score=message.node_score, descriptor=descriptor,
            edge=np.stack([message.edge_source, message.edge_target], axis=1),
            edge_length=message.edge_length, word=message.word, word_weight=message.word_weight)
    except GraphError as error:
        raise CodecError(f'MultiTierGraph payload refused: {error}') from error


def encode_loop_closure(decision: LoopClosure) -> bytes:
    """Return the CDR of LoopClosure.msg."""
    has_match = decision.match_stamp_ns is not None
    return _dump(_type(f'{PACKAGE}/msg/LoopClosure')(
        header=_header(decision.stamp_ns, decision.frame_id), schema_version=SCHEMA_VERSION,
        sequence=decision.sequence, is_loop=bool(decision.is_loop),
        probability=float(decision.probability), has_match=has_match,
        match_stamp=_time(decision.match_stamp_ns or 0),
        match_sequence=decision.match_sequence or 0,
        vbow_score=float(decision.vbow_score), candidates=decision.candidates), 'LoopClosure')


def decode_loop_closure(payload: bytes | bytearray | memoryview) -> LoopClosure:
    """Return the decision in a payload; raises CodecError."""
    message = _load(payload, 'LoopClosure')
    _check_probability(message.probability)
    matched = bool(message.has_match)
    return LoopClosure(
        stamp_ns=_stamp_ns(message.header.stamp), frame_id=message.header.frame_id,
        sequence=int(message.sequence), is_loop=bool(message.is_loop),
        probability=float(message.probability),
        match_stamp_ns=_stamp_ns(message.match_stamp) if matched else None,
        match_sequence=int(message.match_sequence) if matched else None,
        vbow_score=float(message.vbow_score), candidates=int(message.candidates))


def encode_query(query: LcdQuery) -> bytes:
    """Return the CDR of LcdQuery.msg."""
    return _dump(_type(f'{PACKAGE}/msg/LcdQuery')(
        schema_version=SCHEMA_VERSION, id=query.id, graph=_graph_message(query.graph)),
        'LcdQuery')


def decode_query(payload: bytes | bytearray | memoryview) -> LcdQuery:
    """Return the query in a payload; raises CodecError."""
    message = _load(payload, 'LcdQuery')
    return LcdQuery(id=int(message.id), graph=_graph(message.graph))


def encode_answer(answer: LcdAnswer) -> bytes:
    """Return the CDR of LcdAnswer.msg."""
    return _dump(_type(f'{PACKAGE}/msg/LcdAnswer')(
        schema_version=SCHEMA_VERSION, id=answer.id, is_loop=bool(answer.is_loop),
        is_soft=bool(answer.is_soft), probability=float(answer.probability)), 'LcdAnswer')


def decode_answer(payload: bytes | bytearray | memoryview) -> LcdAnswer:
    """Return the answer in a payload; raises CodecError."""
    message = _load(payload, 'LcdAnswer')
    _check_probability(message.probability)
    return LcdAnswer(id=int(message.id), is_loop=bool(message.is_loop),
                     is_soft=bool(message.is_soft), probability=float(message.probability))


def encode_attack_report(report: AttackReport) -> bytes:
    """Return the CDR of AttackReport.msg."""
    values = {name: getattr(report, name) for name in _REPORT_FIELDS}
    return _dump(_type(f'{PACKAGE}/msg/AttackReport')(
        header=_header(report.stamp_ns, report.frame_id), schema_version=SCHEMA_VERSION,
        **values), 'AttackReport')


def decode_attack_report(payload: bytes | bytearray | memoryview) -> AttackReport:
    """Return the report in a payload; raises CodecError."""
    message = _load(payload, 'AttackReport')
    return AttackReport(
        stamp_ns=_stamp_ns(message.header.stamp), frame_id=message.header.frame_id,
        **{name: getattr(message, name) for name in _REPORT_FIELDS})


def encode_detections(detections: FrameDetections) -> bytes:
    """Return the CDR of Detections.msg."""
    return _dump(_type(f'{PACKAGE}/msg/Detections')(
        header=_header(detections.stamp_ns, detections.frame_id), schema_version=SCHEMA_VERSION,
        label=detections.label, box=detections.box.ravel(), score=detections.score),
        'Detections')


def decode_detections(payload: bytes | bytearray | memoryview) -> FrameDetections:
    """
    Return the detections in a payload after counts and ranges have been checked.

    Raises
    ------
    CodecError
        The payload is no Detections, or one that contradicts itself.

    """
    message = _load(payload, 'Detections')
    count = len(message.label)
    if count > MAX_NODES:
        raise CodecError(f'{count} detections in a frame: at most {MAX_NODES} are accepted')
    if (len(message.box), len(message.score)) != (4 * count, count):
        raise CodecError(f'{count} labels with {len(message.box)} values of box and '
                         f'{len(message.score)} scores: expected {4 * count} and {count}')
    box = message.box.reshape(-1, 4)
    if not (np.isfinite(box).all() and (box[:, 2:] > 0).all()):
        raise CodecError('box that is not finite, or without width or height')
    if not ((message.score >= 0) & (message.score <= 1)).all():
        raise CodecError('score: expected 0 to 1')
    return FrameDetections(_stamp_ns(message.header.stamp), message.header.frame_id,
                           message.label, box, message.score)


def _check_probability(probability: float) -> None:
    if not 0.0 <= probability <= 1.0:
        raise CodecError(f'probability {probability}: expected 0 to 1')
