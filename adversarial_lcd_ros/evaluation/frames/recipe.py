# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Recipes of evaluations by frames: attacks with their defaults, and axes that are multiplied out.

    protocol: frames
    seeds: 10
    frames: 6
    defaults: {target: wl, nodes: 300}
    attacks:
      - surrogate: [svm_rbf, svm_linear]
        ratio: [1e-4, 3e-4]

A setting with a list is an axis: this recipe has four attacks. An attack may say which ``part``
of the recipe it is, and parts can be run alone. ``detector`` holds settings of the detector by
name, such as ``{defences: geometric_check}``: attack and defence are chosen apart. Beside the
settings of the attacker an attack has those of ``CellConfig``; its search may be a yardstick. A
name may say settings of the attack, as in ``{name: '{nodes_moved} nodes', nodes_moved: [5, 9]}``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from itertools import product
import math
from pathlib import Path
import re
from typing import Any, ClassVar

from adversarial_lcd_ros.config import (
    AttackConfig,
    BuilderConfig,
    Config,
    LabelConfig,
    LcdConfig,
    setting,
)
from adversarial_lcd_ros.errors import ConfigError, with_suggestions
from adversarial_lcd_ros.evaluation.frames.cells import JUDGED, ORACLES, Cell
from adversarial_lcd_ros.evaluation.methods import used_settings
from adversarial_lcd_ros.evaluation.recipes import FRAMES, RINGS, SAMPLED, read_recipe
from adversarial_lcd_ros.registry import TARGETS, YARDSTICKS

_FLOATS = tuple(entry.name for entry in fields(AttackConfig) if isinstance(entry.default, float))
# Without their seeds; the paper's experiments have some hundred.
MAX_CELLS = 10_000
MAX_RUNS = 1_000_000
DETECTOR = 'detector'
_PLACE = re.compile(r'\{(\w+)\}')
_TOP = ('protocol', 'seeds', 'frames', 'defaults', 'labels', 'attacks')


@dataclass(frozen=True)
class CellConfig(Config):
    """What an attack of a recipe has beside the settings of the attacker."""

    title: ClassVar[str] = 'recipe'

    name: str = setting('', 'What tables call the attack; empty: by its settings.')
    target: str = setting('wl', 'The detector that is attacked.', choices=TARGETS)
    asked_target: str = setting(
        '', 'Transfer: the detector that answers queries; empty: the one attacked.',
        choices=TARGETS, empty=True)
    oracle: str = setting(
        'soft', 'soft: answers with probabilities; hard: decisions only.', choices=ORACLES)
    threshold: float = setting(
        LcdConfig.threshold, 'Probability from which on the detectors declare a loop.', low=0.0,
        high=1.0)
    judged: str = setting(
        JUDGED[0], 'frames: a frame against the map, as by the detector; pairs: a frame against '
        'one given reference and its window, half of them loops.', choices=JUDGED)
    aware: bool = setting(
        True, 'The detector that answers queries has the defences of the one attacked.')
    sealed: bool = setting(
        False, 'Builder and detector share a key (parameter key of their nodes). Who is aware of '
        'it changes nothing; what others send is refused, and counted.')
    nodes: int = setting(BuilderConfig.features, 'Features of a graph.', low=8, high=5000)
    frames: int = setting(
        6, 'Frames with a loop, and as many at new places, for each seed; or pairs of each kind.',
        low=1, high=100_000)
    seeds: int = setting(10, 'Seeds.', low=1, high=100_000)


def load_cells(name: str, overrides: Mapping[str, Any], only: Sequence[str] = ()) -> list[Cell]:
    """
    Return the cells of a recipe in its order, each once.

    Parameters
    ----------
    name : str
        A recipe that ships, or the path of a YAML file like config/recipes/paper.yaml.
    overrides : mapping
        Settings that win over those of every attack in the recipe. Of attacks that become equal
        by them the first counts.
    only : sequence of str
        Parts to take; all if none is named.

    Raises
    ------
    ConfigError
        There is no such recipe, or it is not of the expected form.

    """
    path, content = read_recipe(name)
    if content['protocol'] not in SAMPLED:
        raise ConfigError(f'recipe {path} is of the protocol "{content["protocol"]}": expected '
                          f'"{FRAMES}"')
    _check_names(path, 'the recipe', content,
                 (*_TOP, 'posters') if content['protocol'] == RINGS else _TOP)
    general: dict[str, Any] = {key: content[key] for key in ('seeds', 'frames')
                               if key in content}
    defaults = content.get('defaults') or {}
    cells: dict[str, Cell] = {}
    for entry in _parts(path, content['attacks'], only):
        for values in _multiplied(path, {**general, **_mapping(path, 'defaults', defaults),
                                         **_mapping(path, 'an attack', entry), **overrides}):
            cell = _cell(path, values)
            known = cells.setdefault(repr(cell.settings), cell)
            if not overrides and (known.frames, known.seeds) != (cell.frames, cell.seeds):
                raise ConfigError(f'recipe {path}: {cell.settings} is there twice, with other '
                                  'numbers of frames or seeds: expected it once')
            if len(cells) > MAX_CELLS:
                raise ConfigError(f'recipe {path} has more than {MAX_CELLS} attacks: expected '
                                  'fewer; cut it into several recipes')
    runs = sum(cell.seeds for cell in cells.values())
    if runs > MAX_RUNS:
        raise ConfigError(f'recipe {path}: {len(cells)} attacks with their seeds are {runs} '
                          f'cells on each sequence; expected at most {MAX_RUNS}')
    return list(cells.values())


