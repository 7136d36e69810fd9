# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nothing that this package starts looks anything up or reports to anyone."""

import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest

import adversarial_lcd_ros

ROOT = Path(__file__).resolve().parents[1]
# With telemetry a session leaves its device id at once; "make soak" waits until it would report.
LIVE = """
import sys, time
from adversarial_lcd_ros.lcd.targets.gnn import GnnTarget
GnnTarget()
time.sleep(float(sys.argv[1]))
"""
WAIT_S = 3


def test_package_turns_telemetry_off_whoever_turned_it_on():
    code = 'import adversarial_lcd_ros, os; print(os.environ["ORT_DISABLE_TELEMETRY"])'
    for before in ({}, {'ORT_DISABLE_TELEMETRY': '0'}, {'ORT_DISABLE_TELEMETRY': ''}):
        done = subprocess.run([sys.executable, '-c', code], env=os.environ | before, check=True,
                              capture_output=True, text=True)
        assert done.stdout == '1\n'
    assert adversarial_lcd_ros
    assert os.environ['ORT_DISABLE_TELEMETRY'] == '1'


def test_sessions_of_onnxruntime_are_opened_in_one_place():
    found = {path.relative_to(ROOT).as_posix()
             for path in (ROOT / 'adversarial_lcd_ros').rglob('*.py')
             if 'onnxruntime.InferenceSession(' in path.read_text(encoding='utf-8')}
    assert found == {'adversarial_lcd_ros/files/network.py'}


def namespace_without_a_way_out():
    """Return the command that runs another one in such a network; skip, saying why, without."""
    if shutil.which('unshare') is None:
        pytest.skip('unshare is not installed: no network namespace without a way out')
    command = ['unshare', '--map-root-user', '--net']
    tried = subprocess.run([*command, 'true'], capture_output=True, text=True, check=False)
    if tried.returncode:
        pytest.skip(f'no network namespace may be made here: {tried.stderr.strip()}')
    return command


def traced(tmp_path, code, *arguments):
    """Return what a process sent and connected to, and the files that it left in its home."""
    home, trace = tmp_path / 'home', tmp_path / 'trace'
    home.mkdir()
    environment = {name: value for name, value in os.environ.items()
                   if name not in ('ORT_DISABLE_TELEMETRY', 'XDG_CACHE_HOME', 'RUNNER_TRACKING_ID',
                                   'CI', 'GITHUB_ACTIONS')}
    done = subprocess.run(
        [*namespace_without_a_way_out(), 'strace', '-f', '-qq', '-s', '200', '-o', str(trace),
         '-e', 'trace=connect,sendto,sendmsg,sendmmsg', sys.executable, '-c', code,
         *arguments], env=environment | {'HOME': str(home), 'PYTHONPATH': str(ROOT)},
        capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    lines = [line for line in trace.read_text(errors='replace').splitlines()
             if 'AF_INET' in line or 'sendmmsg' in line]
    return lines, sorted(str(path.relative_to(home)) for path in home.rglob('*')
                         if path.is_file())


@pytest.mark.skipif(shutil.which('strace') is None, reason='strace is not installed')
def test_living_process_with_a_network_looks_nothing_up_and_leaves_no_file(tmp_path):
    sent, left = traced(tmp_path, LIVE, str(WAIT_S))
    assert sent == []
    assert [name for name in left if 'numba' not in name and '__pycache__' not in name] == []
