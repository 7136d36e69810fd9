# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""report.html: one file that holds all it shows, and opens offline and on a phone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
import shlex
from typing import Any

from jinja2 import TemplateError

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.page import NARROW, WIDE, data_uri, load_template
from adversarial_lcd_ros.evaluation.pictures import Picture, read_pictures, write_pictures
from adversarial_lcd_ros.evaluation.replay import findings, plots, tables
from adversarial_lcd_ros.evaluation.replay.records import (
    CLEAN,
    QueryRecord,
    read_records,
    runs_of,
    write_records,
)
from adversarial_lcd_ros.evaluation.replay.summary import as_document, from_document
from adversarial_lcd_ros.evaluation.results import (
    CONFIGURATION,
    ENVIRONMENT,
    RECORDS,
    REPORT,
    SUMMARY,
    ResultsFolder,
    read_json,
)
from adversarial_lcd_ros.files.writing import write_text
from adversarial_lcd_ros.ground_truth.labels import BY_INDEX, BY_POSES

_KIND_TEXT = (('positive', 'a loop is there to be found'),
              ('negative', 'a new place: no loop is there'),
              ('scale', 'seen before from nearer or further only: not scored'),
              ('between', 'between the two, or cannot be told: not scored'),
              ('no_candidate', 'too early: no frame is old enough'),
              ('no_ground_truth', 'no ground truth pose'))


def write_report(folder: Path, summary: Mapping[str, Any], records: Sequence[QueryRecord],
                 pictures: Sequence[Picture]) -> Path:
    """
    Write the pictures and report.html into a results folder; return the report's path.

    Configuration and environment are read from the folder (``ResultsFolder.write_setup``).

    Parameters
    ----------
    folder : Path
        Results folder, finished or not.
    summary : mapping
        From ``summarise``.
    records : sequence of QueryRecord
        From ``make_records``.
    pictures : sequence of Picture
        Query, match and attacked graph of telling frames.

    Raises
    ------
    EvaluationError
        The folder lacks configuration.json or environment.json, or records and summary are
        not of the same runs.

    """
    write_pictures(folder, pictures)
    return _render(folder, summary, records)


def write_results(folder: ResultsFolder, summary: Mapping[str, Any],
                  records: Sequence[QueryRecord], pictures: Sequence[Picture]) -> None:
    """Write summary, records, pictures and report of an evaluation whose setup is written."""
    folder.write_json(SUMMARY, as_document(summary))
    write_records(folder.path / RECORDS, records)
    write_report(folder.path, summary, records, pictures)


def report_folder(folder: Path, sections: Sequence[str] = ()) -> Path:
    """
    Write report.html of a results folder anew from what is in it; return its path.

    Parameters
    ----------
    folder : Path
    sections : sequence of str
        More sections, HTML as templates of this package made it, after the declines.

    Raises
    ------
    EvaluationError
        A file of the folder is missing or damaged.

    """
    try:
        return _render(folder, from_document(read_json(folder / SUMMARY)),
                       read_records(folder / RECORDS), sections)
    except (LookupError, TypeError, ValueError, AttributeError, TemplateError) as error:
        # Files may lack anything, or hold it in another form: no list of checks is complete.
        detail = f'{type(error).__name__}: {error}'
        raise EvaluationError(f'{folder} is no results folder of this release, or was changed '
                              f'({detail}): evaluate anew') from error


def _render(folder: Path, summary: Mapping[str, Any], records: Sequence[QueryRecord],
            sections: Sequence[str] = ()) -> Path:
    runs = runs_of(records)
    names = [CLEAN, *(attack['name'] for attack in summary['attacks'])]
    if list(runs) != names:
        raise EvaluationError(f'{folder}: records of {list(runs)}, summary of {names}: they are '
                              'not of one evaluation')
    configuration = read_json(folder / CONFIGURATION)
    clean = runs[CLEAN]
    attacks = [(wording.attack_title(attack), runs[attack['name']])
               for attack in summary['attacks']]
    detector = _detector_values(configuration)
    threshold = float(detector['threshold'])
    curve = plots.decline_over_threshold(clean, attacks, threshold)
    values = {
        'summary': summary, 'strongest': findings.strongest(summary), 'wording': wording,
        'headline': findings.headline(summary),
        'detector': wording.detector_title(summary.get('detector')),
        'meaning': findings.meaning(summary), 'behind_rows': tables.behind_rows(summary),
        'check': detector,
        'labelled': findings.is_labelled(summary),
        'decline_rows': tables.decline_rows(summary),
        'figure_rows': tables.figure_rows(summary),
        'curve': None if curve is None else data_uri(curve, 'svg+xml'),
        'timeline_wide': data_uri(plots.timeline(clean, attacks, threshold, WIDE),
                                  'svg+xml'),
        'timeline_narrow': data_uri(plots.timeline(clean, attacks, threshold, NARROW),
                                    'svg+xml'),
        'pictures': [(title, caption, data_uri(data, 'jpeg'))
                     for title, caption, data in read_pictures(folder)],
        'sections': sections, 'sample': _sample(summary), 'by_poses': (BY_POSES, BY_INDEX),
        'told_by': summary.get('told_by') or 'ground truth', 'configuration': configuration,
        'command_line': shlex.join(configuration['command_line']),
        'environment': read_json(folder / ENVIRONMENT)}
    path = folder / REPORT
    write_text(path, load_template('report.html.j2').render(values))
    return path


def _detector_values(configuration: Mapping[str, Any]) -> Mapping[str, Any]:
    # A results folder always holds the detector's settings; the first section is the clean run's.
    for section in configuration['settings']:
        if section['section'] == LcdConfig.title:
            values: Mapping[str, Any] = section['values']
            return values
    raise EvaluationError(f'{CONFIGURATION} has no section {LcdConfig.title!r}: the settings of '
                          'the detector are unknown')


def _sample(summary: Mapping[str, Any]) -> list[tuple[str, int, float]]:
    if not findings.is_labelled(summary):
        return []
    counts = {'positive': summary['positives'], 'negative': summary['negatives'],
              **summary['not_scored']}
    return [(text, counts[kind], counts[kind] / summary['frames'])
            for kind, text in _KIND_TEXT if counts[kind]]
