# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Payloads: exact round trip, and nothing that is damaged gets through."""

from dataclasses import replace
from pathlib import Path

from graph_factory import graphs, make_graph
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg

from adversarial_lcd_ros.config import BuilderConfig, MessageLimits
from adversarial_lcd_ros.errors import CodecError
from adversarial_lcd_ros.keyframes.database import Database
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.checks import STATUSES
from adversarial_lcd_ros.messages.schemas import schema_version, typestore
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.vision.builder import GraphBuilder

stamps = st.integers(0, 2**31 - 1).flatmap(
    lambda s: st.integers(0, 10**9 - 1).map(lambda ns: s * 10**9 + ns))
uint32 = st.integers(0, 2**32 - 1)
uint64 = st.integers(0, 2**64 - 1)
text = st.text(st.characters(codec='utf-8', exclude_categories=['Cc', 'Cs']), max_size=20)
real = st.floats(allow_nan=False, allow_infinity=False)
chance = st.floats(0, 1)


@given(graphs(min_nodes=0), stamps, text, uint32)
def test_graph_round_trip(graph, stamp_ns, frame_id, sequence):
    graph = replace(graph, stamp_ns=stamp_ns, frame_id=frame_id, sequence=sequence)
    payload = codec.encode_graph(graph)
    assert codec.decode_graph(payload) == graph
    assert codec.encode_graph(codec.decode_graph(payload)) == payload


@given(st.builds(codec.LoopClosure, stamps, text, uint32, st.just(False), chance, st.none(),
                 st.none(), chance, uint32),
       stamps, uint32, st.booleans(), st.booleans(), uint64, uint64)
def test_loop_closure_round_trip(decision, match_ns, match_sequence, matched, is_loop, session,
                                 match_session):
    if matched:
        decision = replace(decision, match_stamp_ns=match_ns, match_sequence=match_sequence,
                           is_loop=is_loop, session=session, match_session=match_session)
    decoded = codec.decode_loop_closure(codec.encode_loop_closure(decision))
    assert vars(decoded) == vars(decision)


@given(st.integers(0, 2**64 - 1), graphs(), st.booleans(), st.booleans(), chance)
def test_query_and_answer_round_trip(number, graph, is_loop, is_soft, probability):
    query = codec.decode_query(codec.encode_query(codec.LcdQuery(number, graph)))
    assert (query.id, query.graph) == (number, graph)
    answer = codec.LcdAnswer(number, is_loop, is_soft, probability)
    assert codec.decode_answer(codec.encode_answer(answer)) == answer


@given(st.builds(codec.AttackReport, stamps, text, uint32, st.sampled_from(STATUSES), text,
                 uint32, st.just(0), uint32, st.just(0), real, real, st.floats(0, 1e9)),
       st.floats(0, 1), st.floats(0, 1))
def test_attack_report_round_trip(report, edits, queries):
    report = replace(report, edits=int(edits * report.edit_budget),
                     queries=int(queries * report.query_budget))
    assert codec.decode_attack_report(codec.encode_attack_report(report)) == report


@settings(max_examples=400)
@given(graphs(min_nodes=1), st.data())
def test_damage_is_refused_or_gives_a_valid_graph(graph, data):
    payload = bytearray(codec.encode_graph(graph))
    if data.draw(st.booleans()):
        payload = payload[:data.draw(st.integers(0, len(payload) - 1))]
    for _ in range(data.draw(st.integers(1, 4))):
        if payload:
            payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    try:
        decoded = codec.decode_graph(payload)
    except CodecError:
        return
    assert codec.decode_graph(codec.encode_graph(decoded)) == decoded


@given(st.binary(max_size=200))
def test_noise_is_refused(noise):
    for decode in (codec.decode_graph, codec.decode_query, codec.decode_answer,
                   codec.decode_loop_closure, codec.decode_attack_report):
        # Only what spells a schema version can be anything but noise.
        if b'\x01' not in noise and b'\x02' not in noise:
            with pytest.raises(CodecError):
                decode(noise)


