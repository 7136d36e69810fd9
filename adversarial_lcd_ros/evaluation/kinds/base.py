# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What every kind of results folder can do.

What differs between kinds stands in one class each: ``report``, ``inspect`` and ``compare`` know
none by name.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.results import CONFIGURATION, SUMMARY
from adversarial_lcd_ros.evaluation.store import Row

Columns = Mapping[str, type | tuple[type, ...]]  # and the types that their values may have
MEASURED: tuple[type, ...] = (int, float)
NUMBER: tuple[type, ...] = (*MEASURED, type(None))  # undefined figures are null
INTERVAL: tuple[type, ...] = (list, type(None))


@dataclass(frozen=True, eq=False)
class Results:
    """
    What is in a results folder.

    Attributes
    ----------
    folder : Path
    summary, configuration, environment : mapping
        The JSON files of these names.

    """

    folder: Path
    summary: Mapping[str, Any]
    configuration: Mapping[str, Any]
    environment: Mapping[str, Any]

    @property
    def rows(self) -> list[Row]:
        """The rows of summary.json."""
        rows: list[Row] = self.summary['rows']
        return rows

    def section(self, title: str) -> Mapping[str, Any]:
        """Return the first settings of a title, as ``Config.title`` has it; empty without."""
        for section in self.configuration.get('settings', ()):
            if section['section'] == title:
                values: Mapping[str, Any] = section['values']
                return values
        return {}


@dataclass(frozen=True)
class Figure:
    """
    A figure of a run.

    Attributes
    ----------
    row : str
        What it is of, in words that another run has for the same.
    name : str
    value : float or None
        None: undefined.
    interval : (float, float) or None
        95 %.
    unit : str
        '%', 'points', or '' for a plain number.

    """

    row: str
    name: str
    value: float | None
    interval: tuple[float, float] | None = None
    unit: str = ''

    @classmethod
    def share(cls, row: str, name: str, value: float | None,
              interval: list[float] | None = None) -> Figure:
        """Return a figure in percent from one of 0 to 1."""
        return cls(row, name, None if value is None else 100 * value,
                   None if interval is None else (100 * interval[0], 100 * interval[1]), '%')

    @classmethod
    def points(cls, row: str, name: str, value: float | None,
               interval: list[float] | None) -> Figure:
        """Return a figure in percentage points."""
        return cls(row, name, value, None if interval is None else (interval[0], interval[1]),
                   'points')


@dataclass(frozen=True)
class FigureTable:
    """A title, and rows of heading to cell."""

    title: str
    rows: list[dict[str, str]]


class ResultsKind(ABC):
    """
    A kind of results folder. Subclass it, and override what is abstract.

    Attributes
    ----------
    name : str
        The ``kind`` in summary.json.
    schema : int
        Raised whenever the rows change their form: folders of others are refused.
    columns : mapping
        Columns that every row has, and the types that their values may have.
    main : str
        Name of the figure that a comparison draws.

    """

    name: ClassVar[str]
    schema: ClassVar[int]
    columns: ClassVar[Columns]
    main: ClassVar[str]

    def check(self, results: Results) -> None:
        """
        See that the rows, and the lists of settings, have their form.

        Raises
        ------
        EvaluationError
            Something is missing or of another type: the file is damaged.

        """
        path = results.folder / SUMMARY
        rows = results.summary.get('rows')
        if not isinstance(rows, list) or not rows or not all(isinstance(row, dict)
                                                             for row in rows):
            raise EvaluationError(f'{path} is damaged: expected a list "rows" of objects')
        for number, row in enumerate(rows, 1):
            check_columns(path, f'row {number}', row, self.columns)
        sections = results.configuration.get('settings', [])
        if not isinstance(sections, list) or not all(
                isinstance(entry, dict) and isinstance(entry.get('values'), dict)
                and isinstance(entry.get('section'), str) for entry in sections):
            raise EvaluationError(f'{results.folder / CONFIGURATION} is damaged: expected '
                                  '"settings", a list of sections with values')

    @abstractmethod
    def report(self, results: Results) -> Path:
        """Write the report anew from what is in the folder; return its path."""

    @abstractmethod
    def tables(self, results: Results) -> list[FigureTable]:
        """Return what "inspect" prints."""

    @abstractmethod
    def figures(self, results: Results) -> list[Figure]:
        """Return what "compare" lays side by side; no two of one row and name."""

    @abstractmethod
    def conditions(self, results: Results) -> dict[str, Any]:
        """Return what has to be equal for two runs to be comparable, by name: JSON values."""


def check_columns(path: Path, what: str, row: Mapping[str, Any],
                  columns: Columns) -> None:
    """Raise EvaluationError if a column is missing, or its value of a type it may not have."""
    for name, types in columns.items():
        value = row.get(name)
        if name not in row or not isinstance(value, types) or (
                types is INTERVAL and value is not None and not _is_interval(value)):
            found = repr(value)[:80] if name in row else 'missing'
            raise EvaluationError(f'{path} is damaged: {name} of {what} is {found}; make it again')


def _is_interval(value: Any) -> bool:
    return len(value) == 2 and all(isinstance(bound, (int, float)) for bound in value)
