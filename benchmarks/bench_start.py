# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start to ready of each node: processor time with compiled code from the cache, and without."""

import os
from pathlib import Path
import time

import pytest

pytest.importorskip('rclpy', reason='rclpy is not installed')

from adversarial_lcd_ros.evaluation.replay.domain import own_domain
from adversarial_lcd_ros.evaluation.replay.processes import node_environment
from adversarial_lcd_ros.evaluation.replay.supervision import READY, NodeProcess, ended_together

TOUR = Path(__file__).parents[1] / 'bags' / 'flat_tour'
NODES = {'lcd': (), 'attacker': (), 'graph_builder': ('-p', 'detector:=none'),
         'bag_replay': ('-p', f'bag:={TOUR}')}
STARTS = 3
WARM_MARK_S = 2.0
TIMEOUT_S = 120.0


def start_s(name, cache, folder):
    """Return the processor time of a node until it is ready, seconds."""
    running = []
    with own_domain() as domain, ended_together(running):
        node = NodeProcess(name, ('--ros-args', *NODES[name]) if NODES[name] else (),
                           {**node_environment(domain), 'NUMBA_CACHE_DIR': str(cache)},
                           folder / f'{name}.log')
        running.append(node)
        deadline_s = time.monotonic() + TIMEOUT_S
        while node.poll() is None and node.state != READY:
            assert time.monotonic() < deadline_s
            time.sleep(0.005)
        assert node.state == READY, node.failure()
        fields = Path(f'/proc/{node.pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


@pytest.mark.parametrize('name', NODES)
def test_start(measured, tmp_path, name):
    cache = tmp_path / 'cache'
    cache.mkdir()
    cold_s = start_s(name, cache, tmp_path)
    warm_s = sorted(start_s(name, cache, tmp_path) for _ in range(STARTS))[STARTS // 2]
    measured('start', f'{name} to ready, processor time', warm_s, 'nothing compiled yet', cold_s,
             mark=WARM_MARK_S)