def load_labels(name: str, chosen: Mapping[str, Any]) -> dict[str, LabelConfig]:
    """
    Return the labels of the sequences that need settings of their own, by name.

    Parameters
    ----------
    name : str
        As for ``load_cells``.
    chosen : mapping
        Settings of labels that win over those of the recipe.

    Raises
    ------
    ConfigError
        See ``load_cells``.

    """
    path, content = read_recipe(name)
    labels = content.get('labels') or {}
    if not isinstance(labels, dict) or not all(isinstance(own, dict) for own in labels.values()):
        raise ConfigError(f'recipe {path}, labels: expected SEQUENCE: {{NAME: VALUE}}, found '
                          f'{labels!r}')
    try:
        return {str(sequence): LabelConfig.from_mapping({**own, **chosen})
                for sequence, own in labels.items()}
    except ConfigError as error:
        raise ConfigError(f'recipe {path}: {error}') from error


def _parts(path: Path, entries: list[Any], only: Sequence[str]) -> list[Any]:
    """Return the attacks of some parts, without saying so any more."""
    part_of = [entry.get('part') if isinstance(entry, dict) else None for entry in entries]
    parts = {str(part): None for part in part_of if part is not None}
    unknown = [part for part in only if part not in parts]
    if unknown:
        raise ConfigError(f'recipe {path} has no part {", ".join(unknown)}; there are: '
                          f'{", ".join(parts) or "none"}')
    return [{name: value for name, value in entry.items() if name != 'part'}
            if isinstance(entry, dict) else entry
            for entry, part in zip(entries, part_of, strict=True)
            if not only or str(part) in only]


def _mapping(path: Path, what: str, values: Any) -> dict[str, Any]:
    if not isinstance(values, dict):
        raise ConfigError(f'recipe {path}, {what}: expected NAME: VALUE, found {values!r}')
    known = [entry.name for config in (CellConfig, AttackConfig) for entry in fields(config)
             if entry.name != 'seed'] + [DETECTOR]
    _check_names(path, what, values, known)
    return values


def _check_names(path: Path, what: str, values: Mapping[str, Any],
                 known: tuple[str, ...] | list[str]) -> None:
    unknown = sorted(str(name) for name in values if name not in known)
    if unknown:
        raise ConfigError(f'recipe {path}, {what}: unknown '
                          f'{with_suggestions(unknown, known)}; there are: '
                          f'{", ".join(known)}')


def _multiplied(path: Path, values: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    axes = {name: value if isinstance(value, list) else [value]
            for name, value in values.items()}
    empty = [name for name, axis in axes.items() if not axis]
    if empty:
        raise ConfigError(f'recipe {path}: {", ".join(empty)} is an empty list: expected values')
    count = math.prod(map(len, axes.values()))
    if count > MAX_CELLS:
        raise ConfigError(f'recipe {path}: an attack has {count} combinations of settings; '
                          f'expected at most {MAX_CELLS} in all')
    for choice in product(*axes.values()):
        yield dict(zip(axes, choice, strict=True))


def _cell(path: Path, values: Mapping[str, Any]) -> Cell:
    own_names = {entry.name for entry in fields(CellConfig)}
    values = {**values, 'name': _filled(path, values)} if 'name' in values else values
    detector = _detector(path, values.get(DETECTOR))
    values = {name: value for name, value in values.items() if name != DETECTOR}
    attack = {name: _number(value) if name in _FLOATS else value
              for name, value in values.items() if name not in own_names}
    search = attack.get('search', AttackConfig.search)
    unused: tuple[str, ...] = ()
    if search in YARDSTICKS:
        # It asks nobody and learns nothing: all else would tell equal cells apart.
        attack = {name: attack[name] for name in ('ratio', 'edits') if name in attack}
        unused = ('oracle', 'asked_target')
    try:
        own = CellConfig.from_mapping({name: value for name, value in values.items()
                                       if name in own_names and name not in unused})
        config = used_settings(AttackConfig.from_mapping(attack))
    except ConfigError as error:
        raise ConfigError(f'recipe {path}: {error}') from error
    known = asdict(own)
    return Cell(search, config, **{**known, 'asked_target': own.asked_target or own.target},
                detector=detector)


def _filled(path: Path, values: Mapping[str, Any]) -> str:
    """Return the name of an attack, with the settings that it names in their places."""
    name = str(values['name'])
    unknown = [found for found in _PLACE.findall(name) if found not in values]
    if unknown:
        raise ConfigError(f'recipe {path}, name {name!r}: {", ".join(unknown)} is no setting of '
                          'the attack: expected those that stand beside the name')
    return _PLACE.sub(lambda found: f'{values[found[1]]}', name)


def _detector(path: Path, values: Any) -> tuple[tuple[str, Any], ...]:
    values = {} if values is None else values
    if not isinstance(values, dict):
        raise ConfigError(f'recipe {path}, {DETECTOR}: expected settings by name, found '
                          f'{values!r}')
    taken = [name for name in ('target', 'threshold', 'hard_answers') if name in values]
    if taken:
        raise ConfigError(f'recipe {path}, {DETECTOR}: {", ".join(taken)} stand in the attack '
                          'itself, hard_answers as oracle')
    try:
        checked = asdict(LcdConfig.from_mapping(values))
    except ConfigError as error:
        raise ConfigError(f'recipe {path}, {DETECTOR}: {error}') from error
    return tuple((name, checked[name]) for name in sorted(values))


def _number(value: Any) -> Any:
    # YAML 1.1 takes 1e-4, without a point, for text.
    if isinstance(value, str):
        try:
            return float(value)
        except ValueError:
            return value
    return value
