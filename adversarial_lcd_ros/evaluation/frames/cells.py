# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Cells of an evaluation by frames: one attack with its settings, on one sequence, with one seed.

A cell has a key, a digest of all that its figures depend on, and becomes one row of cells.jsonl
(``rows``).

The key is made of content (graphs, labels, models, settings, code), never of a path. The threshold
is a setting of a cell, like the size of the graph: declines hang on it more than on most attacks.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
import json
from pathlib import Path
from typing import Any

from adversarial_lcd_ros.attack.surrogate_data import data_path
from adversarial_lcd_ros.config import AttackConfig, LcdConfig, names_in
from adversarial_lcd_ros.environment import code_digest, named_code_digest
from adversarial_lcd_ros.evaluation.digests import file_digest
from adversarial_lcd_ros.evaluation.methods import COLUMNS, attack_columns, method_of
from adversarial_lcd_ros.files.digests import digest_of
from adversarial_lcd_ros.lcd.targets import decision_path, needed_variant
from adversarial_lcd_ros.registry import SEARCHES, YARDSTICKS

# Of the row's columns; a change in the code below runs cells again by itself.
SCHEMA = 7
# What makes the figures of a row.
_CODE = ('attack', 'lcd', 'graph', 'edge_rule', 'weisfeiler_lehman', 'keyframes', 'compiled',
         'messages', 'evaluation/metrics', 'evaluation/outcomes', 'evaluation/frames/attacked',
         'evaluation/frames/optimum', 'evaluation/frames/pairs', 'evaluation/frames/rows',
         'evaluation/frames/samples', 'evaluation/frames/sealed')
ORACLES = ('soft', 'hard')
JUDGED = ('frames', 'pairs')
SEALED = 'sealed graphs'
# Attack settings that have columns of their own.
_COLUMNS = ('mode', *COLUMNS, 'ratio', 'edits', 'queries_per_edit', 'seed')
# Files count by their content.
_FILES = ('surrogate_data',)


@dataclass(frozen=True)
class Cell:
    """
    An attack with its settings; sequence and seed come on top.

    Attributes
    ----------
    search : str
        That of ``attack``, or a yardstick in its place.
    attack : AttackConfig
        Its seed does not count, nor do settings that the search does not use.
    target : str
        The detector that judges.
    asked_target : str
        The detector that answers queries; another one for transfer.
    oracle : str
        soft: answers with probabilities; hard: decisions only.
    nodes : int
        Features of a graph, the builder's setting.
    frames : int
        Frames of each kind that are attacked with a seed.
    seeds : int
        Number of seeds.
    name : str
        For tables; may be empty.
    threshold : float
        Of the detectors: probability from which on a loop is declared.
    conditions : str
        Other settings of detector, graphs and labels that are not the default, in words.
    judged : str
        frames: against the map, the best candidate counts; pairs: against a given reference.
    detector : tuple of (str, value)
        Other settings of the detector that are not those of the experiment: its defences.
    aware : bool
        The detector that answers queries has them, too; else it has those of the experiment. Of
        sealed graphs: the attacker knows that whatever he changes is refused, and changes none.
    sealed : bool
        Builder and detector share a key, and the attacker has none.

    """

    search: str
    attack: AttackConfig
    target: str
    asked_target: str
    oracle: str
    nodes: int
    frames: int
    seeds: int
    name: str = ''
    threshold: float = LcdConfig.threshold
    conditions: str = ''
    judged: str = JUDGED[0]
    detector: tuple[tuple[str, Any], ...] = ()
    aware: bool = True
    sealed: bool = False

    @property
    def method(self) -> str:
        """What chooses the flips: a perturbation, or else a search."""
        return method_of(self._columns)

    @property
    def variant_needed(self) -> str:
        """Variant of graphs that one of its targets needs; '' if they take any."""
        return needed_variant(self.target, self.asked_target)

    @property
    def _columns(self) -> dict[str, str]:
        if self.search in YARDSTICKS:
            return {**dict.fromkeys(COLUMNS, ''), 'search': self.search}
        return attack_columns(self.attack)

    @property
    def _moved(self) -> str:
        used = () if self.search in YARDSTICKS else SEARCHES.find(self.search).own_settings
        return self.attack.moved if 'moved' in used else ''

    @property
    def variant(self) -> str:
        """Settings without a column of their own that are not the usual ones."""
        behind = ', '.join(f'{name} {value}' for name, value in self.detector)
        return ', '.join(filter(None, (self.attack.changed(*_COLUMNS, *_FILES), behind,
                                       SEALED if self.sealed else '',
                                       '' if self.aware else 'unaware', self.conditions)))

    @property
    def settings(self) -> dict[str, Any]:
        """What tells this cell from others, apart from its sample; the columns of a row."""
        return {'target': self.target, 'asked_target': self.asked_target, **self._columns,
                'oracle': self.oracle, 'mode': self.attack.mode, 'ratio': self.attack.ratio,
                'edits': self.attack.edits, 'queries_per_edit': self.attack.queries_per_edit,
                'nodes': self.nodes, 'threshold': self.threshold, 'judged': self.judged,
                'detector': ', '.join(f'{name} {value}' for name, value in self.detector),
                'aware': self.aware, 'sealed': self.sealed, 'moved': self._moved,
                'variant': self.variant}


def cell_key(cell: Cell, seed: int, stream: str, lcd: LcdConfig) -> str:
    """
    Return the digest of all that a cell's figures depend on, hexadecimal.

    Parameters
    ----------
    cell : Cell
    seed : int
    stream : str
        Digest of graphs and labels.
    lcd : LcdConfig
        Of the detectors, but for what the cell says.

    """
    detector = {name: value for name, value in asdict(
        detector_of(lcd, cell)).items()
        if name not in ('target', 'hard_answers', 'model')}
    attack = {name: value for name, value in asdict(cell.attack).items()
              if name not in ('seed', *_FILES)}
    values = {'schema': SCHEMA, 'stream': stream, 'seed': seed, 'frames': cell.frames,
              'attack': attack, **cell.settings, 'detector': detector,
              'code': [code_digest(*_CODE), *_own_code(cell, lcd)],
              'files': [file_digest(path) for path in _files(cell, lcd)]}
    return digest_of(json.dumps(values, sort_keys=True).encode())


def detector_of(lcd: LcdConfig, cell: Cell) -> LcdConfig:
    """Return the settings of the detector that judges in a cell, but for its target."""
    return replace(lcd, threshold=cell.threshold, **dict(cell.detector))


def _own_code(cell: Cell, lcd: LcdConfig) -> list[str]:
    """Return digests of the classes of the user's own, which are named as package.module:Class."""
    attack = [value for name, value in asdict(cell.attack).items() if name not in _FILES]
    defences = names_in(detector_of(lcd, cell).defences)
    named = [cell.target, cell.asked_target, cell.search, *defences, *attack]
    return [named_code_digest(name) for name in dict.fromkeys(named)
            if isinstance(name, str) and ':' in name]


def _files(cell: Cell, lcd: LcdConfig) -> list[Path]:
    files = [decision_path(lcd.model, target)
             for target in dict.fromkeys((cell.target, cell.asked_target))]
    if cell.attack.mode == 'surrogate' and cell.settings['surrogate']:
        files.append(data_path(cell.attack))
    return files
