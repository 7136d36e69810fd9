# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""per_query.csv: one row a frame and run, everything that the figures are made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import EvaluationError, FileError
from adversarial_lcd_ros.evaluation.outcomes import EFFECTS, outcomes
from adversarial_lcd_ros.files.reading import csv_rows
from adversarial_lcd_ros.files.writing import plain_cell, write_csv
from adversarial_lcd_ros.ground_truth.labels import (
    NEGATIVE,
    NO_MATCH,
    POSITIVE,
    RIGHT,
    UNTOLD,
    FrameLabels,
)
from adversarial_lcd_ros.messages.types import AttackReport, LoopClosure

CLEAN = 'clean'
_KINDS = {'positive': POSITIVE, 'negative': NEGATIVE}
NO_TRUTH = 'no_ground_truth'
# What the clean and the forwarded graph tell of an attack of which there is no report.
TOLD_BY_GRAPHS = ('edits', 'nodes_moved')
_PARSERS: dict[str, Callable[[str], Any]] = {
    'int': int, 'float': float, 'str': plain_cell, 'bool': {'0': False, '1': True}.__getitem__}


@dataclass(frozen=True)
class AttackRun:
    """
    What came back over the wire from the replay under one attack.

    Attributes
    ----------
    decisions : sequence of LoopClosure
    reports : sequence of AttackReport
    reported : bool
        The attacker made the reports; else they hold what the graphs tell (``TOLD_BY_GRAPHS``).

    """

    decisions: Sequence[LoopClosure]
    reports: Sequence[AttackReport]
    reported: bool = True


@dataclass(frozen=True)
class QueryRecord:
    """
    One frame in one run; the columns of per_query.csv.

    Attributes
    ----------
    run : str
        'clean', or the name of the attack.
    frame : int
        Index of the frame in the sequence.
    sequence_number : int
        Of the graph, as the builder counted.
    stamp_ns : int
        Of the frame.
    kind : str
        positive, negative, scale, between, no_candidate, no_ground_truth.
    probability, is_loop, candidates
        The detector's decision.
    match_frame : int or None
        Index of the best matching frame, declared or not.
    match_correct : bool
        That match is right.
    outcome : str
        TP, FN, WM, FP, TN; UM if nobody can say whether the match is right; empty if the frame is
        not scored.
    effect : str
        Against the clean run: suppressed, diverted, invented, regained, withdrawn, or empty;
        without ground truth what ``decision_change`` says.
    match_is : str
        What is said of the match: right, wrong, elsewhere (shares nothing, for certain), untold,
        or empty without one.
    status, reason, edit_budget, edits, query_budget, queries, loss_before, loss_after, duration_s
    node_budget, nodes_moved
        The attacker's report; None in the clean run.
    support : float or None
        How far a geometric check bears the declared loop out, 1: it stands; None if none is
        declared or nobody asked.

    """

    run: str
    frame: int
    sequence_number: int
    stamp_ns: int
    kind: str
    probability: float
    is_loop: bool
    candidates: int
    match_frame: int | None
    match_correct: bool
    outcome: str
    effect: str = ''
    match_is: str = ''
    status: str | None = None
    reason: str | None = None
    edit_budget: int | None = None
    edits: int | None = None
    query_budget: int | None = None
    queries: int | None = None
    loss_before: float | None = None
    loss_after: float | None = None
    duration_s: float | None = None
    support: float | None = None
    node_budget: int | None = None
    nodes_moved: int | None = None

    @property
    def label(self) -> int:
        """Return +1, -1 or 0 (not scored)."""
        return _KINDS.get(self.kind, 0)


def make_records(labels: FrameLabels, clean: Sequence[LoopClosure],
                 attacks: Mapping[str, AttackRun]) -> list[QueryRecord]:
    """
    Join labels, decisions and reports, frame by frame: first the clean run, then each attack.

    Raises
    ------
    EvaluationError
        A frame has no decision or no report, or more than one, or one in the wrong place: a
        figure over fewer frames would be another figure.

    """
    if CLEAN in attacks:
        raise EvaluationError(f'an attack is called {CLEAN!r}: that is the run without attack')
    records = _run_records(CLEAN, labels, clean)
    before = list(records)
    for name, run in attacks.items():
        _check_frames(f'attack {name}: attack reports', labels.stamp_ns, run.reports)
        rows = _run_records(name, labels, run.decisions)
        records += [
            QueryRecord(**{**asdict(row), **_report_fields(report, run.reported),
                           'effect': _effect(was, row)})
            for row, was, report in zip(rows, before, run.reports, strict=True)]
    return records


def decision_change(clean: QueryRecord, attacked: QueryRecord) -> str:
    """
    Return how a decision changed, whatever is right: silenced, raised, redirected, or ''.

    A loop declared before is silenced, or declared with another match (redirected); one that
    was not declared before is raised.
    """
    if clean.is_loop != attacked.is_loop:
        return 'silenced' if clean.is_loop else 'raised'
    return 'redirected' if clean.is_loop and clean.match_frame != attacked.match_frame else ''


