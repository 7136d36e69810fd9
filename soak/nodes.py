# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults and floods against living nodes, each in a process of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import time
from typing import Any

import cv2
import numpy as np

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.payload import wrap
from soak.inputs import damaged, graph
from soak.outcome import Outcome, Slope, resident_mb
from soak.world import World, living

NODES = ('lcd', 'attacker', 'graph_builder')
_ANSWER_S = 60.0
# So many damaged messages go out before a valid one, whose answer is waited for.
_BURST = 40
# The attacker has edits to spend on graphs as small as these.
_PARAMETERS = {'lcd': ('max_keyframes:=200', 'min_gap_s:=0.5'),
               'attacker': ('mode:=surrogate', 'ratio:=0.01'),
               'graph_builder': ('detector:=none',)}
_SENT = {'lcd': 'graphs and queries', 'attacker': 'graphs and answers',
         'graph_builder': 'images'}
_KEYFRAMES = 300
_FIRST, _STEP_NS = 10**9, 33 * 10**6
# Stamps that are none, and ends of what can be one: seconds and nanoseconds.
_STAMPS = ((2**31 - 1, 10**9), (-2**31, 0), (2**31 - 1, 2**32 - 1), (0, 0), (-1, 999_999_999))


def flood(node: str, count: int, seed: int = 0) -> Outcome:
    """Send a living node so many damaged messages, and valid ones between them."""
    outcome = Outcome(f'damaged {_SENT[node]} to a living {node}',
                      'it lives, and each valid message between them is answered')
    rng, slope = np.random.default_rng(seed), Slope()
    make_damaged, make_valid = (
        (_damaged_image, _valid_image) if node == 'graph_builder' else
        (_payload_damage(node), _valid_graph))
    with living(node, _PARAMETERS[node], outcome) as world:
        for number in range(count if world else 0):
            world.publishers[number % 2].publish(make_damaged(number, rng))
            outcome.outcomes['sent damaged'] += 1
            if number % _BURST == _BURST - 1:
                asked_ns = (10**6 + number) * _STEP_NS
                world.publishers[0].publish(make_valid(asked_ns))
                if not world.until(lambda asked=asked_ns: asked in world.heard, _ANSWER_S):
                    outcome.outcomes['BROKEN a valid message was not answered'] += 1
                    break
                world.heard.clear()
                outcome.outcomes['valid message answered'] += 1
                slope.add(number, resident_mb(world.process.pid))
        if world:
            world.settle()
            if world.count('defects'):
                outcome.outcomes['BROKEN a defect of the node'] += world.count('defects')
            outcome.note = _causes(world.counts)
    return outcome


def _causes(counts: dict[str, str]) -> str:
    """Return what a node refused or forwarded unread, by cause."""
    return ', '.join(f'{name} {int(value):,}' for name, value in sorted(counts.items())
                     if name.startswith(('refused', 'forwarded')) and ':' in name)


