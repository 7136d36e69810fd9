"""
Cells of an evaluation by frames: one attack with its settings, on one sequence, with one seed.

A cell has a key, a digest of all that its figures depend on, and becomes one row of cells.jsonl.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import lru_cache
import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.surrogate_data import data_path
from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.evaluation import metrics
from adversarial_lcd_ros.evaluation.methods import COLUMNS, attack_columns, method_of
from adversarial_lcd_ros.ground_truth.labels import NEGATIVE, POSITIVE
from adversarial_lcd_ros.lcd.targets import decision_path
from adversarial_lcd_ros.registry import YARDSTICKS

if TYPE_CHECKING:
    from adversarial_lcd_ros.evaluation.frames.attacked import FrameResult

# To be raised whenever the same settings give other figures: finished cells are run again.
SCHEMA = 3
ORACLES = ('soft', 'hard')
_TRACE_POINTS = 8
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

    @property
    def method(self) -> str:
        """What chooses the flips: a perturbation, or else a search."""
        return method_of(self._columns)

    @property
    def _columns(self) -> dict[str, str]:
        if self.search in YARDSTICKS:
            return {**dict.fromkeys(COLUMNS, ''), 'search': self.search}
        return attack_columns(self.attack)

    @property
    def variant(self) -> str:
        """Settings of the attack without a column of their own that are not the usual ones."""
        values = asdict(self.attack)
        return ', '.join(f'{entry.name} {values[entry.name]}' for entry in fields(AttackConfig)
                         if entry.name not in _COLUMNS + _FILES
                         and values[entry.name] != entry.default)

    @property
    def settings(self) -> dict[str, Any]:
        """What tells this cell from others, apart from its sample; the columns of a row."""
        return {'target': self.target, 'asked_target': self.asked_target, **self._columns,
                'oracle': self.oracle, 'mode': self.attack.mode, 'ratio': self.attack.ratio,
                'edits': self.attack.edits, 'queries_per_edit': self.attack.queries_per_edit,
                'nodes': self.nodes, 'threshold': self.threshold, 'variant': self.variant}


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
        replace(lcd, threshold=cell.threshold)).items()
        if name not in ('target', 'hard_answers', 'model')}
    attack = {name: value for name, value in asdict(cell.attack).items()
              if name not in ('seed', *_FILES)}
    values = {'schema': SCHEMA, 'stream': stream, 'seed': seed, 'frames': cell.frames,
              'detector': detector, 'attack': attack,
              **{name: value for name, value in cell.settings.items() if name not in detector},
              'files': [file_digest(path) for path in _files(cell, lcd)]}
    return digest_of(json.dumps(values, sort_keys=True).encode())


def _files(cell: Cell, lcd: LcdConfig) -> list[Path]:
    files = [decision_path(lcd.model, target)
             for target in dict.fromkeys((cell.target, cell.asked_target))]
    if cell.attack.mode == 'surrogate' and cell.settings['surrogate']:
        files.append(data_path(cell.attack))
    return files


@lru_cache(32)
def file_digest(path: Path) -> str:
    """Return the digest of a model file, hexadecimal; raises ModelError."""
    try:
        return digest_of(path.read_bytes())
    except OSError as error:
        raise ModelError(f'{path} cannot be read: {error.strerror}; name a file that '
                         '"adversarial-lcd train" wrote') from error


def digest_of(data: bytes) -> str:
    """Return the digest of some bytes, hexadecimal."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def make_row(cell: Cell, seed: int, sequence: str,
             results: Sequence[FrameResult]) -> dict[str, Any]:
    """
    Return the row of a finished cell, ready for JSON (docs/evaluation.md lists its columns).

    Parameters
    ----------
    cell : Cell
    seed : int
    sequence : str
        Name.
    results : sequence of FrameResult
        The attacked frames in order of time.

    """
    kind = np.array([result.kind for result in results], np.int8)
    before = _outcomes(kind, results, 'clean')
    after = _outcomes(kind, results, 'attacked')
    change = metrics.effect(kind, before, after)
    turned = [result.clean.is_loop != result.attacked.is_loop for result in results]
    attacks = [result.result for result in results]
    seconds = {name: sum(getattr(result, name) for result in results)
               for name in ('query_s', 'search_s', 'judge_s')}
    return {
        'sequence': sequence, **cell.settings, 'name': cell.name, 'seed': seed,
        'nodes_mean': _mean([attack.clean.node_count for attack in attacks]),
        'edges_mean': _mean([attack.clean.edge_count for attack in attacks]),
        'frames': len(results), 'positives': int((kind == POSITIVE).sum()),
        'negatives': int((kind == NEGATIVE).sum()),
        'accuracy_clean': _mean(metrics.right(before)),
        'accuracy_attacked': _mean(metrics.right(after)),
        'balanced_clean': _balanced(kind, before), 'balanced_attacked': _balanced(kind, after),
        'decline_pp': change.decline_pp, 'suppressed': change.suppressed,
        'invented': change.invented,
        'unattackable': sum(attack.edit_budget < 1 or attack.status == 'skipped'
                            for attack in attacks),
        'edits_mean': _mean([len(attack.flips) for attack in attacks]),
        'queries_mean': _mean([attack.queries for attack in attacks]),
        'success_rate': _mean(turned),
        'frame_results': [_frame(*entry) for entry in zip(results, before, after, strict=True)],
        'duration_s': sum(seconds.values()), **seconds}


def _outcomes(kind: NDArray[np.int8], results: Sequence[FrameResult],
              which: str) -> metrics.Outcomes:
    return metrics.outcomes(
        kind, np.array([getattr(result, which).is_loop for result in results], bool),
        np.array([getattr(result, f'{which}_right') for result in results], bool))


def _mean(values: Sequence[float] | NDArray[Any]) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _balanced(kind: NDArray[np.int8], outcome: metrics.Outcomes) -> float | None:
    rates = [_mean(metrics.right(outcome)[kind == value]) for value in (POSITIVE, NEGATIVE)]
    known = [rate for rate in rates if rate is not None]
    return sum(known) / 2 if len(known) == 2 else None


def _frame(result: FrameResult, before: str, after: str) -> dict[str, Any]:
    attack = result.result
    last = len(attack.trace) - 1
    shown = sorted({round(place) for place in np.linspace(0, max(last, 0), _TRACE_POINTS)})
    return {'stamp': attack.clean.stamp_ns, 'kind': result.kind, 'clean': str(before),
            'attacked': str(after), 'edit_budget': attack.edit_budget,
            'edits': len(attack.flips), 'queries': attack.queries, 'status': attack.status,
            'reason': attack.reason, 'loss_before': round(attack.loss_before, 4),
            'loss_after': round(attack.loss_after, 4),
            'trace': [round(attack.trace[place], 4) for place in shown if place <= last]}
