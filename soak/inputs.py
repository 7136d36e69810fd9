# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Valid things, and what damage does to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages import codec

_EXTREMES = [bytes(4), b'\xff' * 4, b'\xff\xff\xff\x7f', b'\0\0\0\x80', b'\0\0\xc0\x7f',
             b'\0\0\x80\x7f', b'\x01\0\0\0', b'\0\0\x80\xff', b'\xff\xff\x7f\x7f']


def graph(nodes: int, seed: int, *, stamp_ns: int = 10**9, sequence: int = 0) -> MultiTierGraph:
    """Return a graph of so many nodes, each joined with the three after it."""
    rng = np.random.default_rng(seed)
    tier = np.r_[np.zeros(2), np.ones(nodes - 2)].astype(np.uint8)
    descriptor = rng.integers(0, 256, (nodes, 32)).astype(np.uint8)
    descriptor[:2] = 0
    start = np.arange(nodes)
    edge = np.concatenate([np.stack([start, start + step], axis=1) for step in (1, 2, 3)])
    edge = np.unique(edge[edge[:, 1] < nodes], axis=0).astype(np.uint32)
    word = np.unique(rng.integers(0, 4096, nodes)).astype(np.uint32)
    made = MultiTierGraph(
        stamp_ns=stamp_ns, frame_id='camera', sequence=sequence, width=640, height=480, tier=tier,
        label=rng.integers(0, 3, nodes).astype(np.uint32),
        position=(rng.random((nodes, 2)) * (600, 440) + 20).astype(np.float32),
        size=np.full((nodes, 2), 20, np.float32), score=rng.random(nodes).astype(np.float32),
        descriptor=descriptor, edge=edge, edge_length=np.zeros(len(edge), np.float32), word=word,
        word_weight=np.full(len(word), 1 / len(word), np.float32))
    return replace(made, edge_length=made.length_between(edge))


def payloads() -> dict[str, list[bytes]]:
    """Return some valid payloads of messages, by name."""
    several = [graph(nodes, nodes) for nodes in (3, 12, 40)]
    decision = codec.LoopClosure(10**9, 'camera', 3, True, 0.7, 10**8, 1, 0.4, 3)
    return {
        'MultiTierGraph': [codec.encode_graph(one) for one in several],
        'LcdQuery': [codec.encode_query(codec.LcdQuery(n, one)) for n, one in enumerate(several)],
        'LoopClosure': [codec.encode_loop_closure(decision)]}


def damaged(data: bytes, other: bytes, rng: np.random.Generator) -> bytes:
    """Return some bytes with a few of them changed, an extreme number, cut, or grown."""
    work = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        kind, place = int(rng.integers(6)), int(rng.integers(max(len(work), 1)))
        if kind == 0:
            for at in rng.integers(0, max(len(work), 1), 4).tolist():
                work[at:at + 1] = bytes([int(rng.integers(256))])
        elif kind == 1:
            at = place // 4 * 4
            work[at:at + 4] = _EXTREMES[int(rng.integers(len(_EXTREMES)))]
        elif kind == 2:
            del work[place:]
        elif kind == 3:
            del work[place:place + int(rng.integers(1, 64))]
        elif kind == 4:
            start = int(rng.integers(max(len(other), 1)))
            work[place:place] = other[start:start + int(rng.integers(1, 64))]
        else:
            work[place:place + 1] = bytes([work[place] ^ (1 << int(rng.integers(8)))]) if work \
                else b''
    return bytes(work)
