# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""summary.json of maps: means over draws, with intervals, against the clean run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from adversarial_lcd_ros.config import BACK_ENDS, MapConfig
from adversarial_lcd_ros.evaluation.intervals import mean_interval
from adversarial_lcd_ros.evaluation.maps.cases import GROUP, ODOMETRY
from adversarial_lcd_ros.evaluation.replay.records import CLEAN
from adversarial_lcd_ros.evaluation.results import summary_document
from adversarial_lcd_ros.evaluation.store import Row

if TYPE_CHECKING:
    from adversarial_lcd_ros.evaluation.maps.inputs import MapInputs

KIND, SCHEMA = 'map', 2
_MEANS = ('rpe_m', 'rpe_deg', 'right_kept', 'false_kept', 'duration_s')
_COUNTS = ('right', 'false', 'unposed')


def summarise_cases(cases: Sequence[Row]) -> list[Row]:
    """
    Return a row for each group of draws and back end: mean errors, with intervals.

    Parameters
    ----------
    cases : sequence of Row
        Columns of ``Case``, and what ``run_case`` found.

    Returns
    -------
    list of Row
        Columns of ``Case`` but for the draw, ``back_end`` ("odometry": without closures),
        ``draws``, ``ate_m`` with ``ate_ci95``, ``excess_m`` with ``excess_ci95`` (over the same
        draws with the closures of the clean run of that detector, or with none added or left out;
        None for these themselves), and means over the draws of what else a case has.

    """
    groups: dict[tuple[Any, ...], dict[int, Row]] = {}
    for case in cases:
        groups.setdefault(_group(case), {})[case['draw']] = case
    return [row for group, draws in groups.items()
            for row in _rows(draws, groups.get(_reference(group), {}))]


def _group(case: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(case[name] for name in GROUP)


def _reference(group: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the group that has the closures without harm."""
    names = dict(zip(GROUP, group, strict=True))
    names |= {'run': CLEAN, 'checked': False}
    if names['added'] is not None:
        names |= {'added': 0, 'consistent': False}
    if names['missing'] is not None:
        names['missing'] = 0.0
    return tuple(names.values())


def _rows(draws: Mapping[int, Row], reference: Mapping[int, Row]) -> Iterator[Row]:
    first = next(iter(draws.values()))
    for back_end in (ODOMETRY, *BACK_ENDS):
        found = [case['back_ends'][back_end] for case in draws.values()]
        error = np.array([figures['ate_m'] for figures in found])
        excess = np.array([case['back_ends'][back_end]['ate_m']
                           - reference[draw]['back_ends'][back_end]['ate_m']
                           for draw, case in draws.items() if draw in reference])
        harmed = reference is not draws and draws != reference and len(excess)
        yield {**{name: first[name] for name in GROUP}, 'back_end': back_end,
               'draws': len(draws), 'ate_m': float(error.mean()),
               'ate_ci95': mean_interval(error),
               'excess_m': float(excess.mean()) if harmed else None,
               'excess_ci95': mean_interval(excess) if harmed else None,
               **{name: _mean([case[name] for case in draws.values()]) for name in _COUNTS},
               **{name: _mean([figures[name] for figures in found]) for name in _MEANS}}


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def map_document(inputs: MapInputs, config: MapConfig, cases: Sequence[Row],
                 claims: Sequence[Row] = ()) -> dict[str, Any]:
    """
    Return the content of summary.json.

    ``shown`` names the cases with paths, by their keys in cells.jsonl; ``claims`` are from
    ``claim_errors``.
    """
    return summary_document(KIND, SCHEMA, summarise_cases(cases), {
        'sequence': inputs.name, 'frames': len(inputs.frame), 'first_loop': inputs.first_loop,
        'period_s': inputs.period_s, 'focal_px': inputs.focal_px, 'seed': config.seed,
        'claims': list(claims),
        'shown': [{name: case[name] for name in ('key', 'run', 'setting', 'checked', 'stage')}
                  for case in cases if 'truth' in case],
        'runs': [{'run': run.run, 'setting': run.setting,
                  'right': int((~run.pairs.is_false).sum()),
                  'false': int(run.pairs.is_false.sum()), 'untold': run.untold,
                  'unlocated': run.unlocated} for run in inputs.runs.values()]})
