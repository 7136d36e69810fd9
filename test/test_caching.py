# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compiled code: kept where it can be, and all of it there before the first real graph."""

from dataclasses import replace
import logging
from pathlib import Path
import sys

from graph_factory import suited
import numba
from numba.core.registry import CPUDispatcher
import pytest

from adversarial_lcd_ros import paths, preloading
from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.compiled import caching
from adversarial_lcd_ros.config import AttackConfig, BuilderConfig, LcdConfig
from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.evaluation.replay.offline import run_offline
from adversarial_lcd_ros.messages.codec import decode_graph, encode_graph
from adversarial_lcd_ros.registry import PERTURBATIONS, TARGETS
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.vision.builder import GraphBuilder


@pytest.fixture
def places(monkeypatch, tmp_path):
    """Return a function that says which folders can be written: 'given', 'package', 'cache'."""
    def can_be_written(*names):
        folders = {'given': tmp_path / 'given', 'cache': tmp_path / 'cache',
                   'package': Path(caching.__file__).parent}
        allowed = [folders[name] for name in names]
        monkeypatch.setattr(caching, '_writable', lambda folder: any(
            folder.is_relative_to(place) for place in allowed))
        return folders
    monkeypatch.setattr(numba.config, 'CACHE_DIR', '')
    monkeypatch.setenv('ADVERSARIAL_LCD_CACHE', str(tmp_path / 'cache'))
    caching.code_folder.cache_clear()
    yield can_be_written
    caching.code_folder.cache_clear()


def test_code_is_kept_beside_the_modules(places):
    folders = places('package', 'cache')
    assert caching.code_folder() == folders['package'].parent
    assert not numba.config.CACHE_DIR


def test_a_read_only_installation_keeps_code_with_the_user(places):
    folders = places('cache')
    assert caching.code_folder() == folders['cache'] / 'compiled'
    assert numba.config.CACHE_DIR == str(folders['cache'] / 'compiled')


def test_the_folder_that_is_named_comes_first(places, monkeypatch):
    folders = places('given', 'package', 'cache')
    monkeypatch.setattr(numba.config, 'CACHE_DIR', str(folders['given']))
    assert caching.code_folder() == folders['given']


@pytest.mark.parametrize('home', [True, False])
def test_where_nothing_can_be_written_functions_compile_and_it_is_said_once(
        places, monkeypatch, caplog, home):
    places()
    if not home:
        monkeypatch.delenv('ADVERSARIAL_LCD_CACHE')
        monkeypatch.delenv('XDG_CACHE_HOME', raising=False)
        monkeypatch.setattr(Path, 'home', no_home)
    with caplog.at_level(logging.WARNING):
        functions = [caching.compiled_with()(lambda x, k=k: x + k) for k in (1, 2)]
    assert [function(1) for function in functions] == [2, 3]
    assert [record.message for record in caplog.records] == [
        'compiled code cannot be kept, so that every start compiles for some seconds: set '
        'NUMBA_CACHE_DIR to a folder that can be written']


def no_home():
    raise RuntimeError('Could not determine home directory.')


def test_without_a_home_the_variable_to_set_is_named(monkeypatch, capsys):
    monkeypatch.delenv('ADVERSARIAL_LCD_CACHE', raising=False)
    monkeypatch.delenv('XDG_CACHE_HOME', raising=False)
    monkeypatch.setattr(Path, 'home', no_home)
    with pytest.raises(ModelError, match='no home folder'):
        paths.cache_folder()
    assert main(['fetch-model', '--anew']) == 2
    assert 'set ADVERSARIAL_LCD_CACHE' in capsys.readouterr().err


def test_compiling_where_nothing_can_be_kept_is_refused(places, capsys):
    places()
    assert main(['compile']) == 2
    assert 'set NUMBA_CACHE_DIR' in capsys.readouterr().err


def signatures():
    """Return how many types of arguments each compiled function has been made for."""
    found = {}
    for name, module in list(sys.modules.items()):
        if name.startswith('adversarial_lcd_ros.'):
            found |= {f'{name}.{key}': len(value.signatures)
                      for key, value in list(vars(module).items())
                      if isinstance(value, CPUDispatcher)}
    return found


@pytest.fixture(scope='module')
def tour():
    """Return some real graphs, as they come off the wire."""
    path = Path(__file__).resolve().parents[1] / 'bags' / 'flat_tour'
    if not path.is_dir():
        pytest.skip(f'{path} is not in this checkout')
    sequence = open_sequence(path)
    builder = GraphBuilder(BuilderConfig(detector='none'))
    graphs = [decode_graph(encode_graph(builder.build(frame.image(), frame.stamp_ns, '', number)))
              for number, frame in enumerate(sequence.frames(0, 40, 8))]
    builder.close()
    return graphs


def run_targets(graphs):
    for target in TARGETS:
        run_offline([suited(target, graph) for graph in graphs],
                    LcdConfig(target=target, min_gap_s=1.0))


def run_attacks(graphs):
    for attack in (AttackConfig(search='recall'),
                   *(AttackConfig(perturbation=name) for name in PERTURBATIONS)):
        run_offline(graphs[:3], LcdConfig(min_gap_s=1.0),
                    replace(attack, max_queries=6, queries_per_edit=1))


@pytest.mark.parametrize('run', [run_targets, run_attacks])
def test_no_real_graph_waits_for_a_compiler(tour, run):
    preloading.load_everything()
    before = signatures()
    run(tour)
    assert {name: count for name, count in signatures().items()
            if count > before.get(name, 0)} == {}
