# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every node as a process of its own, wired by remapping, over the wire, ended by SIGINT."""

import os
from pathlib import Path
import signal
import subprocess
import sys
import time

import pytest

from adversarial_lcd_ros.evaluation.replay.domain import own_domain
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.sequences.replay import read_payloads

pytest.importorskip('rclpy', reason='rclpy is not installed')

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

NODES = ('graph_builder', 'attacker', 'lcd', 'bag_replay')
ROOT = Path(__file__).resolve().parents[1]
TOUR = ROOT / 'bags' / 'flat_tour'
FRAMES, FRAME_S = 12, 0.2


def as_module(name):
    return [sys.executable, '-m', f'adversarial_lcd_ros.nodes.{name}']


def as_executable(name):
    path = Path(sys.prefix) / 'lib' / 'adversarial_lcd_ros' / name
    if not path.exists():
        pytest.skip(f'{path} is not installed: pip install .')
    return [str(path)]


class Processes:
    """Nodes as processes; whatever is left at the end is killed."""

    def __init__(self, folder, command, domain):
        self._folder, self._command = folder, command
        self._running = {}
        self._environment = os.environ | {'ROS_DOMAIN_ID': str(domain)}
        if command is as_module:
            self._environment['PYTHONPATH'] = os.pathsep.join(
                filter(None, [str(ROOT), os.getenv('PYTHONPATH')]))

    def start(self, name, *remaps, **parameters):
        command = [*self._command(name), '--ros-args']
        for remap in remaps:
            command += ['-r', remap]
        for key, value in parameters.items():
            command += ['-p', f'{key}:={value}']
        with open(self._folder / f'{name}.log', 'wb') as log:
            self._running[name] = subprocess.Popen(
                command, env=self._environment, stdout=log, stderr=subprocess.STDOUT)

    def log(self, name):
        return (self._folder / f'{name}.log').read_text(encoding='utf-8')

    def wait(self, name, timeout_s=300):
        """Return the exit code."""
        return self._running[name].wait(timeout_s)

    def interrupt(self, name):
        self._running[name].send_signal(signal.SIGINT)

    def kill(self):
        for process in self._running.values():
            if process.poll() is None:
                process.kill()
                process.wait()


@pytest.fixture
def domain():
    """Hold a domain: workers and other pipelines on this machine stay apart."""
    with own_domain() as number:
        yield number


@pytest.fixture
def await_node(monkeypatch, domain):
    """Return a function that waits until a node of a name is on the wire."""
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain,
               signal_handler_options=SignalHandlerOptions.NO)
    observer = rclpy.create_node('observer', context=context, use_global_arguments=False)

    def wait(name, deadline_s=300):
        end_s = time.monotonic() + deadline_s
        while name not in observer.get_node_names():
            assert time.monotonic() < end_s, f'{name} did not start'
            rclpy.spin_once(observer, executor=executor, timeout_sec=0.05)

    executor = SingleThreadedExecutor(context=context)
    yield wait
    executor.shutdown()
    observer.destroy_node()
    context.shutdown()


@pytest.fixture(params=[as_module, as_executable])
def processes(request, tmp_path, monkeypatch, domain):
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    started = Processes(tmp_path, request.param, domain)
    yield started
    started.kill()


def test_a_pipeline_of_processes_loses_nothing_and_ends_with_exit_code_0(
        processes, tmp_path, vocabulary, lcd_model):
    if not TOUR.is_dir():
        pytest.skip(f'{TOUR} is not in this checkout')
    # The others may take minutes to import where the machine is busy.
    processes.start('bag_replay', bag=TOUR, lockstep='true', record=tmp_path / 'record',
                    duration_s=FRAMES * FRAME_S - FRAME_S / 2, start_timeout_s='0.0',
                    timeout_s=120.0)
    processes.start('lcd', model=lcd_model, min_gap_s=1.0)
    processes.start('attacker', ratio=0.0003, queries_per_edit=1, max_queries=5,
                    query_timeout_s=60.0)
    processes.start('graph_builder', 'graph:=graph_clean', detector='none',
                    vocabulary=vocabulary)
    assert processes.wait('bag_replay') == 0, processes.log('bag_replay')
    assert f'{FRAMES} frames, {FRAMES} decisions' in processes.log('bag_replay')
    for name in ('graph_builder', 'attacker', 'lcd'):
        processes.interrupt(name)
    for name in ('graph_builder', 'attacker', 'lcd'):
        assert processes.wait(name) == 0, processes.log(name)
        assert 'Traceback' not in processes.log(name)
    readers = {'graph': codec.decode_graph, 'graph_clean': codec.decode_graph,
               'loop_closures': codec.decode_loop_closure,
               'attack_report': codec.decode_attack_report}
    stamps = {topic: tuple(read(payload).stamp_ns
                           for _, payload in read_payloads(tmp_path / 'record', topic))
              for topic, read in readers.items()}
    assert len(set(stamps.values())) == 1
    assert len(stamps['graph']) == FRAMES


@pytest.mark.parametrize('name', NODES)
def test_an_idle_node_ends_on_sigint_with_exit_code_0(
        processes, await_node, name, vocabulary, lcd_model):
    """Also while it waits for others, and with a second Ctrl-C while it cleans up."""
    parameters = {'graph_builder': {'detector': 'none', 'vocabulary': vocabulary},
                  'lcd': {'model': lcd_model}, 'bag_replay': {'bag': TOUR}}.get(name, {})
    if name == 'bag_replay' and not TOUR.is_dir():
        pytest.skip(f'{TOUR} is not in this checkout')
    processes.start(name, **parameters)
    await_node(name)
    processes.interrupt(name)
    processes.interrupt(name)
    assert processes.wait(name) == 0, processes.log(name)
    assert 'Traceback' not in processes.log(name)
