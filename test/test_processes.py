# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Processes end together: with their parent, on signals at any time; and say why, once."""

import os
from pathlib import Path
import signal
import subprocess
import sys
import time

import pytest

from adversarial_lcd_ros.errors import ConfigError, EvaluationError
from adversarial_lcd_ros.evaluation.replay import supervision
from adversarial_lcd_ros.evaluation.replay.domain import own_domain
from adversarial_lcd_ros.evaluation.replay.supervision import (
    NodeProcess,
    await_end,
    ended_together,
)

ROOT = Path(__file__).resolve().parents[1]
TOUR = ROOT / 'bags' / 'flat_tour'
# Generous: the machine may be busy. What hangs would hang for ever.
DEADLINE_S = 300.0
RECIPE = """\
attacks:
  - {name: no flips, mode: pass, perturbation: random_flip, surrogate: none}
"""


def until(condition, deadline_s=DEADLINE_S):
    end_s = time.monotonic() + deadline_s
    while not (found := condition()):
        assert time.monotonic() < end_s, 'the condition did not come true in time'
        time.sleep(0.01)
    return found


def environment(**values):
    paths = os.pathsep.join(filter(None, [str(ROOT), os.getenv('PYTHONPATH')]))
    return {name: value for name, value in os.environ.items() if name != 'ROS_DOMAIN_ID'} | {
        'PYTHONPATH': paths, **values}


def command(*arguments, **options):
    return subprocess.Popen(
        [sys.executable, '-m', 'adversarial_lcd_ros.cli', *map(str, arguments)], text=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, **({'env': environment()} | options))


def children(process):
    """Return the process ids of what a process has started and has not ended."""
    found = []
    for status in Path('/proc').glob('[0-9]*/stat'):
        try:
            fields = status.read_text().rpartition(')')[2].split()
        except OSError:
            continue
        if int(fields[1]) == process.pid and fields[0] != 'Z':
            found.append(int(status.parent.name))
    return found


def lives(number):
    try:
        return Path(f'/proc/{number}/stat').read_text().rpartition(')')[2].split()[0] != 'Z'
    except OSError:
        return False


def maps(process, what):
    """Tell whether a process has loaded a library."""
    try:
        return what in Path(f'/proc/{process.pid}/maps').read_text()
    except OSError:
        return False


@pytest.fixture
def evaluation(tmp_path):
    """Return the command line of a short evaluation of two runs."""
    pytest.importorskip('rclpy', reason='rclpy is not installed')
    if not TOUR.is_dir():
        pytest.skip(f'{TOUR} is not in this checkout')
    recipe = tmp_path / 'recipe.yaml'
    recipe.write_text(RECIPE)
    return ('evaluate', TOUR, '--output', tmp_path / 'results', '--recipe', recipe,
            '--builder-detector', 'none', '--replay-stride', '60')


def test_an_evaluation_that_is_killed_takes_its_nodes_along_and_goes_on(evaluation, tmp_path):
    killed = command(*evaluation)
    for line in killed.stderr:
        if line.startswith('run 2 of 2'):
            break
    nodes = until(lambda: len(children(killed)) == 4 and children(killed))
    killed.kill()
    killed.wait()
    until(lambda: not any(lives(node) for node in nodes))
    (partial,) = (tmp_path / 'results').glob('*.partial')

    again = command(*evaluation)
    said = again.communicate(timeout=2 * DEADLINE_S)[1]
    assert again.returncode == 0, said
    assert 'run 1 of 2: clean: finished earlier' in said
    assert 'run 2 of 2: no flips\n' in said
    (folder,) = (path for path in (tmp_path / 'results').iterdir() if not path.is_symlink())
    assert folder.name == partial.name.removesuffix('.partial')
    assert '"ros_domain_id": ' in (folder / 'configuration.json').read_text()