def test_a_length_field_of_two_gigabytes_is_refused():
    payload = bytearray(codec.encode_graph(make_graph()))
    at = payload.index(np.uint32(6).tobytes(), 40)
    payload[at:at + 4] = np.uint32(2**31).tobytes()
    with pytest.raises(CodecError):
        codec.decode_graph(payload)


def test_a_huge_payload_is_refused_before_it_is_read():
    with pytest.raises(CodecError, match='at most'):
        codec.decode_graph(bytes(codec.MAX_PAYLOAD_BYTES + 1))


def damaged(**fields):
    """Return the payload of a graph message with fields that the graph class would refuse."""
    message = codec._graph_message(make_graph())
    return codec._dump(replace(message, **fields), 'MultiTierGraph')


def one(field, place, value):
    """Return a field of the message that ``damaged`` starts from, with one value changed."""
    array = getattr(codec._graph_message(make_graph()), field).copy()
    array[place] = value
    return {field: array}


@pytest.mark.parametrize(('fields', 'said', 'cause'), [
    ({'schema_version': 9}, 'version 9', 'version'),
    ({'schema_version': 0}, 'version 0', 'version'),
    ({'edge_target': np.array([1, 2, 3, 77], np.uint32)}, 'edge to node 77', 'edge'),
    ({'edge_target': np.array([1, 2, 3], np.uint32)}, 'edge_target has 3', 'counts'),
    ({'node_descriptor': np.zeros(31, np.uint8)}, 'node_descriptor has 31', 'counts'),
    ({'node_position': np.zeros(3, np.float32)}, 'node_position has 3', 'counts'),
    ({'word_weight': np.zeros(0, np.float32)}, 'word_weight has 0', 'counts'),
    ({'edge_length': np.full(4, np.nan, np.float32)}, 'not finite', 'not finite'),
    ({'word_weight': np.full(6, 1e12 / 6, np.float32)}, 'a sum of 1', 'word weights'),
    ({'word_weight': np.full(6, 0.15, np.float32)}, 'a sum of 1', 'word weights'),
    (one('word', -1, 2**31), 'at most', 'word'),
    (one('node_label', 3, 2**32 - 1), 'at most', 'label'),
    (one('node_position', 0, -1), 'inside the image', 'position'),
    (one('node_position', 4, 640.5), 'inside the image', 'position'),
    (one('node_position', 5, 3e38), 'inside the image', 'position'),
    (one('node_size', 2, 0), 'above 0', 'node size'),
    (one('node_size', 3, -5), 'above 0', 'node size'),
    (one('node_score', 0, -0.01), '0 to 1', 'score'),
    (one('node_score', 0, 1.01), '0 to 1', 'score'),
    (one('node_score', 4, -0.5), '0 to 1', 'score'),
    (one('edge_length', 1, 1.5), 'distance', 'edge length'),
    (one('edge_length', 1, 0.9), 'distance', 'edge length'),
    ({'width': 2**31 - 1}, 'max_pixels', 'too many pixels'),
])
def test_what_decodes_is_checked(fields, said, cause):
    with pytest.raises(CodecError, match=said) as caught:
        codec.decode_graph(damaged(**fields))
    assert caught.value.cause == cause


@pytest.mark.parametrize(('seconds', 'nanoseconds'), [(-1, 0), (-2**31, 0), (1, 10**9),
                                                      (1, 2**32 - 1)])
def test_stamps_out_of_range_are_refused(seconds, nanoseconds):
    header = codec._header(0, 'camera')
    header = replace(header, stamp=replace(header.stamp, sec=seconds, nanosec=nanoseconds))
    with pytest.raises(CodecError, match='stamp') as caught:
        codec.decode_graph(damaged(header=header))
    assert caught.value.cause == 'stamp'


