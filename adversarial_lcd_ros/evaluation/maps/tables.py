# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Maps in words and cells, for the terminal and the reports."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from adversarial_lcd_ros.config import BACK_ENDS
from adversarial_lcd_ros.evaluation.maps.cases import (
    CONSISTENT,
    ESSENTIAL,
    ODOMETRY,
    WHOLE,
    YOUNG,
    title_of,
)
from adversarial_lcd_ros.evaluation.maps.claims import QUANTILES
from adversarial_lcd_ros.evaluation.markdown import table_of
from adversarial_lcd_ros.evaluation.replay.records import CLEAN
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.evaluation.wording import UNDEFINED, mean_count, number

BACK_END_TITLES: Mapping[str, str] = {
    ODOMETRY: 'odometry alone',
    **dict(zip(BACK_ENDS, ('least squares', 'Huber', 'Cauchy', 'GNC'), strict=True))}
STAGE_TITLES = {YOUNG: 'young map', WHOLE: 'whole run'}
CLAIM_TITLES = {'': 'as set', ESSENTIAL: 'by features', CONSISTENT: 'false ones agree'}

Table = tuple[str, list[dict[str, str]]]


def metres(value: float | None) -> str:
    """Return a length in metres: millimetres below ten metres, else centimetres."""
    return number(value, 3 if value is None or abs(value) < 10 else 2)


def with_interval(value: float | None, bounds: Sequence[float] | None) -> str:
    """Return metres, with the half width of their interval where there is one."""
    if value is None or bounds is None:
        return metres(value)
    return f'{metres(value)} ± {metres((bounds[1] - bounds[0]) / 2)}'


def count(value: float) -> str:
    """Return a mean of counts, without decimals where all draws had as many."""
    return number(value, 0) if value == round(value) else mean_count(value)


def stage_title(row: Mapping[str, Any]) -> str:
    """Return which part of the run a map is of."""
    return f'{STAGE_TITLES[row["stage"]]}, {row["frames"]} frames'


def row_title(row: Mapping[str, Any]) -> str:
    """Return what a map is of, in words that another run has for the same."""
    parts = [run_title(row) if _is_declared(row) else closures_title(row),
             STAGE_TITLES[row['stage']]]
    if row['drift'] != 1.0:
        parts.append(f'{row["drift"]:g} times the drift')
    if row['claims']:
        parts.append(f'claims {CLAIM_TITLES[row["claims"]]}')
    return ', '.join(parts)


def run_title(row: Mapping[str, Any]) -> str:
    """Return whose closures a map has, of which detector, and whether they were checked."""
    title = title_of(row['run'], row['setting'])
    return f'{title}, checked' if row['checked'] else title


def closures_title(row: Mapping[str, Any]) -> str:
    """Return which closures a map of a sweep has."""
    if row['missing'] is not None:
        return f'{100 * row["missing"]:.0f} % of the right closures missing'
    kind = 'consistent' if row['consistent'] else 'scattered'
    closures = 'closure' if row['added'] == 1 else 'closures'
    return f'{row["added"]} {kind} false {closures}' if row['added'] else 'right closures alone'


def _is_declared(row: Mapping[str, Any]) -> bool:
    return row['added'] is None and row['missing'] is None


def is_main(row: Mapping[str, Any]) -> bool:
    """Tell whether a row is of a run as it was, with claims as set, and no sweep."""
    return _is_declared(row) and row['drift'] == 1.0 and not row['claims']


def all_tables(summary: Mapping[str, Any]) -> list[Table]:
    """Return the tables of a summary: runs by stage, what was kept, claims, then the sweeps."""
    rows = summary['rows']
    return [*run_tables(summary), *kept_tables(rows), *claim_tables(summary),
            *sweep_tables(rows)]


def run_tables(summary: Mapping[str, Any]) -> list[Table]:
    """Return the errors of the runs as they were, a table for each stage."""
    return list(_runs(summary['rows']))


def claim_tables(summary: Mapping[str, Any]) -> list[Table]:
    """Return the errors by what closures claim, and how far features' claims are off."""
    rows = [row for row in summary['rows'] if _is_declared(row) and not row['checked']]
    several = {(row['run'], row['setting']) for row in rows if row['claims']}
    tables = []
    if several:
        table = [{'run': run_title(of[0]), 'claims': CLAIM_TITLES[of[0]['claims']],
                  **_map_cells(of[0]), 'closures right / false': _closures(of), **_errors(of)}
                 for of in _together(row for row in rows
                                     if (row['run'], row['setting']) in several)]
        tables.append(('Absolute error in metres, by what closures claim', table))
    if summary['claims']:
        tables.append((
            f'Poses by features beside the truth, right closures: median / {QUANTILES[1]:.0%} '
            'of them below', [_claim_cells(row) for row in summary['claims']]))
    return tables


