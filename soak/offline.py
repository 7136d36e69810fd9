# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults that need no node: payloads, files, recordings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import shutil
from typing import Any

import numpy as np

from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.errors import AdversarialLcdError, CodecError
from adversarial_lcd_ros.evaluation.frames.recipe import load_cells
from adversarial_lcd_ros.evaluation.replay.recipe import load_recipe
from adversarial_lcd_ros.evaluation.replay.records import read_records
from adversarial_lcd_ros.evaluation.store import read_cells
from adversarial_lcd_ros.files.reading import read_json
from adversarial_lcd_ros.lcd.decision import Decision
from adversarial_lcd_ros.lcd.targets import TARGETS
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.paths import model_path, share_path
from adversarial_lcd_ros.sequences import import_sequence
from adversarial_lcd_ros.settings import load_settings
from adversarial_lcd_ros.vision.vocabulary import Vocabulary
from soak.inputs import damaged, payloads
from soak.outcome import Outcome, Slope, resident_mb

_SAMPLES = 60
_DECODERS = {'MultiTierGraph': codec.decode_graph, 'LcdQuery': codec.decode_query,
             'LoopClosure': codec.decode_loop_closure}


def fuzz_codec(count: int, seed: int = 0) -> Outcome:
    """Decode so many damaged payloads."""
    outcome = Outcome('damaged payloads to the codec', 'decoded, or refused by CodecError')
    rng, slope = np.random.default_rng(seed), Slope()
    pool = [(name, data) for name, several in payloads().items() for data in several]
    for number in range(count):
        name, data = pool[int(rng.integers(len(pool)))]
        payload = damaged(data, pool[int(rng.integers(len(pool)))][1], rng)
        try:
            _DECODERS[name](payload)
            outcome.outcomes['decoded'] += 1
        except CodecError:
            outcome.outcomes['refused'] += 1
        except Exception as error:
            outcome.outcomes[f'BROKEN {type(error).__name__}'] += 1
        if number % max(count // _SAMPLES, 1) == 0:
            slope.add(number, resident_mb())
    outcome.note = slope.text(10_000, 'per 10,000 payloads')
    return outcome


def _readers(work: Path) -> list[tuple[str, bytes, Callable[[Path], Any]]]:
    """Return name, valid content and reader of every kind of file that commands take."""
    recipes, channels = share_path('config/recipes'), TARGETS['wl'].channels
    cells = b'{"key": "a", "sequence": "tour", "decline_pp": 1.5, "frame_results": [{"x": 1}]}\n'
    return [
        ('settings.yaml', share_path('config/params.yaml').read_bytes()[:3000], load_settings),
        ('quick.yaml', (recipes / 'quick.yaml').read_bytes(),
         lambda path: load_recipe(str(path), {})),
        ('paper.yaml', (recipes / 'paper.yaml').read_bytes(),
         lambda path: load_cells(str(path), {'seeds': 1})),
        ('card.json', model_path('target_wl.json').read_bytes(),
         lambda path: Decision.load(path, 'wl', channels)),
        ('summary.json', b'{"attacks": [{"name": "a", "edits": 1.5}], "n": null}', read_json),
        ('per_query.csv', b'run,frame\nclean,1\n', read_records),
        ('cells.jsonl', cells, lambda path: read_cells(path.parent)),
        ('vocabulary.npz', model_path('vocabulary.npz').read_bytes(), Vocabulary.load)]


def fuzz_files(count: int, work: Path, seed: int = 0) -> Outcome:
    """Read so many damaged files."""
    outcome = Outcome('damaged settings, recipes, results, cards, vocabularies',
                      'read, or refused by one error of this package')
    rng, slope = np.random.default_rng(seed), Slope()
    readers = _readers(work)
    for number in range(count):
        name, data, read = readers[number % len(readers)]
        path = work / name
        path.write_bytes(damaged(data, readers[(number + 1) % len(readers)][1][:200], rng))
        try:
            read(path)
            outcome.outcomes['read'] += 1
        except AdversarialLcdError:
            outcome.outcomes['refused'] += 1
        except Exception as error:
            outcome.outcomes[f'BROKEN {name}: {type(error).__name__}'] += 1
        if number % max(count // _SAMPLES, 1) == 0:
            slope.add(number, resident_mb())
    outcome.note = slope.text(1000, 'per 1000 files')
    return outcome


def fuzz_imports(count: int, source: Path, work: Path, seed: int = 0) -> Outcome:
    """Import a folder of pictures so many times, one of its files damaged each time."""
    outcome = Outcome('recordings with a damaged file to "import"',
                      'a complete bag, or one error and no bag')
    rng = np.random.default_rng(seed)
    files = sorted(path for path in source.rglob('*') if path.is_file())
    for number in range(count):
        copy, bag = work / 'copy', work / 'bag'
        shutil.copytree(source, copy)
        path = copy / files[number % len(files)].relative_to(source)
        path.write_bytes(damaged(path.read_bytes(), b'1305031102.1 rgb/../x.png nan', rng))
        try:
            import_sequence(copy, bag)
            outcome.outcomes['imported' if (bag / 'metadata.yaml').is_file()
                             else 'BROKEN no bag'] += 1
        except AdversarialLcdError:
            outcome.outcomes['BROKEN half a bag' if bag.exists() else 'refused'] += 1
        except Exception as error:
            outcome.outcomes[f'BROKEN {type(error).__name__}'] += 1
        shutil.rmtree(copy)
        shutil.rmtree(bag, ignore_errors=True)
    left = [path.name for path in work.iterdir() if '.partial' in path.name]
    outcome.note = f'left behind: {len(left)} hidden folders'
    return outcome


def fuzz_config(count: int, seed: int = 0) -> Outcome:
    """Make settings of the attacker from so many mappings of any values."""
    outcome = Outcome('settings of any name, type and value', 'taken, or refused by ConfigError')
    rng = np.random.default_rng(seed)
    names = [*AttackConfig.__dataclass_fields__, 'nonsense', 3]
    values: list[Any] = [0, -1, 1, 2**70, 0.5, float('nan'), float('inf'), '', 'query', 'x' * 999,
                         None, [], {}, True, b'x']
    for _ in range(count):
        chosen = {names[int(rng.integers(len(names)))]: values[int(rng.integers(len(values)))]
                  for _ in range(int(rng.integers(1, 4)))}
        try:
            AttackConfig.from_mapping(chosen)
            outcome.outcomes['taken'] += 1
        except AdversarialLcdError:
            outcome.outcomes['refused'] += 1
        except Exception as error:
            outcome.outcomes[f'BROKEN {type(error).__name__}'] += 1
    return outcome