def _effect(clean: QueryRecord, attacked: QueryRecord) -> str:
    if clean.kind == NO_TRUTH:
        return decision_change(clean, attacked)
    return EFFECTS.get((clean.outcome, attacked.outcome), '')


def _run_records(name: str, labels: FrameLabels,
                 decisions: Sequence[LoopClosure]) -> list[QueryRecord]:
    _check_frames(f'{name}: decisions', labels.stamp_ns, decisions)
    frame_of = {int(stamp): index for index, stamp in enumerate(labels.stamp_ns)}
    match = np.array([_match_frame(decision, frame_of) for decision in decisions], np.int64)
    match_is = labels.judge(np.arange(len(match)), match)
    correct = match_is == RIGHT
    is_loop = np.array([decision.is_loop for decision in decisions], bool)
    outcome = outcomes(labels.kind, is_loop, correct, match_is != UNTOLD)
    return [QueryRecord(
        run=name, frame=index, sequence_number=decision.sequence, stamp_ns=decision.stamp_ns,
        kind=labels.names[index], probability=decision.probability, is_loop=decision.is_loop,
        candidates=decision.candidates,
        match_frame=None if match[index] == NO_MATCH else int(match[index]),
        match_correct=bool(correct[index]), outcome=str(outcome[index]),
        match_is=str(match_is[index]))
        for index, decision in enumerate(decisions)]


def _match_frame(decision: LoopClosure, frame_of: Mapping[int, int]) -> int:
    if decision.match_stamp_ns is None:
        return NO_MATCH
    if decision.match_stamp_ns not in frame_of:
        raise EvaluationError(f'the decision at {decision.stamp_ns} ns names a match at '
                              f'{decision.match_stamp_ns} ns: no frame of this replay; was the '
                              'detector restarted before the run?')
    return frame_of[decision.match_stamp_ns]


def _check_frames(what: str, stamp_ns: NDArray[np.int64],
                  messages: Sequence[LoopClosure] | Sequence[AttackReport]) -> None:
    found = [message.stamp_ns for message in messages]
    wanted = [int(stamp) for stamp in stamp_ns]
    if found == wanted:
        return
    lost, extra = sorted(set(wanted) - set(found)), sorted(set(found) - set(wanted))
    detail = (f'{len(lost)} are missing, the first for the frame at {lost[0]} ns' if lost else
              f'{len(extra)} belong to no frame, the first at {extra[0]} ns' if extra else
              'some repeat or are out of order')
    raise EvaluationError(f'{what}: {len(found)} for {len(wanted)} frames; {detail}. The run '
                          'lost or repeated messages and gives no figure: run it again')


def _report_fields(report: AttackReport, reported: bool) -> dict[str, Any]:
    shared = {entry.name for entry in fields(QueryRecord)} - {'stamp_ns'}
    known = shared if reported else TOLD_BY_GRAPHS
    return {name: value for name, value in asdict(report).items() if name in known}


def runs_of(records: Sequence[QueryRecord]) -> dict[str, list[QueryRecord]]:
    """Return the records of every run by its name, in order of appearance."""
    runs: dict[str, list[QueryRecord]] = {}
    for record in records:
        runs.setdefault(record.run, []).append(record)
    return runs


def column(records: Sequence[QueryRecord], name: str) -> NDArray[Any]:
    """Return one attribute of all records as an array."""
    return np.array([getattr(record, name) for record in records])


def write_records(path: Path, records: Sequence[QueryRecord]) -> None:
    """Write records as CSV; None becomes an empty cell, truth 1 or 0."""
    write_csv(path, [entry.name for entry in fields(QueryRecord)], map(asdict, records))


def read_records(path: Path) -> list[QueryRecord]:
    """
    Read what ``write_records`` wrote.

    Raises
    ------
    EvaluationError
        The file is missing, has other columns, or a cell that is not of its column's type.

    """
    names = [entry.name for entry in fields(QueryRecord)]
    try:
        rows = csv_rows(path)
        _, header = next(rows, (0, []))
        if header != names:
            raise EvaluationError(f'{path} has the columns {header}: expected {names}; it is no '
                                  'per_query.csv of this version')
        return [_parse(path, line, cells) for line, cells in rows]
    except FileError as error:
        raise EvaluationError(str(error)) from error


def _parse(path: Path, line: int, cells: Sequence[str]) -> QueryRecord:
    values: dict[str, Any] = {}
    if len(cells) != len(fields(QueryRecord)):
        raise EvaluationError(f'{path}, line {line}: {len(cells)} cells; expected '
                              f'{len(fields(QueryRecord))}')
    for entry, text in zip(fields(QueryRecord), cells, strict=True):
        try:
            values[entry.name] = _cell(str(entry.type), text)
        except (ValueError, TypeError, KeyError) as error:
            raise EvaluationError(f'{path}, line {line}: {entry.name} is {text!r}, expected '
                                  f'{entry.type}') from error
    # CSV cannot tell an empty text from none: an attacked frame always has a status.
    if values['status'] is not None and values['reason'] is None:
        values['reason'] = ''
    return QueryRecord(**values)


def _cell(type_name: str, text: str) -> Any:
    kind, _, optional = type_name.partition(' | ')
    if optional and text == '':
        return None
    return _PARSERS[kind](text)