def _claim_cells(row: Row) -> dict[str, str]:
    def both(name: str, digits: int) -> str:
        return ' / '.join(number(value, digits) for value in row[name])

    return {'run': title_of(row['run'], row['setting']),
            'right with a pose': f'{row["right_posed"]} of {row["right"]}',
            'false with a pose': f'{row["false_posed"]} of {row["false"]}',
            'rotation off, degrees': both('rotation_deg', 1),
            'direction off, degrees': f'{both("direction_deg", 0)} (of {row["moved"]})',
            'translation off, m': both('translation_m', 2), 'true motion, m': both('true_m', 2)}


def markdown(tables: Sequence[Table]) -> str:
    """Return tables as Markdown, for a page."""
    return '\n'.join('\n'.join((f'### {title}\n', *table_of(rows), '')) for title, rows in tables)


def _runs(rows: Sequence[Row]) -> Iterator[Table]:
    main = [row for row in rows if is_main(row)]
    for stage in dict.fromkeys(row['stage'] for row in main):
        yield (f'Absolute error in metres, {_stage_of(main, stage)}',
               [{'run': run, 'closures right / false': _closures(of), **_errors(of)}
                for run, of in _by_run(main, stage).items()])


def kept_tables(rows: Sequence[Row]) -> Iterator[Table]:
    """Yield what back ends kept of the runs as they were, a table for each stage."""
    main = [row for row in rows if is_main(row)]
    for stage in dict.fromkeys(row['stage'] for row in main):
        table = [{'run': run, 'back end': BACK_END_TITLES[row['back_end']],
                  'error more than clean': with_interval(row['excess_m'], row['excess_ci95'])
                  if row['run'] != CLEAN or row['checked'] else '',
                  'right kept': f'{count(row["right_kept"])} of {count(row["right"])}',
                  'false kept': f'{count(row["false_kept"])} of {count(row["false"])}',
                  'relative error, m': metres(row['rpe_m']),
                  'degrees': number(row['rpe_deg'], 2),
                  'seconds': number(row['duration_s'], 2)}
                 for run, of in _by_run(main, stage).items()
                 for row in of if row['back_end'] != ODOMETRY]
        yield f'What back ends kept, {_stage_of(main, stage)}', table


def sweep_tables(rows: Sequence[Row]) -> Iterator[Table]:
    """Yield the errors over drift, false closures added, and right ones left out."""
    drifting = [row for row in rows
                if _is_declared(row) and not row['checked'] and not row['claims']]
    if any(row['drift'] != 1.0 for row in drifting):
        drifted = {(run_title(row), row['stage']) for row in drifting if row['drift'] != 1.0}
        chosen = [row for row in drifting if (run_title(row), row['stage']) in drifted]
        yield 'Absolute error in metres, over the drift of the odometry', [
            {'run': run_title(of[0]), **_map_cells(of[0]), **_errors(of)}
            for of in _grouped(chosen, 'run', 'setting', 'stage', 'drift')]
    for name, title in (('added', 'over the number of false closures'),
                        ('missing', 'over the share of right closures that are missing')):
        chosen = [row for row in rows if row[name] is not None]
        if chosen:
            yield f'Absolute error in metres, {title}', [
                {'closures': closures_title(of[0]), **_map_cells(of[0]), **_errors(of)}
                for of in _grouped(chosen, 'stage', 'drift', 'consistent', name)]


def _map_cells(row: Row) -> dict[str, str]:
    return {'map': STAGE_TITLES[row['stage']], 'drift': f'× {row["drift"]:g}'}


def _stage_of(rows: Sequence[Row], stage: str) -> str:
    return stage_title(next(row for row in rows if row['stage'] == stage))


def _by_run(rows: Sequence[Row], stage: str) -> dict[str, list[Row]]:
    groups: dict[str, list[Row]] = {}
    for row in rows:
        if row['stage'] == stage:
            groups.setdefault(run_title(row), []).append(row)
    return groups


def _together(rows: Iterable[Row]) -> list[list[Row]]:
    """Return rows of one map together, in the order in which they come, stage by stage."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault((row['stage'], run_title(row), row['drift'], row['claims']),
                          []).append(row)
    return list(groups.values())


def _grouped(rows: Sequence[Row], *names: str) -> list[list[Row]]:
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return [groups[key] for key in sorted(groups, key=lambda key: [
        (value != CLEAN, value != YOUNG, value) if isinstance(value, str) else value
        for value in key])]


def _closures(of: Sequence[Row]) -> str:
    return f'{count(of[0]["right"])} / {count(of[0]["false"])}'


def _errors(of: Sequence[Row]) -> dict[str, str]:
    found = {row['back_end']: with_interval(row['ate_m'], row['ate_ci95']) for row in of}
    return {title: found.get(name, UNDEFINED) for name, title in BACK_END_TITLES.items()}
