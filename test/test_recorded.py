# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings of the nodes made by hand: what they hold is reported, nothing is replayed."""

from dataclasses import replace
import json

import bag_factory as make
from graph_factory import make_graph
import numpy as np
import pytest

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.evaluation.replay.offline import run_offline
from adversarial_lcd_ros.evaluation.replay.recorded import is_recording, read_recording
from adversarial_lcd_ros.lcd.defences.rederive import RederiveCheck
from adversarial_lcd_ros.messages.codec import (
    encode_attack_report,
    encode_graph,
    encode_loop_closure,
)
from adversarial_lcd_ros.messages.payload import WIRE_TYPE

COUNT = 24
# The target that flips of edges turn over on graphs as random as these.
LCD = LcdConfig(min_gap_s=2.0, target='anchored', kept_loops=0.95)


@pytest.fixture(scope='module')
def run():
    """Return clean graphs, two laps, with what attacker and detector make of them."""
    clean = [replace(graph_of(k % 12), stamp_ns=k * 10**9, sequence=k) for k in range(COUNT)]
    made, forwarded = run_offline(clean, LCD, AttackConfig(
        search='recall', ratio=0.004, max_queries=6))
    return clean, forwarded, made.decisions, made.reports


def graph_of(place):
    edges = np.random.default_rng(place).integers(0, 60, (240, 2)).tolist()
    return make_graph(60, [pair for pair in edges if pair[0] != pair[1]], seed=place)


def record(path, run, namespace='', leave_out=(), lost=()):
    """Write what "ros2 bag record" would, with messages of some topics and frames lost."""
    names = ('graph_clean', 'graph', 'loop_closures', 'attack_report')
    encode = (encode_graph, encode_graph, encode_loop_closure, encode_attack_report)
    rows = [(f'{namespace}/{name}', WIRE_TYPE, message.stamp_ns + late, payload(code(message)))
            for late, (name, code, messages) in enumerate(zip(names, encode, run, strict=True))
            if name not in leave_out
            for k, message in enumerate(messages) if (name, k) not in lost]
    return make.write_ros2(path, sorted(rows, key=lambda row: row[2]))


def payload(data):
    layout = make.ROS2.make('std_msgs/msg/MultiArrayLayout', dim=[], data_offset=0)
    return make.ROS2.make(WIRE_TYPE, layout=layout, data=np.frombuffer(data, np.uint8))


def evaluate(bag, tmp_path, *options):
    code = main(['evaluate', str(bag), '--output', str(tmp_path / 'results'),
                 '--lcd-min-gap-s', '2.0', '--lcd-target', 'anchored',
                 '--lcd-kept-loops', '0.95', *options])
    assert code == 0
    folder = (tmp_path / 'results' / 'latest').resolve()
    return json.loads((folder / 'summary.json').read_text()), (folder / 'report.html').read_text()


def test_a_recording_is_reported_as_it_is(run, tmp_path, capsys):
    bag = record(tmp_path / 'bag', run, namespace='/robot1')
    assert is_recording(bag)
    summary, page = evaluate(bag, tmp_path)
    assert not summary['labelled']
    assert summary['frames'] == COUNT
    before, attack = summary['rows']
    clean = run_offline(run[0], LCD)[0].decisions
    assert before['loops_declared'] == sum(d.is_loop for d in clean)
    assert attack['loops_declared'] == sum(d.is_loop for d in run[2])
    assert attack['changed'] > 0
    assert attack['queries_total'] == sum(report.queries for report in run[3])
    assert attack['edits_mean'] == sum(report.edits for report in run[3]) / COUNT
    assert attack['ratio'] is None
    repeated = f'repeats {COUNT} of {COUNT} recorded decisions'
    assert repeated in page
    assert repeated in capsys.readouterr().err
    assert main(['inspect', str(tmp_path / 'results' / 'latest')]) == 0
    assert 'Decisions changed' in capsys.readouterr().out


def test_edges_that_nodes_do_not_explain_are_counted_as_by_the_node(run, tmp_path):
    bag = record(tmp_path / 'bag', run)
    summary, report = evaluate(bag, tmp_path, '--lcd-defences', 'rederive_check')
    check = RederiveCheck(LCD)
    for name, graphs in (('clean', run[0]), ('recorded', run[1])):
        counts = [check.unexplained(graph) for graph in graphs]
        assert summary['unexplained_edges'][name] == {
            'mean': sum(counts) / COUNT, 'graphs': sum(count > 0 for count in counts)}
    assert summary['unexplained_edges']['clean'] != summary['unexplained_edges']['recorded']
    assert 'Unexplained edges:' in report
    plain, report = evaluate(bag, tmp_path)
    assert plain['unexplained_edges'] is None
    assert 'nexplained edges' not in report


def test_other_settings_are_noticed(run, tmp_path):
    summary, _ = evaluate(record(tmp_path / 'bag', run), tmp_path, '--lcd-kept-loops', '0.5')
    assert 'had other settings' in summary['notes'][-1]


def test_frames_that_are_not_whole_are_left_out_and_counted(run, tmp_path):
    lost = {('loop_closures', 20), ('attack_report', 21), ('graph', 22)}
    heard = read_recording(record(tmp_path / 'bag', run, lost=lost))
    assert len(heard.run.decisions) == COUNT - 3
    assert heard.notes[0].startswith('3 of 24 frames were left out')


def test_without_reports_queries_are_not_known(run, tmp_path):
    summary, page = evaluate(record(tmp_path / 'bag', run, leave_out=('attack_report',)), tmp_path)
    _, attack = summary['rows']
    assert attack['queries_mean'] is attack['edit_budget_mean'] is None
    assert attack['edits_mean'] == sum(report.edits for report in run[3]) / COUNT
    assert 'no attack reports were recorded' in summary['notes'][0]
    assert 'None' not in page


def test_a_match_that_was_not_recorded_is_none(run, tmp_path):
    clean, _, decisions, _ = run
    late = tuple(messages[8:] for messages in run)
    heard = read_recording(record(tmp_path / 'bag', late))
    known = {graph.stamp_ns for graph in clean[8:]}
    orphans = sum(d.match_stamp_ns not in {None, *known} for d in decisions[8:])
    assert orphans
    assert heard.notes == [f'{orphans} decisions name a match that was not recorded']
    assert all(d.match_stamp_ns in {None, *known} for d in heard.run.decisions)


def test_two_replays_in_one_recording_are_refused(run, tmp_path):
    twice = tuple(list(messages) * 2 for messages in run)
    with pytest.raises(SequenceError, match=r'two messages for the frame at 0 ns.*record one'):
        read_recording(record(tmp_path / 'bag', twice))


def test_a_recording_with_nothing_whole_is_refused(run, tmp_path):
    lost = {('graph', k) for k in range(1, COUNT)} | {('graph_clean', 0)}
    with pytest.raises(SequenceError, match='record the four nodes of one run together'):
        read_recording(record(tmp_path / 'bag', run, lost=lost))


def test_graphs_alone_are_no_recording(run, tmp_path):
    assert not is_recording(record(tmp_path / 'graphs', run, leave_out=('loop_closures',)))
    assert not is_recording(make.write_ros2(tmp_path / 'images', make.raw_rows()))
    assert not is_recording(tmp_path)
