# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The folder of one evaluation: results/<UTC time>/, and ``latest`` beside it.

Complete or not there: written under another name, then renamed. summary.json has a ``kind``, the
``schema`` of its rows, and the rows; folders of another schema are refused, not guessed at.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from adversarial_lcd_ros.config import Config
from adversarial_lcd_ros.environment import environment
from adversarial_lcd_ros.errors import EvaluationError, FileError
from adversarial_lcd_ros.files import reading
from adversarial_lcd_ros.files.writing import write_json

SUMMARY, RECORDS, REPORT = 'summary.json', 'per_query.csv', 'report.html'
CONFIGURATION, ENVIRONMENT, PICTURES = 'configuration.json', 'environment.json', 'pictures'
LATEST = 'latest'
PARTIAL = '.partial'


class ResultsFolder:
    """
    A results folder that looks finished only when it is.

    It is filled as ``<time>.partial`` and renamed by ``finish``, which then lets ``latest``
    point to it. What was interrupted keeps its name and can be looked at.

    Attributes
    ----------
    path : Path
        Where to write; changes once, in ``finish``.

    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @classmethod
    def create(cls, root: Path, now: datetime | None = None) -> ResultsFolder:
        """
        Make ``root/<UTC time>.partial``.

        Raises
        ------
        EvaluationError
            The folder cannot be made.

        """
        time = (now or datetime.now(timezone.utc)).astimezone(timezone.utc)
        name = time.strftime('%Y-%m-%dT%H-%M-%SZ')
        try:
            root.mkdir(parents=True, exist_ok=True)
            return cls(_new_folder(root, name))
        except OSError as error:
            raise EvaluationError(f'no results folder can be made in {root}: {error.strerror}; '
                                  'choose another one') from error

    def write_json(self, name: str, values: Mapping[str, Any] | Sequence[Any]) -> None:
        """Write a JSON file; what is not a finite number becomes null."""
        write_json(self.path / name, values)

    def write_setup(self, sections: Sequence[Config], command_line: Sequence[str], seed: int,
                    extra: Mapping[str, Any] | None = None) -> None:
        """Write what the run was: effective settings, command line, versions, machine."""
        # Two attacks have two sections of one title: a list keeps both.
        settings = [{'section': section.title, 'values': asdict(section)}
                    for section in sections]
        self.write_json(CONFIGURATION, {
            'command_line': list(command_line), 'seed': seed, 'settings': settings,
            **(extra or {})})
        self.write_json(ENVIRONMENT, environment())

    def finish(self) -> Path:
        """
        Give the folder its final name, point ``latest`` to it, and return it.

        Raises
        ------
        EvaluationError
            summary.json, per_query.csv or report.html is missing, or ``latest`` is no link.

        """
        missing = [name for name in (SUMMARY, RECORDS, REPORT, CONFIGURATION, ENVIRONMENT)
                   if not (self.path / name).is_file()]
        if missing:
            raise EvaluationError(f'{self.path} is not complete: {", ".join(missing)} missing')
        final = self.path.with_name(self.path.name.removesuffix(PARTIAL))
        link, draft = final.parent / LATEST, final.parent / f'.{LATEST}-{final.name}'
        if link.exists() and not link.is_symlink():
            raise EvaluationError(f'{link} is in the way: expected a symbolic link or nothing; '
                                  'move it away')
        self.path.rename(final)
        self.path = final
        draft.symlink_to(final.name)
        draft.replace(link)  # atomic: "latest" never points to nothing
        return final


def _new_folder(root: Path, name: str) -> Path:
    # Two runs within a second get two folders.
    number = 1
    while True:
        unique = name if number == 1 else f'{name}-{number}'
        path = root / (unique + PARTIAL)
        if not (root / unique).exists():
            try:
                path.mkdir()
                return path
            except FileExistsError:
                pass  # taken by another process: try the next number
        number += 1


def summary_document(kind: str, schema: int, rows: Sequence[Mapping[str, Any]],
                     more: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """
    Return the content of summary.json, the same for every kind of results.

    Parameters
    ----------
    kind : str
        A name of ``kinds.KINDS``.
    schema : int
        Version of the rows.
    rows : sequence of mapping
        Column to value.
    more : mapping, optional
        What is true of all rows.

    """
    return {'kind': kind, 'schema': schema, **(more or {}), 'rows': list(rows)}


def read_json(path: Path) -> dict[str, Any]:
    """
    Read a JSON object of a results folder.

    Raises
    ------
    EvaluationError
        The file is missing or no JSON object.

    """
    try:
        values = reading.read_json(path)
    except FileError as error:
        raise EvaluationError(str(error)) from error
    if not isinstance(values, dict):
        raise EvaluationError(f'{path} holds a {type(values).__name__}: expected an object')
    return values