def test_an_evaluation_that_is_interrupted_ends_all_with_130(evaluation):
    process = command(*evaluation)
    nodes = until(lambda: len(children(process)) == 3 and children(process))
    process.send_signal(signal.SIGTERM)
    said = process.communicate(timeout=DEADLINE_S)[1]
    assert process.returncode == 130, said
    assert said.endswith('\ninterrupted\n')
    assert 'Traceback' not in said
    assert not any(lives(node) for node in nodes)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_command_that_is_interrupted_while_it_imports_says_so(number):
    process = command('compile')
    until(lambda: maps(process, 'numpy'))
    process.send_signal(number)
    process.send_signal(number)
    said = process.communicate(timeout=DEADLINE_S)[1]
    assert (process.returncode, said) == (130, 'interrupted\n')


STATES = [supervision.STARTING, 'loading', 'compiling', supervision.READY]


@pytest.mark.parametrize('state', ['loading', 'compiling'])
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_node_that_is_interrupted_before_it_is_ready_ends_with_0(tmp_path, state, number):
    pytest.importorskip('rclpy', reason='rclpy is not installed')
    log = tmp_path / 'log'
    with own_domain() as domain:
        node = NodeProcess('lcd', (), environment(
            NUMBA_CACHE_DIR=str(tmp_path), ROS_DOMAIN_ID=str(domain),
            ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST'), log)
        # It may have gone on between two looks.
        until(lambda: node.poll() is not None or STATES.index(node.state) >= STATES.index(state))
        os.kill(node.pid, number)
        assert node.end(time.monotonic() + DEADLINE_S) == 0, log.read_text()
        node.close()
    assert 'Traceback' not in log.read_text()


def test_an_interrupt_within_an_executed_text_keeps_its_exit_code():
    process = subprocess.Popen(
        [sys.executable, '-c', 'from adversarial_lcd_ros.start import interruptible\n'
         'interruptible(130)\ntry:\n'
         '    exec("import time\\nprint(1, flush=True)\\ntime.sleep(600)")\n'
         'except KeyboardInterrupt:\n    print("caught")'],
        env=environment(), stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == '1\n'
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=DEADLINE_S)[0] == 'caught\n'
    assert process.returncode == 130


def test_code_that_swallows_the_interrupt_is_cut_off():
    process = subprocess.Popen(
        [sys.executable, '-c', 'from adversarial_lcd_ros.start import interruptible\n'
         'import time\ninterruptible(130)\ntry:\n'
         '    print("ready", flush=True)\n    time.sleep(600)\n'
         'except KeyboardInterrupt:\n    time.sleep(600)'],
        env=environment(), stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == 'ready\n'
    process.send_signal(signal.SIGINT)
    assert process.wait(DEADLINE_S) == 130
    process.stdout.close()


def test_an_interrupt_in_a_callback_from_c_prints_no_traceback():
    """It is lost there, as while compiling: what was interrupted so is cut off."""
    process = subprocess.Popen(
        [sys.executable, '-c', 'from adversarial_lcd_ros.start import interruptible\n'
         'import ctypes, os, signal, time\ninterruptible(130)\n'
         '@ctypes.CFUNCTYPE(None)\ndef callback():\n'
         '    os.kill(os.getpid(), signal.SIGINT)\n    time.sleep(0.01)\n'
         'callback()\ntime.sleep(600)'], env=environment(), stderr=subprocess.PIPE, text=True)
    assert process.communicate(timeout=DEADLINE_S)[1] == ''
    assert process.returncode == 130


class Peer:
    """A node as ``await_end`` sees it: states, then an exit code."""

    def __init__(self, name, *states, code=None):
        self.name, self._states, self._code = name, list(states), code
        self.state = 'starting'

    def poll(self):
        if self._states:
            self.state = self._states.pop(0)
            return None
        return self._code

    def failure(self):
        return EvaluationError(f'{self.name} failed')


def test_peers_are_waited_for_as_long_as_they_get_ready(monkeypatch):
    now_s = iter(range(0, 10**6, 50))
    monkeypatch.setattr(supervision.time, 'monotonic', lambda: float(next(now_s)))
    monkeypatch.setattr(supervision.time, 'sleep', lambda seconds: None)
    lcd = Peer('lcd', *['compiling'] * 100, *['ready'] * 10)
    replay = Peer('bag_replay', *['ready'] * 108, 'playing', code=0)
    told = []
    await_end(replay, [lcd], told.append)
    assert told[0] == 'after 50 s: lcd is compiling, bag_replay is ready'
    assert len(told) >= 100


def test_ready_nodes_that_do_not_find_each_other_are_told(monkeypatch):
    now_s = iter(range(0, 10**6, 50))
    monkeypatch.setattr(supervision.time, 'monotonic', lambda: float(next(now_s)))
    monkeypatch.setattr(supervision.time, 'sleep', lambda seconds: None)
    ready = [Peer(name, *['ready'] * 100) for name in ('bag_replay', 'lcd')]
    with pytest.raises(EvaluationError, match='do not find each other'):
        await_end(ready[0], ready[1:], lambda text: None)


def test_who_died_first_is_the_cause():
    lcd, replay = Peer('lcd', 'ready', code=-9), Peer('bag_replay', 'ready', code=1)
    with pytest.raises(EvaluationError, match='lcd failed'):
        await_end(replay, [lcd], lambda text: None)


def ended(log, *arguments, kill=False):
    """Start lcd, wait until it has ended, by SIGKILL or on its own."""
    pytest.importorskip('rclpy', reason='rclpy is not installed')
    running = []
    with ended_together(running):
        running.append(NodeProcess('lcd', arguments, environment(), log))
        if kill:
            os.kill(running[0].pid, signal.SIGKILL)
        until(lambda: running[0].poll() is not None)


def test_a_node_that_is_killed_is_named_with_its_signal(tmp_path):
    with pytest.raises(EvaluationError, match=r'^node lcd was ended by SIGKILL: it said nothing '
                       r'while starting \(log: '):
        ended(tmp_path / 'log', kill=True)


def test_a_node_that_refuses_its_parameters_is_told_in_its_words_once(tmp_path):
    log = tmp_path / 'log'
    with pytest.raises(EvaluationError, match='exit code 2: unknown parameter nonsense'):
        ended(log, '--ros-args', '-p', 'nonsense:=1')
    assert 'nonsense' not in log.read_text()


def test_runs_side_by_side_have_domains_of_their_own(monkeypatch):
    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    with own_domain() as one, own_domain() as other:
        assert one != other
        monkeypatch.setenv('ROS_DOMAIN_ID', str(one))
        with pytest.raises(EvaluationError, match=f'another run .* is in ROS domain {one}'), \
                own_domain():
            pass
    with own_domain() as again:
        assert again == one


@pytest.mark.parametrize('text', ['', 'seven', '-1', '233'])
def test_a_domain_that_is_none_is_refused(monkeypatch, text):
    monkeypatch.setenv('ROS_DOMAIN_ID', text)
    with pytest.raises(ConfigError, match='ROS_DOMAIN_ID'), own_domain():
        pass


@pytest.mark.parametrize('arguments', [
    ('-m', 'adversarial_lcd_ros.cli', 'demo'),
    ('-m', 'adversarial_lcd_ros.cli', 'evaluate', str(TOUR)),
    ('-m', 'adversarial_lcd_ros.nodes.lcd', '--help')])
def test_without_ros_one_line_names_the_extra(tmp_path, arguments):
    (tmp_path / 'rclpy.py').write_text('raise ImportError("librcl.so: not found")')
    done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True,
                          check=False, timeout=DEADLINE_S,
                          env=environment(PYTHONPATH=f'{tmp_path}{os.pathsep}{ROOT}'))
    assert done.returncode == 2
    assert done.stderr.count('\n') == 1
    assert 'librcl.so: not found' in done.stderr
    assert 'adversarial_lcd_ros[ros]' in done.stderr