@pytest.mark.parametrize('name', ['came\0ra', '\x1b[2J', 'x' * 257, '\x9b2J'])
def test_names_that_would_steer_a_terminal_are_refused(name):
    with pytest.raises(CodecError) as caught:
        codec.decode_graph(damaged(header=codec._header(0, name)))
    assert caught.value.cause == 'name'


@pytest.mark.parametrize(('limit', 'cause'), [
    ('max_nodes', 'too many nodes'), ('max_edges', 'too many edges'),
    ('max_words', 'too many words'), ('max_pixels', 'too many pixels')])
def test_limits_are_kept(limit, cause):
    payload = codec.encode_graph(make_graph())
    codec.decode_graph(payload, MessageLimits())
    with pytest.raises(CodecError, match=limit) as caught:
        codec.decode_graph(payload, MessageLimits(**{limit: 3}))
    assert caught.value.cause == cause


def test_a_query_and_its_graph_are_of_one_version():
    message = typestore().types['adversarial_lcd_ros/msg/LcdQuery'](
        schema_version=2, id=1, graph=replace(codec._graph_message(make_graph()),
                                              schema_version=9))
    with pytest.raises(CodecError, match='version 9'):
        codec.decode_query(codec._dump(message, 'LcdQuery'))


def version_1(payload, name):
    """Return a payload as version 1 of this package wrote it."""
    full = f'adversarial_lcd_ros/msg/{name}'
    return bytes(typestore(1).serialize_cdr(
        as_version_1(typestore().deserialize_cdr(payload, full)), full))


def as_version_1(message):
    """Return a message without the fields that came later."""
    kind = typestore(1).types[message.__msgtype__]
    values = {name: getattr(message, name) for name in kind.__dataclass_fields__
              if not name.startswith('__')}
    if 'graph' in values:
        values['graph'] = as_version_1(values['graph'])
    if 'schema_version' in values:
        values['schema_version'] = 1
    return kind(**values)


def test_messages_of_version_1_are_read():
    graph = make_graph(session=7)
    assert graph.session == codec.decode_graph(codec.encode_graph(graph)).session == 7
    old = codec.decode_graph(version_1(codec.encode_graph(graph), 'MultiTierGraph'))
    assert (old, old.session) == (graph, 0)
    query = codec.LcdQuery(3, graph)
    assert codec.decode_query(version_1(codec.encode_query(query), 'LcdQuery')).graph == graph
    decision = codec.LoopClosure(5, 'camera', 6, True, 0.75, 1, 2, 0.5, 4, session=9)
    old = codec.decode_loop_closure(version_1(codec.encode_loop_closure(decision), 'LoopClosure'))
    assert (old, old.session) == (decision, 0)
    answer = codec.LcdAnswer(3, True, True, 0.75)
    old = codec.decode_answer(version_1(codec.encode_answer(answer), 'LcdAnswer'))
    assert old == answer
    assert old.log_odds == pytest.approx(np.log(3))


def test_a_message_of_the_newest_version_is_never_called_unknown():
    message = replace(as_version_1(codec._graph_message(make_graph())), schema_version=2)
    payload = typestore(1).serialize_cdr(message, 'adversarial_lcd_ros/msg/MultiTierGraph')
    with pytest.raises(CodecError, match='are no MultiTierGraph'):
        codec.decode_graph(payload)


def test_log_odds_tell_more_than_the_probability():
    answer = codec.LcdAnswer(3, True, True, 1.0, log_odds=40.0)
    assert codec.decode_answer(codec.encode_answer(answer)).log_odds == 40.0
    assert codec.LcdAnswer(3, False, True, 0.0).log_odds == -np.inf
    for wrong in (3.0, -40.0):
        with pytest.raises(CodecError, match='do not agree'):
            codec.decode_answer(codec.encode_answer(replace(answer, log_odds=wrong)))


REPORT = codec.AttackReport(1, 'camera', 2, 'success', 'decision changed', 3, 3, 40, 12, -1.0, 2.0,
                            0.1)


