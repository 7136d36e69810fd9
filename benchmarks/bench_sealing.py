# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a seal costs a graph, over both ends, beside the hashing that it is made of."""

import hashlib

from adversarial_lcd_ros.messages.codec import encode_graph
from adversarial_lcd_ros.messages.sealing import Sealer, opened

KEY = bytes(range(32))
MARK_S = 60e-6
CALLS = 50  # one takes less than the clock can be trusted with


def test_seal_and_open(record, tour_graphs):
    graph = tour_graphs(300)[20]
    payload, sealer = encode_graph(graph, session=1), Sealer(KEY)

    def both_ends():
        for _ in range(CALLS):
            opened(sealer.seal(payload), KEY)

    def hashing():
        for _ in range(2 * CALLS):
            hashlib.sha256(payload).digest()

    assert bytes(opened(sealer.seal(payload), KEY)[0]) == payload
    record('sealing', f'n = {graph.node_count}, {len(payload) / 1e3:.0f} kB, seal and open',
           both_ends, 'SHA-256 of these bytes, twice', hashing, MARK_S, higher_is_better=False,
           ours_units=CALLS, rival_units=CALLS)
