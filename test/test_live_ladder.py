# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The tour over the nodes: every attacker, and every defence before one, decides as offline."""

from dataclasses import asdict, replace

import pytest

from adversarial_lcd_ros.attack.images.posting import Posting
from adversarial_lcd_ros.config import AttackConfig, BuilderConfig, LcdConfig, ReplayConfig
from adversarial_lcd_ros.evaluation.replay.offline import run_offline
from adversarial_lcd_ros.evaluation.replay.processes import RECORDING, read_recording
from adversarial_lcd_ros.files.keys import make_key, read_key
from adversarial_lcd_ros.graph_sequences.bags import CLEAN_TOPIC, GRAPH_TOPIC
from adversarial_lcd_ros.messages.codec import encode_graph
from adversarial_lcd_ros.messages.payload import bag_type
from adversarial_lcd_ros.messages.sealing import Sealer
from adversarial_lcd_ros.paths import share_path
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.sequences.bagfile import BagWriter
from adversarial_lcd_ros.vision.builder import GraphBuilder

pytest.importorskip('rclpy', reason='rclpy is not installed: pip install ".[ros]"')

from adversarial_lcd_ros.nodes.attacker import AttackerNode
from adversarial_lcd_ros.nodes.bag_replay import BagReplayNode
from adversarial_lcd_ros.nodes.graph_builder import GraphBuilderNode
from adversarial_lcd_ros.nodes.lcd import LcdNode

TOUR = share_path('bags/flat_tour')
# Of all three laps, every ninth frame: places that are new, and then loops.
THIN = {'lockstep': True, 'window': 4, 'stride': 9, 'timeout_s': 60.0}
FRAMES = 40
ATTACKS = {
    'paper': AttackConfig(max_queries=12),
    'recall': AttackConfig(search='recall', max_queries=12),
    'recall, no queries': AttackConfig(search='recall', mode='surrogate'),
    'lengths': AttackConfig(search='recall', lengths=True, max_queries=12),
    'nearest': AttackConfig(search='recall', nearest=12, max_queries=12),
    'nodes': AttackConfig(search='move_nodes', max_queries=6),
    'nodes far apart': AttackConfig(search='move_nodes', moved='spread', max_queries=6),
    'replay': AttackConfig(search='replay')}
# Every attacker once, every defence once, before one who changes what the detector is sent.
PAIRS = [
    ('paper', {}), ('nearest', {}), ('replay', {}),
    ('recall, no queries', {'defences': 'rederive'}),
    ('recall', {'defences': 'rederive_check'}),
    ('lengths', {'defences': 'length_check'}),
    ('nodes', {'defences': 'geometric_check'}),
    ('nodes far apart', {'defences': 'geometric_check', 'geometric_hull': 0.1}),
    ('replay', {'defences': 'common_part'})]


@pytest.fixture(scope='module')
def tour(tmp_path_factory):
    """Return a folder with the sealed graphs of the tour in a bag, and the key."""
    folder = tmp_path_factory.mktemp('tour')
    make_key(folder / 'key')
    sealer = Sealer(read_key(folder / 'key'))
    with GraphBuilder() as builder, BagWriter(folder / 'bag') as bag:
        for number, frame in enumerate(open_sequence(TOUR).frames(stride=THIN['stride'])):
            graph = builder.build(frame.image(), frame.stamp_ns, sequence=number)
            bag.write(CLEAN_TOPIC, bag_type(GRAPH_TOPIC), graph.stamp_ns,
                      sealer.seal(encode_graph(graph)))
    return folder


def replay(ros, bag, folder, **parameters):
    node = ros.start(BagReplayNode, bag=str(bag), record=str(folder / RECORDING),
                     record_frames=False, **{**THIN, **parameters})
    assert node.work(ros.spin) == 0
    ros.stop(node)


def over_the_nodes(ros, tour, folder, attack, lcd, **key):
    """Return what went over the wire: the clean graphs of the tour through both nodes."""
    ros.start(LcdNode, **asdict(lcd), **key, **({'max_age_s': 0.0} if key else {}))
    ros.start(AttackerNode, **asdict(attack), query_timeout_s=60.0)
    replay(ros, tour / 'bag', folder, stride=1, **key)
    return read_recording(folder, attacked=True)


def as_offline(live, attack, lcd, *, sealed=False):
    """Tell that an attacked replay came out as without ROS; return the graphs that changed."""
    run, forwarded = run_offline(live.clean, lcd, attack, sealed=sealed)
    assert live.forwarded == forwarded
    assert live.decisions == run.decisions
    assert [replace(report, duration_s=0.0) for report in live.reports] == [
        replace(report, duration_s=0.0) for report in run.reports]
    assert len(live.clean) == FRAMES
    return sum(one != other for one, other in zip(live.clean, live.forwarded, strict=True))


@pytest.mark.parametrize(('name', 'settings'), PAIRS)
def test_an_attacker_before_a_defence(ros, tour, tmp_path, name, settings):
    attack, lcd = ATTACKS[name], LcdConfig(**settings)
    live = over_the_nodes(ros, tour, tmp_path, attack, lcd)
    assert as_offline(live, attack, lcd) > 0
    assert len(live.decisions) == FRAMES
    assert {decision.is_loop for decision in live.decisions} == {True, False}


def test_all_are_there():
    from adversarial_lcd_ros.registry import DEFENCES
    assert {name for name, _ in PAIRS} == set(ATTACKS)
    assert {settings['defences'] for _, settings in PAIRS if settings} == set(DEFENCES) - {'none'}


def test_sealed_graphs(ros, tour, tmp_path):
    attack = ATTACKS['replay']
    live = over_the_nodes(ros, tour, tmp_path, attack, LcdConfig(), key=str(tour / 'key'))
    changed = as_offline(live, attack, LcdConfig(), sealed=True)
    assert 0 < changed == FRAMES - len(live.decisions) < FRAMES


def test_a_poster(ros, tmp_path):
    hung = {'poster': 'cells', 'poster_share': 0.2, 'poster_spans': '4:7, 16:19'}
    ros.start(LcdNode)
    ros.start(GraphBuilderNode, detector='none')
    replay(ros, TOUR, tmp_path, **hung)
    live = read_recording(tmp_path, attacked=False)
    sequence = open_sequence(TOUR)
    posting = Posting(ReplayConfig(**hung), int(sequence.stamps_ns[0]))
    with GraphBuilder(BuilderConfig(detector='none')) as builder:
        plain, posted = ([builder.build(change(frame.image(), frame.stamp_ns), frame.stamp_ns,
                                        live.clean[0].frame_id, number)
                          for number, frame in enumerate(sequence.frames(stride=THIN['stride']))]
                         for change in (lambda image, _: image, posting.on_pixels))
    assert live.clean == posted
    assert 0 < sum(one != other for one, other in zip(plain, posted, strict=True)) < FRAMES
    assert live.decisions == run_offline(posted, LcdConfig())[0].decisions
    assert live.decisions != run_offline(plain, LcdConfig())[0].decisions
    assert len(live.decisions) == FRAMES