@pytest.mark.parametrize(('change', 'cause'), [
    ({'status': 'quacess'}, 'status'), ({'edits': 4}, 'budget'), ({'queries': 41}, 'budget'),
    ({'loss_after': float('nan')}, 'not finite'), ({'loss_before': float('inf')}, 'not finite'),
    ({'duration_s': float('nan')}, 'not finite'), ({'duration_s': -1.0}, 'not finite'),
    ({'reason': 'a\nb'}, 'name')])
def test_reports_that_contradict_themselves_are_refused(change, cause):
    assert codec.decode_attack_report(codec.encode_attack_report(REPORT)) == REPORT
    with pytest.raises(CodecError) as caught:
        codec.decode_attack_report(codec.encode_attack_report(replace(REPORT, **change)))
    assert caught.value.cause == cause


@pytest.mark.parametrize(('change', 'cause'), [
    ({'match_stamp_ns': None}, 'match'), ({'vbow_score': 1.5}, 'score'),
    ({'vbow_score': float('nan')}, 'score'), ({'vbow_score': -0.1}, 'score'),
    ({'probability': 1.5, 'log_odds': 40.0}, 'probability')])
def test_decisions_that_contradict_themselves_are_refused(change, cause):
    decision = codec.LoopClosure(5, 'camera', 6, True, 0.75, 1, 2, 0.5, 4)
    with pytest.raises(CodecError) as caught:
        codec.decode_loop_closure(codec.encode_loop_closure(replace(decision, **change)))
    assert caught.value.cause == cause


def test_a_probability_out_of_range_is_refused():
    payload = codec.encode_answer(codec.LcdAnswer(1, True, True, 1.5, log_odds=0.0))
    with pytest.raises(CodecError, match='probability'):
        codec.decode_answer(payload)


@given(st.lists(st.integers(0, 2**24 - 1), min_size=1, max_size=50, unique=True),
       st.randoms(use_true_random=False), st.floats(0.9991, 1.0009))
def test_no_graph_that_passes_overflows_the_keyframes(words, random, total):
    weight = np.array([random.random() ** 8 + 1e-9 for _ in words])
    weight = (weight * total / weight.sum()).astype(np.float32)
    graph = make_graph(word=np.sort(np.array(words, np.uint32)), word_weight=weight)
    graph = codec.decode_graph(codec.encode_graph(graph))
    database = Database()
    database.add(graph)
    assert database.scores(graph) == pytest.approx([total], abs=1e-5)
    found, _ = database.retrieve(graph, np.ones(1, bool), 1)
    assert found == [0]


@pytest.mark.parametrize('features', [50, 1000])
def test_graphs_of_the_builder_pass(features):
    tour = open_sequence(str(Path(__file__).parents[1] / 'bags' / 'flat_tour'))
    with GraphBuilder(BuilderConfig(detector='none', features=features)) as builder:
        for frame in tour.frames(stride=60):
            graph = builder.build(frame.image(), frame.stamp_ns)
            assert codec.decode_graph(codec.encode_graph(graph), MessageLimits()) == graph


def test_payloads_that_were_accepted_once_are_refused(shared_cases):
    decoders = {'MultiTierGraph': codec.decode_graph, 'LcdQuery': codec.decode_query,
                'LoopClosure': codec.decode_loop_closure,
                'AttackReport': codec.decode_attack_report}
    nonsense = [*(shared_cases / 'payloads').glob('accepted_*.bin'),
                shared_cases / 'payloads' / 'graph_kills_lcd.bin']
    for path in nonsense:
        message = next((name for name in decoders if name in path.name), 'MultiTierGraph')
        with pytest.raises(CodecError) as caught:
            decoders[message](path.read_bytes())
        assert caught.value.cause != 'unreadable', path.name


@pytest.mark.parametrize('message', codec.MESSAGES)
def test_schemas_are_ordinary_msg_files(message):
    name = f'adversarial_lcd_ros/msg/{message}'
    assert name in get_types_from_msg(codec.schema_text(message), name)
    assert schema_version(message) == typestore().types[name].SCHEMA_VERSION
