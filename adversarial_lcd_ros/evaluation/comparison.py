# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Two or more runs of one kind, side by side: what changed in figures, settings and versions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.kinds import open_results
from adversarial_lcd_ros.evaluation.kinds.base import Figure, Results

# What differs between any two runs.
_OF_EVERY_RUN = ('time_utc',)


@dataclass(frozen=True)
class FigureLine:
    """
    One figure in every run.

    Attributes
    ----------
    row, name, unit : str
        As in ``Figure``.
    figures : tuple of (Figure or None)
        One a run; None where the run has no such row.

    """

    row: str
    name: str
    unit: str
    figures: tuple[Figure | None, ...]

    @property
    def changed(self) -> bool:
        """Whether the runs differ in it."""
        first, *others = self.figures
        return any(other != first for other in others)

    def difference(self, run: int) -> float | None:
        """Return a run's figure minus that of the first run; None if either is not there."""
        values = [None if figure is None else figure.value
                  for figure in (self.figures[0], self.figures[run])]
        return None if values[0] is None or values[1] is None else values[1] - values[0]


@dataclass(frozen=True)
class Difference:
    """A setting or a version that is not the same in all runs; None: it is not there."""

    name: str
    values: tuple[Any, ...]


@dataclass(frozen=True)
class Comparison:
    """
    What changed between runs; the first is what the others are compared with.

    Attributes
    ----------
    kind : str
    main : str
        Name of the figure to draw.
    runs : tuple of str
        Their folders.
    figures : tuple of FigureLine
        All figures, changed or not.
    settings, versions : tuple of Difference
    warnings : tuple of str
        Why figures of these runs should not be compared as they are.

    """

    kind: str
    main: str
    runs: tuple[str, ...]
    figures: tuple[FigureLine, ...]
    settings: tuple[Difference, ...]
    versions: tuple[Difference, ...]
    warnings: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return everything, ready for JSON."""
        return {**asdict(self), 'figures': [
            {'row': line.row, 'figure': line.name, 'unit': line.unit,
             'values': [None if figure is None else figure.value for figure in line.figures],
             'intervals': [None if figure is None else figure.interval
                           for figure in line.figures],
             'differences': [line.difference(run) for run in range(len(self.runs))]}
            for line in self.figures]}


def compare(folders: Sequence[Path]) -> Comparison:
    """
    Compare results folders of one kind.

    Raises
    ------
    EvaluationError
        There are fewer than two, one is no results folder, or they are of different kinds.

    """
    if len(folders) < 2:
        raise EvaluationError(f'{len(folders)} results folder: expected two or more to compare')
    opened = [open_results(folder) for folder in folders]
    kinds = [kind.name for kind, _ in opened]
    if len(set(kinds)) > 1:
        raise EvaluationError('results of different kinds cannot be compared: ' + ', '.join(
            f'{folder} is "{kind}"' for folder, kind in zip(folders, kinds, strict=True)))
    kind, results = opened[0][0], [entry for _, entry in opened]
    conditions = [kind.conditions(entry) for entry in results]
    return Comparison(
        kind.name, kind.main, tuple(map(str, folders)),
        _figure_lines([kind.figures(entry) for entry in results]),
        _differences([_settings(entry) for entry in results]),
        _differences([_flat(entry.environment) for entry in results], _OF_EVERY_RUN),
        tuple(f'the runs differ in their {name}: '
              + '; '.join(f'{each.name} {_short(each.values)}' for each in _differences(
                  [_flat({'': entry[name]}) for entry in conditions]))
              for name in conditions[0]
              if any(entry[name] != conditions[0][name] for entry in conditions)))


def _figure_lines(runs: Sequence[Sequence[Figure]]) -> tuple[FigureLine, ...]:
    by_name = [{(figure.row, figure.name): figure for figure in run} for run in runs]
    for run, named in zip(runs, by_name, strict=True):
        if len(named) < len(run):
            raise EvaluationError('two rows of summary.json are of the same run: the file is '
                                  'damaged, make it again')
    names = dict.fromkeys(name for named in by_name for name in named)
    return tuple(_line([named.get(name) for named in by_name]) for name in names)


def _line(figures: Sequence[Figure | None]) -> FigureLine:
    known = next(figure for figure in figures if figure is not None)
    return FigureLine(known.row, known.name, known.unit, tuple(figures))


def _settings(results: Results) -> dict[str, Any]:
    """Return settings by a path of names; sections of one title are numbered."""
    values = {name: value for name, value in results.configuration.items()
              if name not in ('command_line', 'settings')}
    titles: dict[str, int] = {}
    for section in results.configuration.get('settings', ()):
        title = section['section']
        titles[title] = titles.get(title, 0) + 1
        number = f' {titles[title]}' if titles[title] > 1 else ''
        values[f'{title}{number}'] = section['values']
    return _flat(values)


def _flat(value: Any, path: str = '') -> dict[str, Any]:
    if isinstance(value, Mapping):
        entries = value.items()
    elif isinstance(value, list) and any(isinstance(entry, (dict, list)) for entry in value):
        entries = {_entry_name(entry, number): entry
                   for number, entry in enumerate(value)}.items()
    else:
        return {path: value}
    return {name: leaf for key, entry in entries
            for name, leaf in _flat(entry, f'{path}.{key}' if path else str(key)).items()}


def _entry_name(entry: Any, number: int) -> str:
    known = entry.get('source') if isinstance(entry, dict) else None
    return f'{number} ({known})' if known else str(number)


def _differences(runs: Sequence[Mapping[str, Any]],
                 without: Sequence[str] = ()) -> tuple[Difference, ...]:
    names = dict.fromkeys(name for run in runs for name in run if name not in without)
    found = (Difference(name, tuple(run.get(name) for run in runs)) for name in names)
    return tuple(entry for entry in found
                 if any(value != entry.values[0] for value in entry.values))


def _short(values: Sequence[Any]) -> str:
    return ' / '.join(str(value) for value in values)
