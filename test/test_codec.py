"""Payloads: exact round trip, and nothing that is damaged gets through."""

from dataclasses import replace

from graph_factory import graphs, make_graph
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg

from adversarial_lcd_ros import codec
from adversarial_lcd_ros.errors import CodecError

stamps = st.integers(0, 2**31 - 1).flatmap(
    lambda s: st.integers(0, 10**9 - 1).map(lambda ns: s * 10**9 + ns))
uint32 = st.integers(0, 2**32 - 1)
text = st.text(st.characters(codec='utf-8', exclude_characters='\0'), max_size=20)
real = st.floats(allow_nan=False, allow_infinity=False)
chance = st.floats(0, 1)


@given(graphs(min_nodes=0), stamps, text, uint32)
def test_graph_round_trip(graph, stamp_ns, frame_id, sequence):
    graph = replace(graph, stamp_ns=stamp_ns, frame_id=frame_id, sequence=sequence)
    payload = codec.encode_graph(graph)
    assert codec.decode_graph(payload) == graph
    assert codec.encode_graph(codec.decode_graph(payload)) == payload


@given(st.builds(codec.LoopClosure, stamps, text, uint32, st.booleans(), chance, st.none(),
                 st.none(), chance, uint32),
       stamps, uint32, st.booleans())
def test_loop_closure_round_trip(decision, match_ns, match_sequence, matched):
    if matched:
        decision = replace(decision, match_stamp_ns=match_ns, match_sequence=match_sequence)
    assert codec.decode_loop_closure(codec.encode_loop_closure(decision)) == decision


@given(st.integers(0, 2**64 - 1), graphs(), st.booleans(), st.booleans(), chance)
def test_query_and_answer_round_trip(number, graph, is_loop, is_soft, probability):
    query = codec.decode_query(codec.encode_query(codec.LcdQuery(number, graph)))
    assert (query.id, query.graph) == (number, graph)
    answer = codec.LcdAnswer(number, is_loop, is_soft, probability)
    assert codec.decode_answer(codec.encode_answer(answer)) == answer


@given(st.builds(codec.AttackReport, stamps, text, uint32, text, text, uint32, uint32, uint32,
                 uint32, real, real, real))
def test_attack_report_round_trip(report):
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
        # Only what spells the schema version can be anything but noise.
        if b'\x01' not in noise:
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


@pytest.mark.parametrize(('fields', 'said'), [
    ({'schema_version': 9}, 'version 9'),
    ({'edge_target': np.array([1, 2, 3, 77], np.uint32)}, 'edge to node 77'),
    ({'edge_target': np.array([1, 2, 3], np.uint32)}, 'edge_target has 3'),
    ({'edge_length': np.full(4, np.nan, np.float32)}, 'not finite'),
    ({'node_descriptor': np.zeros(31, np.uint8)}, 'node_descriptor has 31'),
    ({'node_position': np.zeros(3, np.float32)}, 'node_position has 3'),
    ({'word_weight': np.zeros(0, np.float32)}, 'word_weight has 0'),
])
def test_what_decodes_is_checked(fields, said):
    with pytest.raises(CodecError, match=said):
        codec.decode_graph(damaged(**fields))


def test_a_probability_out_of_range_is_refused():
    payload = codec.encode_answer(codec.LcdAnswer(1, True, True, 1.5))
    with pytest.raises(CodecError, match='probability'):
        codec.decode_answer(payload)


@pytest.mark.parametrize('message', codec.MESSAGES)
def test_schemas_are_ordinary_msg_files(message):
    name = f'adversarial_lcd_ros/msg/{message}'
    assert name in get_types_from_msg(codec.schema_text(message), name)