def _payload_damage(node: str) -> Callable[[int, np.random.Generator], bytes]:
    """Return what makes damaged graphs, and queries or answers in turn."""
    several = [graph(nodes, nodes) for nodes in (12, 40)]
    graphs = [codec.encode_graph(one) for one in several]
    others = ([codec.encode_query(codec.LcdQuery(number, one))
               for number, one in enumerate(several)] if node == 'lcd' else
              [codec.encode_answer(codec.LcdAnswer(number, True, True, 0.6))
               for number in range(2)])

    def make(number: int, rng: np.random.Generator) -> bytes:
        data = (graphs, others)[number % 2][number // 2 % 2]
        return wrap(damaged(data, graphs[number // 2 % 2], rng))
    return make


def _valid_graph(stamp_ns: int) -> bytes:
    return wrap(codec.encode_graph(graph(40, 1, stamp_ns=stamp_ns, sequence=stamp_ns // _STEP_NS)))


def _valid_image(stamp_ns: int) -> Any:
    from sensor_msgs.msg import Image
    pixels = np.random.default_rng(stamp_ns).integers(0, 256, (60, 80), np.uint8)
    message = Image(height=60, width=80, step=80, encoding='mono8', data=pixels.tobytes())
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    return message


def _damaged_image(number: int, rng: np.random.Generator) -> Any:
    """Return a camera's message, plain or compressed in turn, that is wrong in some field."""
    from rclpy.serialization import serialize_message
    from sensor_msgs.msg import CompressedImage
    message = _valid_image(10**9 + number * _STEP_NS)
    if number % 2:
        _, png = cv2.imencode('.png', np.zeros((60, 80), np.uint8))
        message = CompressedImage(header=message.header, format='png',
                                  data=damaged(png.tobytes(), b'IHDR', rng))
    kind = int(rng.integers(4))
    if kind == 0:
        stamp = message.header.stamp
        stamp.sec, stamp.nanosec = _STAMPS[int(rng.integers(len(_STAMPS)))]
    elif kind == 1:
        wire: bytes = damaged(serialize_message(message), b'rgb8', rng)
        return wire
    elif kind == 2:
        message.header.frame_id = ('x' * 10_000, 'a\nb', '\x1b[31m')[int(rng.integers(3))]
    elif number % 2 == 0:
        message.height, message.width, message.step = (
            int(2 ** rng.uniform(0, 32)) - 1 for _ in range(3))
        message.encoding = ('rgb8', 'bayer_rggb8', '32FC1', 'yuv422', 'x')[int(rng.integers(5))]
    return message


def stream(nodes: int, rate_hz: float, seconds: float, node: str = 'lcd') -> Outcome:
    """Send a living node valid graphs at a rate; compare what it counts with what was sent."""
    outcome = Outcome(f'graphs of {nodes} nodes to {node} at {rate_hz:g} Hz',
                      'it lives; each graph is decided, or counted by the node as missing')
    slope = Slope()
    several = [graph(nodes, seed) for seed in range(20)]
    with living(node, (f'max_keyframes:={_KEYFRAMES}', 'min_gap_s:=1.0'), outcome) as world:
        if not world:
            return outcome
        sent, began = 0, time.monotonic()
        while time.monotonic() - began < seconds and world.process.poll() is None:
            while sent <= (time.monotonic() - began) * rate_hz:
                _send(world, several[sent % 20], sent)
                # The node counts from the first graph that it hears.
                if not sent and not world.until(lambda: bool(world.heard), _ANSWER_S):
                    break
                began, sent = began if sent else time.monotonic(), sent + 1
            world.executor.spin_once(timeout_sec=0.5 / rate_hz)
            if (world.count('keyframes') == _KEYFRAMES
                    and slope.is_due(time.monotonic() - began, seconds / 60)):
                slope.add(time.monotonic() - began, resident_mb(world.process.pid))
        world.settle()
        _compare(world, sent, outcome)
        outcome.note = f'{seconds:g} s; ' + (
            slope.text(60, f'a minute, from {_KEYFRAMES} keyframes on') or
            f'{world.count("keyframes")} keyframes at the end: no steady state to measure')
    return outcome


def _compare(world: World, sent: int, outcome: Outcome) -> None:
    """Hold what a node counted against what it was sent and what came out."""
    missing = world.count('graphs: missing')
    outcome.outcomes['decided'] += len(set(world.heard))
    outcome.outcomes['missing, as the node counts'] += missing
    if len(world.heard) != len(set(world.heard)):
        outcome.outcomes['BROKEN decided twice'] += len(world.heard) - len(set(world.heard))
    if world.count('received graphs') + missing != sent:
        outcome.outcomes['BROKEN neither received nor counted as missing'] += abs(
            sent - missing - world.count('received graphs'))
    if world.count('published loop closures') != world.count('received graphs'):
        outcome.outcomes['BROKEN received, and not decided'] += 1
    if len(world.heard) != world.count('published loop closures'):
        outcome.outcomes['decided, and lost on the way to the probe'] += (
            world.count('published loop closures') - len(world.heard))


def _send(world: World, one: MultiTierGraph, number: int) -> None:
    numbered = replace(one, sequence=number, stamp_ns=_FIRST + number * _STEP_NS)
    world.publishers[0].publish(wrap(codec.encode_graph(numbered)))
