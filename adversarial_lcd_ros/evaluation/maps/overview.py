# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Maps of several sequences on one page: one table over all of them, and theirs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from adversarial_lcd_ros.config import BACK_ENDS
from adversarial_lcd_ros.evaluation.maps.cases import ODOMETRY, WHOLE, YOUNG, title_of
from adversarial_lcd_ros.evaluation.maps.tables import (
    BACK_END_TITLES,
    Table,
    claim_tables,
    count,
    is_main,
    kept_tables,
    markdown,
    metres,
    run_tables,
    sweep_tables,
)
from adversarial_lcd_ros.evaluation.replay.records import CLEAN
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.evaluation.wording import UNDEFINED

Summaries = Mapping[str, Mapping[str, Any]]
_WORST = 'worst attack'
_TABLE = 'Absolute error in metres, young map / whole run'
_LEGEND = """\
Of attacks the largest mean error, for each back end apart; false closures are the most that any
of them got. **Bold**: off by more than odometry alone. Checked: a geometric check behind the
detector, of which the attacker did not know; a defence that is named was in the detector, and he
knew. Runs with the same figures share a line."""


def overview(summaries: Summaries) -> Table:
    """
    Return one table over sequences: clean runs and the worst attack, by back end.

    Parameters
    ----------
    summaries : mapping
        What to call each to the content of its summary.json.

    """
    return _TABLE, [{'sequence': name, **cells} for name, summary in summaries.items()
                    for cells in _merged(list(_sequence(summary)))]


def _sequence(summary: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in filter(is_main, summary['rows']):
        title = title_of(CLEAN if row['run'] == CLEAN else _WORST, row['setting'])
        groups.setdefault((row['setting'], title + (', checked' if row['checked'] else '')),
                          []).append(row)
    # Detector by detector, as they come; the clean run first.
    settings = list(dict.fromkeys(setting for setting, _ in groups))
    for (_, title), rows in sorted(groups.items(), key=lambda item: settings.index(item[0][0])):
        yield _cells(title, rows)


def _cells(title: str, rows: Sequence[Row]) -> dict[str, str]:
    worst = {(stage, back_end): max((row['ate_m'] for row in rows
                                     if (row['stage'], row['back_end']) == (stage, back_end)),
                                    default=None)
             for stage in (YOUNG, WHOLE) for back_end in BACK_END_TITLES}
    false = [max((row['false'] for row in rows if row['stage'] == stage), default=None)
             for stage in (YOUNG, WHOLE)]
    return {'run': title,
            'false closures': ' / '.join(UNDEFINED if each is None else count(each)
                                         for each in false),
            BACK_END_TITLES[ODOMETRY]: _both(worst, ODOMETRY),
            **{BACK_END_TITLES[back_end]: _both(worst, back_end) for back_end in BACK_ENDS}}


def _both(worst: Mapping[tuple[str, str], float | None], back_end: str) -> str:
    return ' / '.join(_marked(worst[stage, back_end], worst[stage, ODOMETRY])
                      for stage in (YOUNG, WHOLE))


def _marked(error: float | None, alone: float | None) -> str:
    text = metres(error)
    # As they are shown: what looks the same is no worse.
    is_worse = error is not None and alone is not None and round(error, 3) > round(alone, 3)
    return f'**{text}**' if is_worse else text


def page_of(summaries: Summaries, environments: Mapping[str, Mapping[str, Any]]) -> str:
    """
    Return the tables of several sequences as Markdown: the overview, then each folded away.

    Parameters
    ----------
    summaries : mapping
        As for ``overview``.
    environments : mapping
        The content of environment.json, by the same names.

    """
    parts = ['## All sequences\n', _LEGEND, '', markdown([overview(summaries)])]
    for name, summary in summaries.items():
        parts += [f'## {name}\n', _facts(summary, environments[name]), '',
                  '<details><summary>Tables</summary>\n',
                  markdown([(f'{name}: {title[0].lower()}{title[1:]}', rows)
                            for title, rows in _details(summary)]), '</details>\n']
    return '\n'.join(parts)


def _facts(summary: Mapping[str, Any], environment: Mapping[str, Any]) -> str:
    draws = max(row['draws'] for row in summary['rows'])
    untold = [run['untold'] for run in summary['runs']]
    return (f'{summary["sequence"]}, {summary["frames"]} frames, {draws} draws of the odometry '
            f'(seed {summary["seed"]}), code {environment["code"]}. Closures that could not be '
            f'told and made no edge: {min(untold)} to {max(untold)} a run.')


def _details(summary: Mapping[str, Any]) -> list[Table]:
    """Return the tables of a sequence; what was kept, and claims, of telling runs alone."""
    telling = _telling(summary)
    rows = [row for row in summary['rows'] if (row['run'], row['setting']) in telling]
    claims = {'rows': rows, 'claims': [row for row in summary['claims']
                                       if (row['run'], row['setting']) in telling]}
    kept = kept_tables([row for row in rows if row['run'] != CLEAN])
    runs = [(title, _merged(table)) for title, table in run_tables(summary)]
    return [*runs, *kept, *claim_tables(claims), *sweep_tables(summary['rows'])]


def _merged(table: Sequence[Mapping[str, str]]) -> list[dict[str, str]]:
    """Return the rows of a table with those together that say the same of several runs."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for row in table:
        run, *cells = row.values()
        groups.setdefault(tuple(cells), []).append(run)
    return [dict(zip(table[0], ('<br>'.join(runs), *cells), strict=True))
            for cells, runs in groups.items()]


def _telling(summary: Mapping[str, Any]) -> set[tuple[str, str]]:
    """Return, of each detector, the clean run and the attack with the most false closures."""
    telling = set()
    for setting in {run['setting'] for run in summary['runs']}:
        attacks = [run for run in summary['runs']
                   if run['setting'] == setting and run['run'] != CLEAN]
        telling |= {(CLEAN, setting)}
        if attacks:
            telling |= {(max(attacks, key=lambda run: int(run['false']))['run'], setting)}
    return telling
