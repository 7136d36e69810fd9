# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The kinds of results folders: how each is read, reported, inspected and compared.

A new kind is a module with a subclass of ``ResultsKind`` and a line in ``KINDS``. What writes such
a folder puts ``summary_document(kind, schema, rows, ...)`` into summary.json and calls
``ResultsFolder.write_setup``.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.kinds.base import Results, ResultsKind
from adversarial_lcd_ros.evaluation.kinds.certificates import CertificatesResults
from adversarial_lcd_ros.evaluation.kinds.frames import FramesResults
from adversarial_lcd_ros.evaluation.kinds.labels import LabelsResults
from adversarial_lcd_ros.evaluation.kinds.maps import MapResults
from adversarial_lcd_ros.evaluation.kinds.replay import ReplayResults
from adversarial_lcd_ros.evaluation.kinds.rings import RingsResults
from adversarial_lcd_ros.evaluation.kinds.targets import TargetsResults
from adversarial_lcd_ros.evaluation.results import (
    CONFIGURATION,
    ENVIRONMENT,
    SUMMARY,
    read_json,
)

KINDS: Mapping[str, ResultsKind] = {kind.name: kind for kind in (
    ReplayResults(), FramesResults(), TargetsResults(), LabelsResults(), MapResults(),
    RingsResults(), CertificatesResults())}


def is_results(path: Path) -> bool:
    """Tell whether a path is a finished results folder."""
    return (path / SUMMARY).is_file()


def open_results(folder: Path) -> tuple[ResultsKind, Results]:
    """
    Return the kind of a results folder and what is in it, checked.

    Raises
    ------
    EvaluationError
        It is no finished results folder, of another version, of a kind that is not known, or
        damaged.

    """
    if not folder.is_dir():
        raise EvaluationError(f'there is no folder {folder}: expected a finished results folder')
    if not is_results(folder):
        raise EvaluationError(f'{folder} has no {SUMMARY}: expected a finished results folder of '
                              f'one of the kinds {", ".join(KINDS)}')
    summary = read_json(folder / SUMMARY)
    kind = KINDS.get(str(summary.get('kind')))
    if kind is None:
        found = f'the kind {summary["kind"]!r}' if 'kind' in summary else 'no kind'
        raise EvaluationError(f'{folder / SUMMARY} has {found}: expected one of '
                              f'{", ".join(KINDS)}; what another release wrote is to be made anew')
    if summary.get('schema') != kind.schema:
        raise EvaluationError(f'{folder / SUMMARY} has schema {summary.get("schema")!r} of the '
                              f'kind {kind.name}: this release reads {kind.schema}; run the '
                              'evaluation again')
    results = Results(folder, summary, read_json(folder / CONFIGURATION),
                      read_json(folder / ENVIRONMENT))
    kind.check(results)
    return kind, results
